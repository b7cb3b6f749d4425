"""Make the folds of a search that leave out stretches of curves. The stretches are as long as those
that the study holds out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import groupby

import numpy as np

from mapmore_cli.annexes.search.samples import Folds, Samples
from mapmore_cli.annexes.search.situation import Situation
from mapmore_cli.domain.arrays import IntArray
from mapmore_cli.domain.recording import Curve
from mapmore_cli.fitting.refitting import contiguous
from mapmore_cli.modelling.pieces.cross_validation import BLOCKS
from mapmore_cli.study.sections.split import Between, Holdout

LONGEST_FOLD = 1 / 3
"""Largest fraction of a recording that a fold leaves out, even if the study holds out longer runs
of samples.
"""


def stretches(
    samples: Samples, situation: Situation, held_out: Holdout | None, run: int
) -> tuple[str, Folds]:
    """Return a description of the folds, and their masks, (n,) each. Each fold leaves out a part of
    every curve.

    For recordings at equal steps, the parts are stretches of time as long as the held-out run.
    Otherwise, all samples are training samples, and the parts are bands of an input as wide as the
    held-out bands or, without such bands, stretches along each input. (If models do not depend on
    earlier samples, leaving out stretches of time would not test interpolation.) The ends of an
    input's range are not left out: a model could only extrapolate there, and its large errors would
    dominate the comparison.
    """
    if situation.timed:
        logs = [log[samples.training[log]] for log in samples.logs]
        words = f"each of {BLOCKS} stretches of the training samples of every recording"
        return words, _windows(logs, samples.size, run)
    bands = _bands(samples, {} if held_out is None else held_out.quantities, situation.moving)
    if bands:
        return f"each of {len(bands)} bands of an input, as wide as those held out", bands
    folds: Folds = []
    for name in situation.moving:
        x, inner = samples.columns[name], [np.arange(0)]
        for rows in samples.curves:
            if np.ptp(x[rows]) > 0:
                end = math.ceil(len(rows) / (BLOCKS + 2))
                inner.append(rows[np.argsort(x[rows], kind="stable")][end:-end])
        folds += contiguous(inner, BLOCKS, samples.size)
    words = f"each of {BLOCKS} inner stretches of the training samples of every curve"
    return words, folds


def _windows(logs: Sequence[IntArray], size: int, run: int) -> Folds:
    """Return the masks of `BLOCKS` folds, (size,) each. In each recording, a fold leaves out
    stretches of about `run` samples: up to `BLOCKS` stretches if they are short, or a single
    stretch if it is long. Long stretches of different folds may overlap. `logs` holds the row
    numbers of the training samples of each recording.
    """
    masks = np.zeros((BLOCKS, size), dtype=bool)
    for rows in logs:
        n = len(rows)
        count = BLOCKS * int(np.clip(n / (BLOCKS * max(run, 1)), 1, BLOCKS))
        share = max(1 / count, min(run / max(n, 1), LONGEST_FOLD))
        first = np.linspace(0, (1 - share) * n, count)
        ends = np.rint([first, first + share * n]).astype(int)
        for number, (start, stop) in enumerate(ends.T):
            masks[number % BLOCKS, rows[start:stop]] = True
    return list(masks)


def held_run(samples: Curve) -> int:
    """Return the typical length of a run of consecutive held-out samples: half of the held-out
    samples belong to runs that are at least as long.
    """
    runs = [
        len([*run])
        for log in samples.logs
        for held_out, run in groupby(samples.held_out[log])
        if held_out
    ]
    return int(np.quantile(np.repeat(runs, runs), 0.5, method="lower")) if runs else 0


def _bands(samples: Curve, held_out: Mapping[str, object], inputs: Sequence[str]) -> Folds:
    """Return folds that leave out bands of an input, as wide as the bands that the study holds out.
    The bands lie around evenly spaced quantiles of the samples.

    Bands are used because a block in the order of time would not test interpolation: if an input
    was swept more than once, its values in the block also occur outside the block.
    """
    folds: Folds = []
    for name, held in held_out.items():
        if name in inputs and isinstance(held, Between):
            low, high = np.array(held.between).T
            x = samples.columns[name]
            least, *middles, largest = np.quantile(x, np.linspace(0, 1, BLOCKS + 2))
            if ((low > least) & (high < largest)).any():
                folds += [np.abs(x - middle) <= np.median(high - low) / 2 for middle in middles]
    return folds
