"""Linear least squares by singular values: minimum norm, rank, condition, standard errors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array

RANK_TOLERANCE = 1e-13
"""Singular values below this fraction of the largest are rounding (exactly dependent columns leave
about 1e-16).
"""

SHARE = 0.1
"""Part of a parameter in a direction that changes nothing, from which on it is undetermined."""


class LinearFit(NamedTuple):
    """The minimum-norm solution of `min |Phi beta - y|` with unit columns.

    - `beta`: `(m,)`, in the units of the given columns.
    - `basis`: `(n, m)` orthonormal basis of the columns' space, zero beyond the rank.
    - `residual`: `(n,)`, `Phi beta - y`, taken as the part of -y outside the basis.
    """

    beta: Array
    basis: Array
    residual: Array


def solve_linear(phi: Array, y: Array) -> LinearFit:
    """Least squares with finite regressors `phi`, `(n, m)`, and target `y`, `(n,)`.

    Columns are scaled to unit length first, so that neither the solution nor the rank depends on
    units.
    """
    lengths = _lengths(phi)
    u, s, vt = np.linalg.svd(phi / lengths, full_matrices=False)
    above = s > RANK_TOLERANCE * s[:1]
    basis = u * above
    components = basis.T @ y
    residual = basis @ components - y
    residual -= basis @ (basis.T @ residual)  # once more: keeps the digits of small residuals
    weights = np.divide(components, s, out=np.zeros_like(s), where=above)
    return LinearFit(vt.T @ weights / lengths, basis, residual)


def parameter_errors(jacobian: Array, variance: float) -> tuple[Array, int, float]:
    """Return standard errors `(p,)`, rank and condition from a Jacobian `(n, p)` at the solution.

    `cov = variance (J'J)^-1`. Where the rank is deficient, the errors of parameters that the data
    do not tell apart are NaN, and the condition is that of the space which is left.
    """
    lengths = _lengths(jacobian)
    _, s, vt = np.linalg.svd(jacobian / lengths, full_matrices=False)
    rank = int(np.count_nonzero(s > RANK_TOLERANCE * s[:1]))
    condition = float(s[0] / s[rank - 1]) if rank else 1.0
    errors = np.sqrt(variance) * np.linalg.norm(vt[:rank].T / s[:rank], axis=1) / lengths
    errors[np.abs(vt[rank:]).max(axis=0, initial=0.0) > SHARE] = np.nan
    return errors, rank, condition


def half_width(error: float, freedom: int) -> float:
    """Half of the 95 % confidence interval of a parameter, `t_{0.975, freedom} error`; NaN where
    the error is unknown.

    It holds for independent errors of equal size. The samples of a record over time are neighbours,
    and theirs are not: there it is too narrow.
    """
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.975) * error) if freedom > 0 else float("nan")


def _lengths(columns: Array) -> Array:
    """Lengths of columns, `(n, m)`; one for a column of zeros."""
    largest = np.abs(columns).max(axis=0)
    largest[largest == 0.0] = 1.0
    # squares of tiny or huge columns would leave the range
    lengths = largest * np.linalg.norm(columns / largest, axis=0)
    lengths[lengths == 0.0] = 1.0
    return np.asarray(lengths)
