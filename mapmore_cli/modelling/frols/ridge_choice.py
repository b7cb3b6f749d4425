"""How strong a ridge, by blocks of samples left out; and the leave-one-out error of regularised models of every size."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.modelling.frols.blocks import Blocks
from mapmore_cli.modelling.frols.criteria import FULL_LEVERAGE
from mapmore_cli.modelling.frols.moments import Moments
from mapmore_cli.modelling.frols.ridge import Regularised, prune, select

RIDGES = (1e-5, 1e-4, 5e-4, 2e-3, 1e-2, 5e-2)
"""Candidates, as fractions of a standardised candidate's own variance."""


def choose_ridge(total: Moments, blocks: Sequence[Moments], forward: int, max_terms: int) -> float:
    """The ridge whose models predict left-out blocks of samples best, the weaker of equals.

    For each ridge and each block a model of `max_terms` terms is selected (forward, then pruned) on the other blocks. Everything comes from
    sums of products, so the rows are not read again.
    """
    errors = [sum(_left_out_error(total.without(block), block, ridge, forward, max_terms) for block in blocks) for ridge in RIDGES]
    return RIDGES[int(np.argmin(errors))]


def _left_out_error(training: Moments, held: Moments, ridge: float, forward: int, max_terms: int) -> float:
    data = Regularised(training.covariance, training.samples, ridge)
    chosen = select(data, forward).chosen
    if not len(chosen):
        return float(held.products[-1, -1])
    kept = prune(data, chosen)[:max_terms][-1]
    combination = np.zeros(len(held.sums))  # residual = combination'z - constant
    combination[kept] = -data.coefficients(kept)
    combination[-1] = 1.0
    constant = float(combination @ training.mean)
    return float(combination @ held.products @ combination - 2 * constant * (combination @ held.sums) + held.samples * constant**2)


def ridge_press(blocks: Blocks, data: Regularised, subsets: Sequence[IntArray]) -> Array:
    """`PRESS = sum_i (r_i / (1 - h_i))^2` of each subset, (m,), in one pass over standardised blocks; infinite where a leverage is one.

    The leverage is `h_i = 1/n + z_i' G^-1 z_i / n`: of the mean, and of the terms. A ridge makes it exact but for the change of means and
    standard deviations by one sample.
    """
    factors = [cho_factor(data.gram[np.ix_(kept, kept)]) for kept in subsets]
    thetas = [data.coefficients(kept) for kept in subsets]
    total = np.zeros(len(subsets))
    for P, y in blocks():
        for place, (kept, factor, theta) in enumerate(zip(subsets, factors, thetas, strict=True)):
            Z = P[:, kept]
            left = 1 - (1 + np.einsum("ij,ji->i", Z, cho_solve(factor, Z.T))) / data.samples
            total[place] += np.square((y - Z @ theta) / np.where(left > FULL_LEVERAGE, left, np.nan)).sum()
    return np.where(np.isnan(total), np.inf, total)
