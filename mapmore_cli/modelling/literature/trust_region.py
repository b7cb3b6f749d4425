"""Least squares within bounds (trust region reflective), and which bounds the solution touches."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from mapmore_cli.domain.arrays import Array

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

EVALUATIONS = 100
TOUCHING = 1e-6  # of the range of a coordinate (or absolute, where it has no end): the method only approaches a bound


def descend(
    residual: Callable[[Array], Array], jacobian: Callable[[Array], Array], start: Array, bounds: tuple[Array, Array], tolerance: float
) -> OptimizeResult:
    """The nearest minimum of `|residual(x)|^2` from `start`, `(k,)`, with `bounds` the lowest and the highest coordinates, each `(k,)`."""
    from scipy.optimize import least_squares

    return least_squares(
        residual,
        start,
        jacobian,
        bounds=bounds,
        x_scale="jac",
        xtol=tolerance,
        ftol=tolerance,
        gtol=tolerance,
        max_nfev=EVALUATIONS,
    )


def onto_bounds(x: Array, bounds: tuple[Array, Array]) -> tuple[Array, list[int]]:
    """The coordinates `x`, `(k,)`, moved onto a bound where they all but touch it, and the indices of those."""
    lower, upper = bounds
    width = upper - lower
    margin = TOUCHING * np.where(np.isfinite(width), width, 1.0)
    moved = np.where(x - lower <= margin, lower, np.where(upper - x <= margin, upper, x))
    return moved, [i for i in range(len(x)) if moved[i] in (lower[i], upper[i])]
