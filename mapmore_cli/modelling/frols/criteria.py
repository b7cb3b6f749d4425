"""How many terms: criteria that need no tolerance (BIC, AICc), and the leave-one-out error of every number of terms."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.modelling.frols.blocks import Blocks

ROUNDING = 1e-30
"""Floor of the unexplained fraction: below it the residual is rounding error, and more terms explain nothing."""


def information_criterion(name: str, unexplained: Array, n: int) -> Array:
    """Value of a criterion after 1, 2, ... terms, (k,); the least is the best. Infinite where the samples are too few to say.

    With SSE the residual sum of squares after k terms of n samples:

    - `bic`: `n ln(SSE/n) + k ln n` (Schwarz 1978);
    - `aicc`: `n ln(SSE/n) + 2k + 2k(k+1)/(n-k-1)` (Hurvich and Tsai 1989).

    The third criterion, the leave-one-out error, needs the samples: see `frols.press`.

    Parameters
    ----------
    name
        `bic` or `aicc`.
    unexplained
        `SSE / y'y` after 1, 2, ... terms, (k,).
    n
        Number of samples.
    """
    k = np.arange(1, len(unexplained) + 1)
    likelihood: Array = n * np.log(np.maximum(unexplained, ROUNDING))
    if name == "bic":
        bic: Array = likelihood + k * np.log(n)
        return bic
    freedom = n - k - 1
    aicc: Array = np.where(freedom > 0, likelihood + 2 * k + 2 * k * (k + 1) / np.maximum(freedom, 1), np.inf)
    return aicc


def fewest(values: Array) -> int:
    """Number of terms at which a criterion is least; the smaller number wins a tie."""
    return int(np.argmin(values)) + 1


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
        U = np.linalg.solve(factor.T, P[:, chosen].T).T
        residual = y[:, None] - np.cumsum(U * projections, axis=1)
        left = 1 - np.cumsum(U**2, axis=1)
        total += np.square(residual / np.where(left > FULL_LEVERAGE, left, np.nan)).sum(axis=0)
    return np.where(np.isnan(total), np.inf, total)
