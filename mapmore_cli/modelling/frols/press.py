"""Leave-one-out error of every number of terms: the one thing that needs a second pass over the rows."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.modelling.frols.blocks import Blocks

FULL_LEVERAGE = 1e-8
"""A sample with `1 - h` below this alone decides a coefficient; its error when left out is unknown."""


def press(blocks: Blocks, chosen: IntArray, factor: Array, projections: Array) -> Array:
    """`PRESS_k = sum_i (r_ik / (1 - h_ik))^2` after 1, 2, ... terms (Allen 1974), (k,); infinite where a sample has leverage one.

    The rows of the orthonormal basis are those of `U = P_chosen R^-1`; its first k columns give the leverages `h_ik = sum_j U_ij^2` and the
    residuals `r_ik = y_i - sum_j U_ij c_j`.

    Parameters
    ----------
    chosen
        Indices of the chosen candidates in the order of selection, (k,).
    factor
        Upper triangular R of the chosen candidates, (k, k).
    projections
        `c = U'y`, (k,).
    """
    total = np.zeros(len(chosen))
    for P, y in blocks():
        U = solve_triangular(factor, P[:, chosen].T, trans="T").T
        residual = y[:, None] - np.cumsum(U * projections, axis=1)
        left = 1 - np.cumsum(U**2, axis=1)
        total += np.square(residual / np.where(left > FULL_LEVERAGE, left, np.nan)).sum(axis=0)
    return np.where(np.isnan(total), np.inf, total)
