"""What a variable does beyond its limits (M2 eq 12, figure 7)."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.models import Side


def clamped(x: Array, limits: tuple[float, float], sides: tuple[Side, Side]) -> Array:
    """The extrapolation function E (M2 eq 12), (n,)."""
    inside = x
    for side, limit, beyond in zip(sides, limits, (x < limits[0], x > limits[1]), strict=True):
        if side != "continue":
            inside = np.where(beyond, held_at(side, limit), inside)
    return inside


def held_at(side: Side, limit: float) -> float:
    """Where a variable is held beyond a limit: there, or at the value that the side gives."""
    return side if isinstance(side, float) else limit
