"""Which structure is taken: least error on left-out training data, the simplest within one standard error."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.validation.significance import Ranked

NOTHING = 1e-6
"""Of the range: smaller errors are rounding, or noise that no structure is about."""

AS_GOOD, AS_GOOD_OF_TABLES = 0.05, 0.2
"""Excess of the mean logarithm, up to which a simpler structure is as good: with few folds, a standard error alone allows much more. A fold
of a table has a handful of samples, and its error differs by a fifth by chance."""

ASKED, OF_PARTS, OF_PARTS_OF_TABLES = 2 / 3, 0.5, 0.25
"""Weight of left-out levels or recordings: most where the study holds such out, as blocks of the others tell little of them. Where it holds
no level out of a table, they are few, and far apart without one."""

TOLD = 0.02
"""Excess, below which no fold tells structures apart, however much they agree: what is held out differs by more."""

LOST = 1e6
"""The error of a run that diverged."""


def chosen_of(sizes: Sequence[int], blocks: Array, parts: Array, tables: bool = False, asked: bool = True) -> Ranked:
    """Rank structures by their errors on left-out `blocks` (s, f), and on left-out levels or recordings, `parts` (s, g).

    Errors are fractions of the range of the target. What counts is the mean logarithm, so that no single block that lies far from the
    others decides: `(1 - weight) mean_f ln e_if + weight mean_g ln e_ig`; the blocks alone for g < 2. A structure is within one standard
    error of the best where its mean difference is no larger than the standard error of that mean over the folds (at least `TOLD`), and than
    `AS_GOOD` for half as many parameters (less for more): one parameter of seven is not worth 5 %.

    - `tables`: whether the samples are those of a table, not of recordings in order of time.
    - `asked`: whether the study itself holds whole levels or recordings out.
    """
    weight = ASKED if asked else OF_PARTS_OF_TABLES if tables else OF_PARTS
    as_good = AS_GOOD_OF_TABLES if tables else AS_GOOD
    groups = [(1.0, blocks)] if parts.shape[1] < 2 else [(1.0 - weight, blocks), (weight, parts)]
    logs = [(share, np.log(np.clip(np.nan_to_num(each, nan=LOST, posinf=LOST), NOTHING, LOST))) for share, each in groups]
    score = np.sum([share * each.mean(axis=1) for share, each in logs], axis=0)
    order = np.lexsort((score, np.asarray(sizes)))
    best = int(order[np.argmin(score[order])])
    differences = [(share, each - each[best]) for share, each in logs]
    excess = np.sum([share * d.mean(axis=1) for share, d in differences], axis=0)
    variance = np.sum([share**2 * d.var(axis=1, ddof=1) / d.shape[1] for share, d in differences], axis=0)
    spread = np.sqrt(variance)
    halvings = np.log2(max(sizes[best], 1) / np.maximum(np.asarray(sizes), 1))
    within = excess <= np.minimum(np.maximum(spread, TOLD), as_good * np.clip(halvings, 0, 1))
    return Ranked(best, int(next(i for i in order if within[i])), excess, spread)
