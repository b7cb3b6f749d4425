"""The simplest model that is as good as the best, as far as left-out data can tell: the rule of one standard error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array


@dataclass(frozen=True)
class Ranked:
    """Numbers of the model of the least mean error and of the simplest within one standard error of it.

    `excess` and `spread`, (s,) each: the mean over the folds of a model's error less that of the best, and its standard error.
    """

    best: int
    chosen: int
    excess: Array
    spread: Array


def simplest_of(sizes: Sequence[int], errors: Array) -> Ranked:
    """Rank models of some `sizes` (s,) by their `errors` (s, f) on the same f folds, two at least.

    With `d_if = e_if - e_bf`, b the model of the least mean error, model i is within one standard error where
    `mean_f d_if <= sqrt(var_f d_if / f)`. The folds are compared one by one because some are harder for every model: the spread of the
    errors themselves (the rule of Breiman et al. 1984, section 3.4.3) would mostly be that of the folds.

    >>> errors = np.array([[3.0, 5.0, 4.0], [2.0, 4.1, 3.0], [2.0, 4.0, 3.1]])
    >>> ranked = simplest_of([1, 2, 8], errors)
    >>> ranked.best, ranked.chosen
    (1, 1)
    """
    means = errors.mean(axis=1)
    order = np.lexsort((means, np.asarray(sizes)))
    best = int(order[np.argmin(means[order])])  # of equals the simplest
    differences = errors - errors[best]
    excess, spread = differences.mean(axis=1), differences.std(axis=1, ddof=1) / np.sqrt(errors.shape[1])
    within = excess <= spread
    return Ranked(best, int(next(i for i in order if within[i])), excess, spread)
