"""Test whether the mean of a few independent numbers differs from zero, by Student's t test and by
permutation of their signs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray

LEAST_FOR_PERMUTATION, MOST_FOR_PERMUTATION = 6, 14
"""Numbers of values between which all combinations of signs are tried. With fewer values, no
combination is rarer than 1 in 20; with more, only a random part of the combinations is tried.
"""

# relative tolerance of the limit of one standard error, so that the order of folds has no influence
ROUNDING = 1e-9


@dataclass(frozen=True)
class Mean:
    """A mean with its confidence interval, and the p-value of the hypothesis that the mean is
    zero.
    """

    value: float
    interval: tuple[float, float]
    p: float


def weighted_mean(x: Array, weights: Array, confidence: float) -> Mean:
    """Return the weighted mean `m = sum(w x)/sum(w)` of K numbers x with its interval `m ± t(K - 1)
    s`, in which `s^2 = K/(K - 1) sum(w^2 (x - m)^2)/sum(w)^2`.

    With equal weights, this is Student's interval. The interval follows from the scatter between
    the numbers, whatever causes this scatter. If one number has nearly all the weight, the interval
    describes little more than that number. For a single number, the interval is infinite.
    """
    # imported here, because the import is slow and most runs do not need it
    from scipy.special import stdtr, stdtrit

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
    """Return the p-value of a permutation test: the fraction of all combinations of signs for which
    the mean is at least as large in magnitude as the observed mean. Return None if there are too
    few numbers.

    The test assumes that, if nothing changed, each number is as likely as its opposite. For more
    than 14 numbers, 16384 combinations are drawn with a fixed seed.
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


NOTHING, LOST = 1e-6, 1e6
"""Smallest and largest error that is compared, as fractions of the range. A smaller error is due to
rounding or to noise that has nothing to do with the structure. The largest error stands for a run
that diverged.
"""

WITHIN = (0.02, 0.18)
"""Smallest and largest value that is used as one standard error of the mean difference of
logarithms. They are the logarithms of ratios of 1.02 and 1.2. The lower limit is needed because new
data differ by more than that, even if all folds agree. The upper limit is needed because one
standard error can be very large with few folds.
"""

PRICE = 0.05
"""Price of a model's size if folds are stretches of recordings: factor of the logarithm of the
number of parameters.
"""


@dataclass(frozen=True)
class Ranked:
    """Indices of the model with the smallest error and of the model that is chosen.

    For each of s models, `excess`, (s,), is the mean (or median) over the folds of ln(error of the
    model / error of the best model), and `spread`, (s,), is the standard error of this mean.
    """

    best: int
    chosen: int
    excess: Array
    spread: Array


def simplest_of(
    sizes: Sequence[int] | Array,
    errors: Array,
    weights: Array | None = None,
    eligible: BoolArray | None = None,
    median: bool = False,
) -> Ranked:
    """Compare models by their errors on the same folds, and choose the smallest model that is
    within one standard error of the best and that no other model dominates.

    The models have `sizes` parameters, (s,). Their `errors`, (s, f), on f folds are fractions of a
    range. Let b be the model with the smallest mean logarithm of the error e, let `d_if = ln e_if -
    ln e_bf` for model i on fold f, and let the weights w of the folds add up to 1. Model i is
    within one standard error if `m_i = sum_f w_f d_if <= s_i`, with `s_i^2 = f/(f - 1) sum_f w_f^2
    (d_if - m_i)^2`, and s_i limited by `WITHIN`; for a single fold, s_i is the upper limit. The
    folds are compared one by one because some are harder for every model: the spread of the errors
    themselves (the rule of Breiman et al. 1984, section 3.4.3) would mostly show the differences
    between folds.

    - `eligible`: True for the models that may be chosen, (s,).
    - `median`: if True, the model with the smallest median over the folds plus `PRICE` ln(size) is
      chosen. A stretch of a recording may differ much from all others, and must not decide alone.

    >>> errors = np.array([[0.3, 0.5, 0.4], [0.2, 0.401, 0.3], [0.2, 0.4, 0.301]])
    >>> ranked = simplest_of([1, 2, 8], errors)
    >>> ranked.best, ranked.chosen
    (1, 1)
    """
    sized = np.maximum(np.asarray(sizes), 1)
    folds = errors.shape[1]
    share = np.full(folds, 1 / folds) if weights is None else weights / weights.sum()
    logs = np.log(np.clip(np.nan_to_num(errors, nan=LOST, posinf=LOST), NOTHING, LOST))
    middle = np.array([_median(each, share) for each in logs]) if median else _total(logs * share)
    score = np.where(
        True if eligible is None else eligible, middle + PRICE * np.log(sized) * median, np.inf
    )
    order = np.lexsort((score, sized))
    best = int(order[np.argmin(score[order])])  # the simplest of the models with the lowest score
    differences = logs - logs[best]
    mean = _total(differences * share)
    squares = _total((share * (differences - mean[:, None])) ** 2)
    spread = np.sqrt(folds / (folds - 1) * squares) if folds > 1 else np.full(len(logs), WITHIN[1])
    within = score - score[best] <= np.clip(spread, *WITHIN) * (1 + ROUNDING)
    within &= undominated(sized, score)
    chosen = best if median else int(next(i for i in order if within[i]))
    return Ranked(best, chosen, middle - middle[best], spread)


def undominated(sizes: Array, scores: Array) -> BoolArray:
    """Return True for each model, (s,), that no other model dominates. A model is dominated if
    another model has a lower score and not more parameters. A model with an infinite score gets
    False.

    >>> undominated(np.array([3, 6, 6, 9]), np.array([2.0, 0.9, 1.0, 0.5])).tolist()
    [True, True, False, True]
    """
    beaten = (sizes <= sizes[:, None]) & (scores < scores[:, None])
    return ~beaten.any(axis=1) & np.isfinite(scores)


def _total(values: Array) -> Array:
    """Return the sum of each row. Values are sorted first, so that the order of the columns changes
    no digit.
    """
    total: Array = np.sort(values, axis=1).sum(axis=1)
    return total


def _median(values: Array, share: Array) -> float:
    """Return the weighted median: the values below it have half of the total weight."""
    order = np.argsort(values)
    weight = share[order]
    return float(np.interp(0.5, np.cumsum(weight) - weight / 2, values[order]))
