"""Solve linear least squares by singular value decomposition. The solution has minimum norm; its
rank, condition number and standard errors are also computed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array

RANK_TOLERANCE = 1e-13
"""Singular values below this fraction of the largest one are regarded as rounding errors. Exactly
dependent columns leave about 1e-16.
"""

SHARE = 0.1
"""A parameter is undetermined if more than this fraction of it lies in a direction that does not
change the result.
"""


class LinearFit(NamedTuple):
    """Solution of `min |Phi beta - y|` with the smallest norm, if the columns of Phi are scaled to
    unit length.

    - `beta`: shape (m,), in the units of the given columns.
    - `basis`: orthonormal basis of the column space, shape (n, m); zero beyond the rank.
    - `residual`: `Phi beta - y`, shape (n,). It is computed as the component of -y that is
      orthogonal to the basis.
    """

    beta: Array
    basis: Array
    residual: Array


def solve_linear(phi: Array, y: Array) -> LinearFit:
    """Solve least squares with finite regressors `phi`, shape (n, m), and target `y`, shape (n,).

    The columns are scaled to unit length first, so that neither the solution nor the rank depends
    on units.
    """
    lengths = _lengths(phi)
    u, s, vt = np.linalg.svd(phi / lengths, full_matrices=False)
    above = s > RANK_TOLERANCE * s[:1]
    basis = u * above
    components = basis.T @ y
    residual = basis @ components - y
    # orthogonalise a second time, because a small residual has lost digits
    residual -= basis @ (basis.T @ residual)
    weights = np.divide(components, s, out=np.zeros_like(s), where=above)
    return LinearFit(vt.T @ weights / lengths, basis, residual)


def parameter_errors(jacobian: Array, variance: float) -> tuple[Array, int, float]:
    """Return standard errors, shape (p,), rank and condition number from the Jacobian J at the
    solution, shape (n, p). The covariance matrix is `variance (J'J)^-1`.

    If the rank is deficient, the errors of parameters that the data cannot distinguish are NaN. The
    condition number is computed without the singular values that are zero apart from rounding
    errors.
    """
    lengths = _lengths(jacobian)
    _, s, vt = np.linalg.svd(jacobian / lengths, full_matrices=False)
    rank = int(np.count_nonzero(s > RANK_TOLERANCE * s[:1]))
    condition = float(s[0] / s[rank - 1]) if rank else 1.0
    errors = np.sqrt(variance) * np.linalg.norm(vt[:rank].T / s[:rank], axis=1) / lengths
    errors[np.abs(vt[rank:]).max(axis=0, initial=0.0) > SHARE] = np.nan
    return errors, rank, condition


def half_width(error: float, freedom: int) -> float:
    """Return half the width of the 95 % confidence interval of a parameter, `t_{0.975, freedom}
    error`; NaN if the error is unknown or `freedom` is not positive.

    The interval assumes independent errors of equal size. Neighbouring samples of a recording have
    correlated errors, so that the interval is too narrow.
    """
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.975) * error)


def _lengths(columns: Array) -> Array:
    """Return the Euclidean length of each column of a matrix, shape (n, m); one for a column of
    zeros.
    """
    largest = np.abs(columns).max(axis=0)
    largest[largest == 0.0] = 1.0
    # The columns are scaled first, because the squares of their values may overflow or underflow.
    lengths = largest * np.linalg.norm(columns / largest, axis=0)
    lengths[lengths == 0.0] = 1.0
    return np.asarray(lengths)
