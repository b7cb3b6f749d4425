"""What a variable does beyond its limits (M2 eq 12, figure 7)."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.models import Side


def clamped(x: Array, limits: tuple[float, float], sides: tuple[Side, Side]) -> Array:
    """The extrapolation function E (M2 eq 12)."""
    (low, high), (below, above) = limits, sides
    if below != "continue":
        x = np.where(x < low, below if isinstance(below, float) else low, x)
    if above != "continue":
        x = np.where(x > high, above if isinstance(above, float) else high, x)
    return x


def zeroed(x: Array, limits: tuple[float, float], sides: tuple[Side, Side]) -> BoolArray:
    """Rows where the outermost weight steps to zero at the limit (M2 figure 7d)."""
    return ((x < limits[0]) & (sides[0] == "zero")) | ((x > limits[1]) & (sides[1] == "zero"))
