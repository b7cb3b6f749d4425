"""Linear least squares by singular values: minimum norm, rank, condition, standard errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array

RANK_TOLERANCE = 1e-13
"""Singular values below this fraction of the largest are rounding (exactly dependent columns leave
about 1e-16).
"""


@dataclass(frozen=True)
class LinearFit:
    """The minimum-norm solutions of `min |Phi beta - y|` with unit columns; of one problem, or of s
    of them with a first axis more.

    - `beta`: `(m,)`, in the units of the given columns.
    - `basis`: `(n, m)` orthonormal basis of the columns' space, zero beyond the rank.
    - `residual`: `(n,)`, `Phi beta - y`, taken as the part of -y outside of the basis; infinite
      where Phi or y is.
    """

    beta: Array
    basis: Array
    residual: Array

    @property
    def sse(self) -> float:
        """Residual sum of squares."""
        return float(self.residual @ self.residual)


def solve(phi: Array, y: Array) -> LinearFit:
    """Least squares with regressors `phi`, `(n, m)`, and target `y`, `(n,)`.

    Columns are scaled to unit length first, so that neither the solution nor the rank depends on
    units.
    """
    found = solve_each(phi[None], y[None])
    return LinearFit(found.beta[0], found.basis[0], found.residual[0])


def solve_each(phi: Array, y: Array) -> LinearFit:
    """`solve` with several regressors at once, `(s, n, m)`, and a target for each, `(s, n)`."""
    sound = np.asarray(np.isfinite(phi).all(axis=(1, 2)) & np.isfinite(y).all(axis=1))
    phi, y = np.where(sound[:, None, None], phi, 0.0), np.where(sound[:, None], y, 0.0)
    lengths = _lengths(phi)
    u, s, vt = np.linalg.svd(phi / lengths[:, None], full_matrices=False)
    above = s > RANK_TOLERANCE * s[:, :1]
    basis = u * above[:, None]
    turned = basis.transpose(0, 2, 1)
    components = turned @ y[:, :, None]
    residual = basis @ components - y[:, :, None]
    residual -= basis @ (turned @ residual)  # once more: keeps the digits of small residuals
    weights = np.divide(components[:, :, 0], s, out=np.zeros_like(s), where=above)
    beta = (vt.transpose(0, 2, 1) @ weights[:, :, None])[:, :, 0] / lengths
    return LinearFit(beta, basis, np.where(sound[:, None], residual[:, :, 0], np.inf))


def least_sse(phi: Array, y: Array) -> Array:
    """`min |Phi beta - y|^2` alone of several problems, `(s,)`: with `[Phi y] = Q R`, only R is
    left to solve (m + 1 rows).
    """
    columns = np.concatenate([phi, y[:, :, None]], axis=2)
    sound = np.asarray(np.isfinite(columns).all(axis=(1, 2)))
    triangles = np.asarray(np.linalg.qr(np.where(sound[:, None, None], columns, 0.0), mode="r"))
    residual = solve_each(triangles[:, :, :-1], triangles[:, :, -1]).residual
    return np.where(sound, np.einsum("sn,sn->s", residual, residual), np.inf)


def standard_errors(jacobian: Array, sse: float) -> tuple[Array, int, float]:
    """Return standard errors `(p,)`, rank and condition from a Jacobian `(n, p)` at the solution.

    `cov = sse/(n - p) (J'J)^-1`; NaN where the rank is deficient or no degree of freedom is left.
    The condition is that of the space which is left when the rank is deficient.
    """
    n, p = jacobian.shape
    lengths = _lengths(jacobian)
    _, s, vt = np.linalg.svd(jacobian / lengths, full_matrices=False)
    rank = int(np.count_nonzero(s > RANK_TOLERANCE * s[:1]))
    condition = float(s[0] / s[rank - 1]) if rank else 1.0
    if rank < p or n == p:
        return np.full(p, np.nan), rank, condition
    spread = np.linalg.norm(vt.T / s, axis=1)
    return np.sqrt(sse / (n - p)) * spread / lengths, rank, condition


def _lengths(columns: Array) -> Array:
    """Lengths of columns, `(n, m)`, or of several sets of them, `(s, n, m)`; one for a column of
    zeros.
    """
    largest = np.abs(columns).max(axis=-2, keepdims=True)
    largest[largest == 0.0] = 1.0
    lengths = largest * np.linalg.norm(
        columns / largest, axis=-2, keepdims=True
    )  # squares of tiny or huge columns would leave the range
    lengths[lengths == 0.0] = 1.0
    return np.asarray(lengths[..., 0, :])
