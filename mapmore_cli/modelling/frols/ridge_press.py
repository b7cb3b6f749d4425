"""Leave-one-out error of regularised models of every size."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.modelling.frols.blocks import Blocks
from mapmore_cli.modelling.frols.press import FULL_LEVERAGE
from mapmore_cli.modelling.frols.ridge import Regularised


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
