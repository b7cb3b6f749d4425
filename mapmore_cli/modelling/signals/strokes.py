"""Where the cycles of a driven quantity begin, so that a record can be parted between cycles."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.signals.cycles import turning_points

SWING = 0.4  # of the range: a smaller rise or fall is part of a cycle
REST = 0.05  # of the range: within this of the low before it, a cycle has not begun


def cycle_starts(x: Array) -> IntArray:
    """Row at which each cycle of `x` (n,) begins: the last at rest before it rises; empty where x never moves.

    A cycle is a rise by at least 0.4 of the range of x; rest is within 0.05 of it from the lowest value since the cycle before, so the
    level of rest may drift.
    """
    span = float(np.ptp(x)) if len(x) else 0.0
    turns = turning_points(x, SWING * span)
    starts = []
    for before, after in pairwise(turns.tolist()):
        if x[after] > x[before]:
            rising = x[before : after + 1]
            starts.append(before + int(np.flatnonzero(rising <= x[before] + REST * span)[-1]))
    return np.array(starts, dtype=np.int64)


def last_cycles(x: Array, share: float) -> BoolArray:
    """The samples of the last `share` of the cycles of `x` (n,), rounded down to whole cycles; the rest before them is not among them.

    Raises
    ------
    DataError
        Where there are fewer than two cycles, or a share of none or all of them.
    """
    starts = cycle_starts(x)
    first = math.ceil((1 - share) * len(starts) - 1e-9)
    if not 0 < first < len(starts):
        raise DataError(
            f"{len(starts)} cycle(s) were found; the last {share:g} of them cannot be held out while others train",
            "hold out a share of the samples instead, as `last: 0.5`",
        )
    return np.asarray(np.arange(len(x)) >= starts[first])
