"""Weight samples by their uncertainty or by a robust loss, and compute standard errors that do not
assume independent residuals.

Sources: P. J. Huber, *Robust Statistics*, Wiley 1981, chapter 7; A. E. Beaton and J. W. Tukey,
Technometrics 16 (1974). The weights enter the term selection only as uncertainties of the samples.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray, root_mean_square
from mapmore_cli.domain.fits import Selection
from mapmore_cli.modelling.frols.correlated import MOST, correlated_errors
from mapmore_cli.modelling.frols.moments import Blocks, weighted

ROUNDS = 10  # largest number of times that weights are computed again for the same terms
SETTLED = 1e-8  # reweighting ends if no weight changes by more than this
# weight that replaces zero; it is so small that the sample has practically no influence
LEAST_WEIGHT = 1e-12
MAD = 1.4826  # ratio of the standard deviation of normal noise to its median absolute deviation
EXACT = 1e-12  # residuals below this fraction of the target are rounding errors


class RobustLoss(NamedTuple):
    """A robust loss, which gives samples with large residuals a smaller weight.

    - `tuning`: size of a residual r, in units of the scale, above which the weight of a sample is
      reduced. It is chosen so that the fit is 95 % efficient for normal noise.
    - `weight`: function that returns the weights w, (n,), at the sizes `|r|/tuning`.
    - `slope`: function that returns the derivative of `w(r) r` with respect to r, (n,), from the
      weights.
    """

    tuning: float
    weight: Callable[[Array], Array]
    slope: Callable[[Array], Array]


LOSSES: Mapping[str, RobustLoss] = {
    "huber": RobustLoss(
        1.345, lambda size: 1 / np.maximum(size, 1.0), lambda weights: weights == 1.0
    ),
    "bisquare": RobustLoss(
        4.685,
        lambda size: np.maximum(np.maximum(1 - size**2, 0.0) ** 2, LEAST_WEIGHT),
        lambda weights: np.sqrt(weights) * (5 * np.sqrt(weights) - 4),
    ),
}
"""Robust losses by name: `w = min(1, 1.345/|r|)`, and `w = (1 - (r/4.685)^2)^2`, which is zero
beyond 4.685.
"""

LARGEST_TUNING = max(loss.tuning for loss in LOSSES.values())
DEPENDENT = 1e-10  # singular values below this fraction of the largest one are regarded as zero
FREEDOM, GROSS = 3, 20.0
"""A sample is a gross outlier if its studentised residual is larger than `GROSS`, and if a
fit to the other samples has at least `FREEDOM` degrees of freedom. With three degrees of freedom,
one of 3 700 samples of normal noise has such a residual; with more degrees of freedom, fewer
samples have it.
"""
SHORT = 200
"""Largest number of samples among which gross outliers are searched. Among more samples, no single
sample has so much leverage that a robust loss misses it.
"""
FEW = 5
"""Smallest number of curves from which standard errors are computed. With fewer curves, the sums
over curves vary so much by chance that the standard errors would be a guess.
"""


@dataclass(frozen=True)
class Weighing:
    """Weights of n samples.

    - `uncertainty`: standard deviation of each sample, (n,). ERR, `sse` and `yy` of a selection
      then refer to the weighted columns.
    - `loss`: `squares`, or one of the `LOSSES`, which give large residuals less weight.
    - `scale`: scale of the residuals; None for 1.4826 times their median absolute value.
    - `curves`: curve of each sample, (n,), if the residuals of a curve are correlated.
    - `alike`: True if all curves have the same weight, whatever their number of samples.
    - `recorded`: position of each sample in the order of time, (n,), if it is known.
    - `start`: weights of the samples, (n,), with which a robust loss chooses the first terms; equal
      weights if None.
    - `outlier`: index of a sample that gets almost no weight, because it bends the fit towards
      itself.
    """

    uncertainty: Array | None = None
    loss: str = "squares"
    scale: float | None = None
    curves: IntArray | None = None
    alike: bool = False
    recorded: IntArray | None = None
    start: Array | None = None
    outlier: int | None = None

    @cached_property
    def sigma(self) -> Array | None:
        """Divisor `sigma` of each row, (n,); None if all samples have the same weight. The weight
        of a sample is `1/sigma^2`. The divisors are scaled so that the mean weight is one, and
        weighted squares keep the unit of the target.
        """
        sigma = self.uncertainty
        if self.alike and self.curves is not None:
            root = np.sqrt(np.bincount(self.curves))[self.curves]
            sigma = root if sigma is None else sigma * root
        return None if sigma is None else np.asarray(sigma * np.sqrt(np.mean(sigma**-2.0)))

    def by(self, weights: Array | None) -> Array | None:
        """Return the divisor of each row, `sigma / sqrt(weights)`, (n,), in which `sigma` is 1 if
        it is None. Least squares on the divided rows gives each sample the weight
        `weights / sigma^2`.
        """
        if weights is None:
            return self.sigma
        return (1.0 if self.sigma is None else self.sigma) / np.sqrt(weights)

    def in_unit(self, unit: float) -> Weighing:
        """Return the weighing for a target whose values are divided by `unit`."""
        return self if self.scale is None else replace(self, scale=self.scale / unit)

    def without(self, outlier: int | None, weights: Array) -> Weighing:
        """Return the weighing that starts with the given weights, (n,). If `outlier` is the index
        of a sample, this sample gets almost no weight.
        """
        start = weights.copy()
        if outlier is not None:
            start[outlier] = LEAST_WEIGHT
        return replace(self, start=start, outlier=outlier)

    def rows(self, blocks: Blocks) -> Blocks:
        """Return the blocks with each row divided by its `sigma`."""
        return blocks if self.sigma is None else weighted(blocks, self.sigma)

    def settled(
        self, loss: str, chosen: Blocks, weights: Array | None
    ) -> tuple[Array, float, Array]:
        """Compute robust weights for a fit with the chosen columns. Return the weights after
        convergence, the scale of the residuals, and the divisor of each row (see `by`).
        """
        P, y = map(np.concatenate, zip(*self.rows(chosen)(), strict=True))
        weights = np.ones(len(y)) if weights is None else weights
        for _ in range(ROUNDS):
            root = np.sqrt(weights)
            residual = y - P @ np.linalg.lstsq(P * root[:, None], y * root, rcond=None)[0]
            scale = float(self.scale or scale_of(residual, y))
            before, weights = weights, loss_weights(loss, residual / scale)
            if self.outlier is not None:
                weights[self.outlier] = LEAST_WEIGHT
            if np.abs(weights - before).max() < SETTLED:
                break
        sigma = self.by(weights)
        assert sigma is not None
        return weights, scale, sigma


@dataclass(frozen=True)
class Choice:
    """A selection for one output, whose standard errors do not yet take the weights into account.
    To compute the correct standard errors takes about as much time as the selection itself.
    Therefore, `with_errors` computes them only for the selection that is used in the end.

    - `only`: function that returns the blocks of some candidates.
    - `weights`: weights of a robust loss, (n,); None for the loss `squares`.
    """

    selection: Selection
    weighing: Weighing
    only: Callable[[IntArray], Blocks]
    weights: Array | None

    def with_errors(self) -> Selection:
        """Return the selection with standard errors that take two facts into account: residuals are
        correlated within curves or along a few recordings, and samples have robust weights.
        """
        selection, how, weights = self.selection, self.weighing, self.weights
        k, n = len(selection.chosen), selection.samples
        curves = numbered_curves(how.curves, k)
        if k and (weights is not None or curves is not None):
            blocks = how.rows(self.only(selection.chosen))
            errors = sandwich_errors(blocks, selection.theta, curves, how.loss, weights)
            count = 0 if curves is None else int(curves.max()) + 1
            return replace(selection, theta_error=errors, curves=count)
        if not k or how.recorded is None or k * n > MOST:
            return selection
        blocks = how.rows(self.only(selection.chosen))
        errors, worth = _errors_along(blocks, selection.theta, how.curves, how.recorded)
        return replace(selection, theta_error=errors, worth=worth)


def _errors_along(
    blocks: Blocks, theta: Array, curves: IntArray | None, recorded: IntArray
) -> tuple[Array, float]:
    """Return standard errors that take correlated residuals along recordings into account, (k,),
    and the number of independent samples to which the samples are equivalent.
    """
    P, y = map(np.concatenate, zip(*blocks(), strict=True))
    labels = np.zeros(len(y), dtype=np.int64) if curves is None else curves
    order = np.lexsort((recorded, labels))
    lengths = [length for length in np.bincount(labels).tolist() if length]
    residual = (y - P @ theta)[order]
    if not np.array_equal(order, np.arange(len(order))):
        P = P[order]
    return correlated_errors(P, residual, lengths)


def reweighted(
    weighings: Sequence[Weighing],
    select: Callable[[Sequence[Array | None]], Sequence[Selection]],
    only: Sequence[Callable[[IntArray], Blocks]],
) -> tuple[Choice, ...]:
    """Return a weighted selection for each output. For a robust loss, the terms are selected three
    times: with the starting weights, with the weights of Huber's loss, and with the weights of the
    chosen loss. Huber's loss comes first because it has a single minimum.

    Before each of the last two selections, the weights are computed for the terms of the previous
    selection: a least-squares fit and the computation of weights from its residuals alternate, at
    most ten times.

    - `select`: function that selects terms for all outputs. Its argument holds, for each output,
      the divisor of each row.
    - `only`: for each output, a function that returns the data of the given candidate terms.
    """
    weights = [weighing.start for weighing in weighings]
    selections = select([weighing.by(w) for weighing, w in zip(weighings, weights, strict=True)])
    robust = weighings[0].loss != "squares" and all(
        len(selection.chosen) for selection in selections
    )
    for loss in ("huber", weighings[0].loss) if robust else ():
        settled = [
            weighing.settled(loss, rows_of(selection.chosen), before)
            for weighing, rows_of, selection, before in zip(
                weighings, only, selections, weights, strict=True
            )
        ]
        weights, scales, sigmas = map(list, zip(*settled, strict=True))
        selections = [
            replace(selection, scale=s) for selection, s in zip(select(sigmas), scales, strict=True)
        ]
    return tuple(map(Choice, selections, weighings, only, weights))


def scale_of(residual: Array, y: Array) -> float:
    """Return the scale of the residuals r, `1.4826 median |r|`. If this is below the rounding error
    of `y`, return the rounding error.
    """
    exact = EXACT * root_mean_square(y)
    return max(MAD * float(np.median(np.abs(residual))), exact) or 1.0


def loss_weights(loss: str, residual: Array) -> Array:
    """Return the robust weights, shape (n,), for residuals in units of their scale."""
    return LOSSES[loss].weight(np.abs(residual) / LOSSES[loss].tuning)


def gross_outlier(P: Array, y: Array) -> tuple[Array, int | None]:
    """Return the externally studentised residuals of a least-squares fit of the columns `P`, (n,
    k), and the index of the sample with the largest one if it is a gross outlier (otherwise None).

    A robust fit passes close to an outlier with a large leverage h, for example at the end of a
    short segment. To detect such an outlier, each sample is compared with a fit to all other
    samples. Its residual in units of the standard deviation is `t_i = r_i / (s_i sqrt(1 - h_i))`
    with `s_i^2 = (r'r - r_i^2/(1 - h_i))/(n - k - 1)` (Cook and Weisberg 1982, eq 2.1.15). The
    outlier must get practically no weight, because Huber's small weight is enough to bend the fit
    again.

    The residuals are zero if too few degrees of freedom remain to detect an outlier.
    """
    # columns may be equal, so that directions with a singular value near zero are dropped
    Q, values, _ = np.linalg.svd(P / (np.linalg.norm(P, axis=0) + (P == 0).all(axis=0)), False)
    Q = Q[:, values > DEPENDENT * values[0]]
    n, k = Q.shape
    if n - k - 1 < FREEDOM:
        return np.zeros(n), None
    r, left = y - Q @ (Q.T @ y), np.maximum(1 - np.sum(Q**2, axis=1), EXACT)
    others = np.maximum((r @ r - r**2 / left) / (n - k - 1), EXACT * (r @ r) / n)
    deleted = r / np.sqrt(others * left) if r.any() else r
    worst = int(np.argmax(np.abs(deleted)))
    return deleted, worst if abs(deleted[worst]) > GROSS else None


def numbered_curves(labels: IntArray | None, terms: int) -> IntArray | None:
    """Return the number of each sample's curve, (n,), counted from 0 without gaps. `labels` holds
    numbers that may have gaps. Return None if the errors of curves cannot be estimated, because
    there are fewer than `FEW` curves, or no more curves than terms.
    """
    if labels is None:
        return None
    present = np.bincount(labels) > 0
    return np.cumsum(present)[labels] - 1 if present.sum() >= max(FEW, terms + 1) else None


def sandwich_errors(
    blocks: Blocks, theta: Array, curves: IntArray | None, loss: str, weights: Array | None
) -> Array:
    """Return standard errors of `theta`, shape (k,), for residuals that are correlated within a
    curve or weighted by a robust loss.

    With `psi_i = w_i r_i` and the mean m of its derivative with respect to r_i (1 for squares),
    they are the sandwich `(P'P)^-1 (sum_c s_c s_c') (P'P)^-1 / m^2` of the sums `s_c = sum_{i in c}
    psi_i p_i`, times `G/(G-1) (n-1)/(n-k)` with G curves (Cameron and Miller 2015, eq 11). Without
    curves they are `sum psi^2 / (n-k) / m^2 (P'P)^-1` (Huber 1981, eq 7.6.2).

    - `blocks`: the k chosen columns and the target, in units of the uncertainty.
    - `curves`: the curve of each row, from 0, (n,); None if residuals are independent.
    - `weights`: weights of the `loss`, (n,); None for squares.
    """
    count, k, n, square = 1 if curves is None else int(curves.max()) + 1, len(theta), 0, 0.0
    sums, factor = np.zeros((k, count)), np.empty((0, k))
    for P, y in blocks():
        rows = slice(n, n := n + len(y))
        psi = (y - P @ theta) * (1.0 if weights is None else weights[rows])
        square += float(psi @ psi)
        factor = np.linalg.qr(np.vstack([factor, P]))[1]
        if curves is not None:
            sums += [np.bincount(curves[rows], column * psi, count) for column in P.T]
    if n <= k:
        return np.full(k, np.nan)
    inverse = np.linalg.inv(factor)
    if curves is None:
        spread, share = inverse, square / (n - k)
    else:
        spread, share = inverse @ (inverse.T @ sums), count / (count - 1) * (n - 1) / (n - k)
    slope = 1.0 if weights is None else float(np.mean(LOSSES[loss].slope(weights)))
    return np.asarray(np.sqrt(share) * np.linalg.norm(spread, axis=1) / slope)
