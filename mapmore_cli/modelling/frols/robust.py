"""Robust fits by reweighting, and standard errors that do not take residuals to be independent.

P. J. Huber, *Robust Statistics*, Wiley 1981, chapter 7; A. E. Beaton and J. W. Tukey,
Technometrics 16 (1974). The engine chooses the terms; only the uncertainty of its samples changes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.modelling.frols.moments import Blocks
from mapmore_cli.modelling.selection import Fit

Choice = TypeVar("Choice")

TUNING = {"huber": 1.345, "bisquare": 4.685}
"""Residuals in scales beyond which a sample counts less, or not at all: 95 % efficient with normal
noise.
"""

ROUNDS = 10  # of reweighting at most, with the same terms
SETTLED = 1e-8  # change of every weight below which another round changes nothing
LEAST_WEIGHT = 1e-12  # of a sample that does not count: its row is then below rounding error
MAD = 1.4826  # standard deviation of normal noise over its median absolute deviation
EXACT = 1e-12  # of the target: residuals that small are rounding error, and no scale


@dataclass(frozen=True)
class Robust:
    """A loss that large residuals enter less than squared: `huber` or `bisquare`.

    `scale` is that of the residuals; None stands for 1.4826 times their median absolute value.
    """

    loss: str
    scale: float | None = None

    @classmethod
    def of(cls, fit: Fit) -> Robust | None:
        """Return the loss of a section; None for squares."""
        scale = None if isinstance(fit.scale, str) else fit.scale
        return None if fit.loss == "squares" else cls(fit.loss, scale)

    def scale_of(self, residual: Array, y: Array) -> float:
        """Return the scale; where most residuals are rounding error of `y`, that."""
        exact = EXACT * float(np.sqrt(np.mean(y**2)))
        return self.scale or max(MAD * float(np.median(np.abs(residual))), exact) or 1.0

    def weights(self, residual: Array) -> Array:
        """Return the weights of residuals in scales, (n,).

        `huber`: `min(1, 1.345/|r|)`. `bisquare`: `(1 - (r/4.685)^2)^2`, nothing beyond 4.685.
        """
        size = np.abs(residual) / TUNING[self.loss]
        if self.loss == "huber":
            return np.asarray(1 / np.maximum(size, 1.0))
        return np.maximum(np.maximum(1 - size**2, 0.0) ** 2, LEAST_WEIGHT)

    def slope(self, weights: Array) -> float:
        """Return the mean derivative of `w(r) r`, which the weights alone tell."""
        root = np.sqrt(weights)
        slopes = weights == 1.0 if self.loss == "huber" else root * (5 * root - 4)
        return float(np.mean(slopes))

    def settled(self, P: Array, y: Array, weights: Array) -> Array:
        """Return the weights that follow from the least squares that they make, (n,), in at most
        ten rounds from given ones; columns `P`, (n, k), stay.
        """
        for _ in range(ROUNDS):
            root = np.sqrt(weights)
            theta = np.linalg.lstsq(P * root[:, None], y * root, rcond=None)[0]
            residual = y - P @ theta
            before, weights = weights, self.weights(residual / self.scale_of(residual, y))
            if np.abs(weights - before).max() < SETTLED:
                break
        return weights


def reweighted(
    robust: Robust,
    choose: Callable[[Array | None], Choice],
    regressors: Callable[[Choice], tuple[Array, Array, BoolArray]],
) -> tuple[Choice, Array]:
    """Choose terms with the weights of a robust start, then with the final ones; return the choice
    and its weights, (n,).

    - `choose`: the choice with given weights, (n,); None for equal ones.
    - `regressors`: the chosen columns and the target of the samples that the choice has a value at,
      in units of the uncertainty; and which of all samples these are, (n,).

    Both begin with Huber's loss, which has a single minimum.
    """
    choice, weights = choose(None), None
    for one in (Robust("huber", robust.scale), robust):
        P, y, known = regressors(choice)
        weights = np.ones(len(known)) if weights is None else weights
        weights[known] = one.settled(P, y, weights[known])
        choice = choose(weights)
    assert weights is not None
    return choice, weights


FAR = TUNING["bisquare"]
"""Residuals in scales from which on a sample is listed: those that the bisquare leaves out."""


def outlying(robust: Robust, residual: Array, y: Array) -> tuple[BoolArray, float]:
    """Return which residuals, (n,), are listed as those of outliers, and the scale."""
    scale = robust.scale_of(residual, y)
    return np.abs(residual) > FAR * scale, scale


FEW = 5
"""Below so many curves sums over them say little, and standard errors are a guess."""


def curves_told_apart(labels: IntArray, terms: int) -> tuple[int, IntArray | None]:
    """Return how many curves samples are of, (n,) `labels`, and the curve of each from 0, (n,);
    nothing where they are too few for sums over them: below `FEW`, or no more than the terms.
    """
    present = np.bincount(labels) > 0
    count = int(present.sum())
    enough = count >= FEW and count > terms
    return (count, np.cumsum(present)[labels] - 1) if enough else (0, None)


def standard_errors(
    blocks: Blocks,
    theta: Array,
    groups: IntArray | None,
    robust: Robust | None = None,
    weights: Array | None = None,
) -> Array:
    """Return standard errors of `theta`, (k,), where residuals of a group go together, or a robust
    loss weighs them.

    With `psi_i = w_i r_i` and its mean slope m (1 without a loss) they are the sandwich
    `(P'P)^-1 (sum_g s_g s_g') (P'P)^-1 / m^2` of the sums `s_g = sum_{i in g} psi_i p_i`, times
    `G/(G-1) (n-1)/(n-k)` with G groups (Cameron and Miller 2015, eq 11). Without groups they are
    `sum psi^2 / (n-k) / m^2 (P'P)^-1` (Huber 1981, eq 7.6.2).

    - `blocks`: the k chosen columns and the target, in units of the uncertainty.
    - `groups`: the group of each row, from 0, (n,); None where residuals are independent.
    - `weights`: those of the `robust` loss, (n,).
    """
    count, k, n, square = 1 if groups is None else int(groups.max()) + 1, len(theta), 0, 0.0
    sums, factor = np.zeros((k, count)), np.empty((0, k))
    for P, y in blocks():
        rows = slice(n, n := n + len(y))
        psi = (y - P @ theta) * (1.0 if weights is None else weights[rows])
        square += float(psi @ psi)
        factor = np.linalg.qr(np.vstack([factor, P]), mode="r")
        for place, column in enumerate(P.T if groups is not None else ()):
            sums[place] += np.bincount(groups[rows], column * psi, count)
    if n <= k:
        return np.full(k, np.nan)
    inverse = np.linalg.inv(factor)
    if groups is None:
        spread = np.sqrt(square / (n - k)) * np.linalg.norm(inverse, axis=1)
    else:
        few = count / (count - 1) * (n - 1) / (n - k)
        spread = np.sqrt(few) * np.linalg.norm(inverse @ (inverse.T @ sums), axis=1)
    slope = 1.0 if robust is None or weights is None else robust.slope(weights)
    return np.asarray(spread / slope)
