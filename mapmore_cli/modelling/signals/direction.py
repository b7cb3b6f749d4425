"""The direction of motion: rise or fall."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array

RISE, FALL = 1.0, -1.0


def direction(rate: Array, dead_band: float) -> Array:
    """Sign of a rate, +1 (rise) or -1 (fall), (n,); where `|rate| <= dead_band` the last direction holds.

    A recording starts with +1, so that the direction is known from its first sample on, and from past samples alone (M2 eq 16 switches by
    whether the pressure rises; a bare sign would toggle on the noise of every plateau).
    """
    moving = np.abs(rate) > dead_band
    last = np.maximum.accumulate(np.where(moving, np.arange(len(rate)), -1))
    return np.where(last < 0, RISE, np.sign(rate[np.maximum(last, 0)]))
