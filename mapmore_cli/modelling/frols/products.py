"""Sums of products over all rows, the one thing that a tall dictionary is read for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.modelling.frols.blocks import Blocks, power_of_two, safe_scale, scaled


@dataclass(frozen=True)
class Gram:
    """Products of the columns of `Z = [P y]`, each column divided by its scale.

    Attributes
    ----------
    matrix
        `Z'Z`, (M+1, M+1), with a diagonal between 1/4 and 1 (or 0).
    scale
        Powers of two by which the columns of `Z` were divided, (M+1,).
    samples
        Number of rows, n.
    """

    matrix: Array
    scale: Array
    samples: int


def gram(blocks: Blocks) -> Gram:
    """`Z'Z` in one pass over the blocks; in three where squares overflow or vanish: the values are then scaled instead of the sums.

    Raises
    ------
    DataError
        Where a value is not finite, with its column and row.
    ValueError
        Where there is no row, or no column.
    """
    matrix, samples = _sum_of_products(blocks)
    scale = safe_scale(np.diag(matrix), blocks)
    if (scale != 1.0).any():
        matrix, samples = _sum_of_products(scaled(blocks, scale))
    lengths = power_of_two(np.sqrt(np.diag(matrix)))
    return Gram(matrix / lengths / lengths[:, None], scale * lengths, samples)


def _sum_of_products(blocks: Blocks) -> tuple[Array, int]:
    total, samples = np.zeros((1, 1)), 0
    for P, y in blocks():
        M = P.shape[1]
        if not samples:
            total = np.zeros((M + 1, M + 1))
        with np.errstate(over="ignore", invalid="ignore"):  # `safe_scale` looks for the cause
            total[:M, :M] += P.T @ P  # NumPy sees the transpose and calls syrk, for either memory order, without a copy
            total[M, :M] += P.T @ y
            total[M, M] += y @ y
        samples += len(y)
    if samples == 0 or len(total) == 1:
        raise ValueError("P must be (n, M) and y (n,), neither empty; there is no row or no column")
    total[:-1, -1] = total[-1, :-1]
    return total, samples


def residual_products(blocks: Blocks, chosen: IntArray, theta: Array) -> tuple[Array, float]:
    """`P'r` (M,) and `r'r` of the residual `r = y - P_chosen theta`, in one pass over the blocks."""
    products, square = np.zeros(1), 0.0
    for P, y in blocks():
        residual = y - P[:, chosen] @ theta
        products = products + P.T @ residual
        square += float(residual @ residual)
    return products, square
