"""Where a model was trained."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns
from mapmore_cli.domain.models import CurveRange

OUTSIDE_TOLERANCE = 1e-9
"""Inputs within this fraction of a range beyond its end still count as inside: the end itself must not be flagged by rounding."""


def outside(ranges: Sequence[CurveRange], level: str | None, columns: Columns) -> BoolArray:
    """True where an input lies beyond its training range, (n,).

    The range of the level quantity is that of its levels; the range of any other input is interpolated linearly between the curves, since
    each curve has its own (free strain grows with pressure).
    """
    found = np.zeros(len(next(iter(columns.values()))), dtype=np.bool_)
    if not ranges:
        return found
    if level is not None:
        levels = np.array([one.level for one in ranges], dtype=np.float64)
        found |= _beyond(columns[level], levels[:1], levels[-1:])
    for name in ranges[0].limits:
        if name == level or name not in columns:
            continue
        limits = np.array([one.limits[name] for one in ranges])
        if level is None:
            low, high = limits[:1, 0], limits[:1, 1]
        else:
            low, high = (np.interp(columns[level], levels, limits[:, side]) for side in (0, 1))
        found |= _beyond(columns[name], low, high)
    return found


def _beyond(x: Array, low: Array, high: Array) -> BoolArray:
    margin = OUTSIDE_TOLERANCE * np.maximum(high - low, np.maximum(np.abs(low), np.abs(high)))
    return np.asarray((x < low - margin) | (x > high + margin))
