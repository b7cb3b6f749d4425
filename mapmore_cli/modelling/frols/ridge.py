"""Implement regularised FROLS: orthogonal selection on the covariance matrix plus a ridge, backward
pruning, and the choice of the ridge.

Let Z be the matrix of the candidates, which are centred and divided by their standard deviations.
Let `G = Z'Z/n + ridge I` and `h = Z'y/n`. The selection greedily minimises `theta' G theta - 2 h'
theta` (regularised orthogonal least squares, with one ridge for all terms). A square root `Q` of G,
with `Q'Q = G`, is passed to the usual engine in place of the data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.fits import Selection
from mapmore_cli.modelling.frols.engine import frols
from mapmore_cli.modelling.frols.moments import Blocks, Moments
from mapmore_cli.modelling.frols.select import FULL_LEVERAGE, widened


@dataclass(frozen=True)
class Regularised:
    """Data of a regularised regression: the covariance matrix of the standardised columns `[P y]`,
    shape (M+1, M+1), the number n of `samples`, and the ridge.
    """

    covariance: Array
    samples: int
    ridge: float

    @cached_property
    def gram(self) -> Array:
        """Regularised Gram matrix `G = Z'Z/n + ridge I`, (M, M)."""
        return self.covariance[:-1, :-1] + self.ridge * np.eye(len(self.covariance) - 1)

    @property
    def products(self) -> Array:
        """Vector `h = Z'y/n` of the inner products of candidates and output, (M,)."""
        return self.covariance[-1, :-1]

    def coefficients(self, chosen: IntArray) -> Array:
        """Return the coefficients `theta = G^-1 h` of some candidates, shape (k,)."""
        return cho_solve(cho_factor(self.gram[np.ix_(chosen, chosen)]), self.products[chosen])

    def unexplained(self, chosen: IntArray, theta: Array) -> float:
        """Return the unexplained fraction `SSE / y'y` of the chosen terms, without the penalty of
        the ridge.
        """
        explained = theta @ (
            2 * self.products[chosen] - self.covariance[np.ix_(chosen, chosen)] @ theta
        )
        total = float(self.covariance[-1, -1])
        return max(0.0, 1 - float(explained) / total) if total > 0 else 0.0


def select(data: Regularised, max_terms: int, among: IntArray | None = None) -> Selection:
    """Choose up to `max_terms` candidates by forward selection, from all candidates or from those
    in `among`, shape (m,). Coefficients and errors of the result are in units of the standardised
    columns.

    The ERR is that of the regularised problem, in which `1 - sum ERR` equals `(SSE/n + ridge
    theta'theta) / (y'y/n)`. In the tables of the result, the values of candidates that are not in
    `among` are NaN.
    """
    M = len(data.covariance) - 1
    columns = np.arange(M) if among is None else among
    P = np.vstack([cholesky(data.gram[np.ix_(columns, columns)]), np.zeros((1, len(columns)))])
    y = np.append(solve_triangular(P[:-1], data.products[columns], trans="T"), 0.0)
    y[-1] = np.sqrt(max(0.0, float(data.covariance[-1, -1] - y @ y)))
    selection = frols(P, y, max_terms)
    k = len(selection.chosen)
    if not k:
        return selection
    freedom, total = data.samples - k, data.samples * float(data.covariance[-1, -1])
    return replace(
        widened(selection, columns, M),
        theta_error=selection.theta_error
        * np.sqrt((len(y) - k) / freedom if freedom > 0 else np.nan),
        sse=total * data.unexplained(columns[selection.chosen], selection.theta),
        yy=total,
        samples=data.samples,
    )


def prune(data: Regularised, chosen: IntArray) -> list[IntArray]:
    """Return subsets of `chosen` with 1, 2, ... terms. They result from removing terms one by one.

    Each step removes the term i with the smallest `theta_i^2 / (G^-1)_ii`. This is the increase of
    the regularised error if term i is left out and the remaining terms are fitted again.
    """
    subsets = [np.asarray(chosen)]
    while len(subsets[0]) > 1:
        kept = subsets[0]
        inverse = np.linalg.inv(data.gram[np.ix_(kept, kept)])
        cost = (inverse @ data.products[kept]) ** 2 / np.diag(inverse)
        subsets.insert(0, np.delete(kept, int(np.argmin(cost))))
    return subsets


# values of the ridge that are tried; a standardised candidate has the variance one
RIDGES = (1e-5, 1e-4, 5e-4, 2e-3, 1e-2, 5e-2)


def choose_ridge(total: Moments, blocks: Sequence[Moments], forward: int, max_terms: int) -> float:
    """Return the ridge with the smallest cross-validation error over blocks of samples. If several
    ridges have the same error, return the smallest ridge.

    For each ridge and each block, a model is selected on the other blocks: `forward` terms are
    selected forwards, and then pruned to `max_terms` terms. Everything is computed from sums of
    products, so the rows are not read again.
    """
    errors = [
        sum(
            _left_out_error(total.without(block), block, ridge, forward, max_terms)
            for block in blocks
        )
        for ridge in RIDGES
    ]
    return RIDGES[int(np.argmin(errors))]


def _left_out_error(
    training: Moments, held: Moments, ridge: float, forward: int, max_terms: int
) -> float:
    data = Regularised(training.covariance, training.samples, ridge)
    chosen = select(data, forward).chosen
    if not len(chosen):
        return float(held.products[-1, -1])
    kept = prune(data, chosen)[:max_terms][-1]
    combination = np.zeros(len(held.sums))  # the residual of a row z is combination'z - constant
    combination[[*kept, -1]] = [*-data.coefficients(kept), 1.0]
    constant = float(combination @ training.mean)
    return float(
        combination @ held.products @ combination
        - 2 * constant * (combination @ held.sums)
        + held.samples * constant**2
    )


def ridge_press(blocks: Blocks, data: Regularised, subsets: Sequence[IntArray]) -> Array:
    """Return `PRESS = sum_i (r_i / (1 - h_i))^2` of each subset, shape (m,), in one pass over
    standardised blocks. PRESS is infinite if a leverage is one.

    The leverage `h_i = 1/n + z_i' G^-1 z_i / n` is the sum of the leverages of the mean and of the
    terms. For a fixed ridge, the formula has one approximation: it keeps the means and standard
    deviations, although they would change slightly without sample i.
    """
    total = np.zeros(len(subsets))
    for P, y in blocks():
        for place, kept in enumerate(subsets):
            Z, gram = P[:, kept], data.gram[np.ix_(kept, kept)]
            left = 1 - (1 + np.einsum("ij,ji->i", Z, np.linalg.solve(gram, Z.T))) / data.samples
            residual = y - Z @ data.coefficients(kept)
            total[place] += np.square(residual / np.where(left > FULL_LEVERAGE, left, np.nan)).sum()
    return np.where(np.isnan(total), np.inf, total)
