"""What a few independent numbers say of their mean: Student's t, and the permutation of their signs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from mapmore_cli.domain.arrays import Array

LEAST_FOR_PERMUTATION, MOST_FOR_PERMUTATION = 6, 14
"""With fewer numbers, no combination of signs is rarer than 1 in 20; with more, not all combinations are tried."""

ROUNDING = 1e-9  # what lies at the bound to this part of it is within: the order in which folds are added up decides nothing


@dataclass(frozen=True)
class Mean:
    """A mean with its interval, and p of the test that it is zero."""

    value: float
    interval: tuple[float, float]
    p: float


def weighted_mean(x: Array, weights: Array, confidence: float) -> Mean:
    """`m = sum(w x)/sum(w)` with the interval `m ± t(K - 1) s`, `s^2 = K/(K - 1) sum(w^2 (x - m)^2)/sum(w)^2`.

    With equal weights this is Student's interval. The scatter is taken from number to number, whatever it comes from. Where one of them has
    nearly all the weight, it is a statement about that one. Infinitely wide for a single number.
    """
    from scipy.special import stdtr, stdtrit  # loading it takes a third of an up-to-date run

    n, share = len(x), weights / weights.sum()
    mean = float(share @ x)
    if n < 2:
        return Mean(mean, (-math.inf, math.inf), 1.0)
    spread = math.sqrt(n / (n - 1) * float(np.sum((share * (x - mean)) ** 2)))
    if spread == 0:
        return Mean(mean, (mean, mean), 1.0 if mean == 0 else 0.0)
    half = float(stdtrit(n - 1, 0.5 + confidence / 2)) * spread
    return Mean(mean, (mean - half, mean + half), 2 * float(stdtr(n - 1, -abs(mean) / spread)))


def sign_permutation(x: Array) -> float | None:
    """Share of all combinations of signs whose mean is at least as large by size as the one found; None for too few numbers.

    Where nothing changed, a change and its opposite are equally likely for every curve. Beyond 14 numbers, 16384 combinations are drawn
    with a fixed seed.
    """
    n = len(x)
    if n < LEAST_FOR_PERMUTATION:
        return None
    if n <= MOST_FOR_PERMUTATION:
        signs = np.array(list(product((1.0, -1.0), repeat=n)))
    else:
        signs = np.random.default_rng(0).choice((1.0, -1.0), size=(2**MOST_FOR_PERMUTATION, n))
        signs[0] = 1.0
    return float(np.mean(np.abs(signs @ x) >= abs(x.sum()) * (1 - 1e-12)))


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
    within = excess <= spread * (1 + ROUNDING)
    return Ranked(best, int(next(i for i in order if within[i])), excess, spread)
