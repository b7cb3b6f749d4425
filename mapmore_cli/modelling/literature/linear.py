"""Linear least squares by singular values: minimum norm, rank, condition, standard errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array

RANK_TOLERANCE = 1e-13
"""Singular values below this fraction of the largest are rounding (exactly dependent columns leave about 1e-16)."""

BLOCK = 8192
"""Rows at a time in `least_sse`, which then stay in the processor's cache."""


@dataclass(frozen=True)
class LinearFit:
    """The minimum-norm solution `beta` of `min |Phi beta - y|` with unit columns.

    Attributes
    ----------
    beta
        `(m,)`, in the units of the given columns.
    basis
        `(n, rank)` orthonormal basis of the columns' space.
    residual
        `(n,)`, `Phi beta - y`, taken as the part of -y outside of the basis.
    rank, condition
        Of the columns scaled to unit length; the condition is that of the space which is left when the rank is deficient.
    """

    beta: Array
    basis: Array
    residual: Array
    rank: int
    condition: float

    @property
    def sse(self) -> float:
        """Residual sum of squares."""
        return float(self.residual @ self.residual)


def solve(phi: Array, y: Array) -> LinearFit:
    """Least squares with regressors `phi`, `(n, m)`, and target `y`, `(n,)`.

    Columns are scaled to unit length first, so that neither the solution nor the rank depends on units.
    """
    if phi.shape[1] == 0:
        return LinearFit(np.empty(0), phi, -y, 0, 1.0)
    lengths = _lengths(phi)
    u, s, vt = np.linalg.svd(phi / lengths, full_matrices=False)
    rank, condition = _rank(s)
    basis = u[:, :rank]
    components = basis.T @ y
    residual = basis @ components - y
    residual -= basis @ (basis.T @ residual)  # once more: keeps the digits of small residuals
    beta = vt[:rank].T @ (components / s[:rank]) / lengths
    return LinearFit(beta, basis, residual, rank, condition)


def least_sse(phi: Array, y: Array) -> float:
    """`min |Phi beta - y|^2` alone, many times faster than `solve`: with `[Phi y] = Q R`, only R is left to solve (m + 1 rows)."""
    columns = np.column_stack([phi, y])
    blocks = [np.linalg.qr(columns[start : start + BLOCK], mode="r") for start in range(0, len(y), BLOCK)]
    triangle = np.asarray(np.linalg.qr(np.vstack(blocks), mode="r"))
    return solve(triangle[:, :-1], triangle[:, -1]).sse


def numerical_rank(phi: Array) -> int:
    """Rank of regressors `(n, m)` with unit columns."""
    return _rank(np.asarray(np.linalg.svd(phi / _lengths(phi), compute_uv=False)))[0]


def standard_errors(jacobian: Array, sse: float) -> tuple[Array, int, float]:
    """Standard errors `(p,)`, rank and condition from a Jacobian `(n, p)` at the solution.

    `cov = sse/(n - p) (J'J)^-1`; NaN where the rank is deficient or no degree of freedom is left.
    """
    n, p = jacobian.shape
    lengths = _lengths(jacobian)
    _, s, vt = np.linalg.svd(jacobian / lengths, full_matrices=False)
    rank, condition = _rank(s)
    if rank < p or n == p:
        return np.full(p, np.nan), rank, condition
    spread = np.linalg.norm(vt.T / s, axis=1)
    return np.sqrt(sse / (n - p)) * spread / lengths, rank, condition


def _lengths(columns: Array) -> Array:
    largest = np.abs(columns).max(axis=0)
    largest[largest == 0.0] = 1.0
    lengths = largest * np.linalg.norm(columns / largest, axis=0)  # squares of tiny or huge columns would leave the range
    lengths[lengths == 0.0] = 1.0
    return np.asarray(lengths)


def _rank(s: Array) -> tuple[int, float]:
    rank = int(np.count_nonzero(s > RANK_TOLERANCE * s[:1]))
    return rank, float(s[0] / s[rank - 1]) if rank else 1.0
