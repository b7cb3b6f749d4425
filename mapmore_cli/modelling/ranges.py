"""Where a model was trained: the range of every input, between the levels of its curves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, row_count
from mapmore_cli.domain.recording import CurveRange

OUTSIDE_TOLERANCE = 1e-9
"""Inputs within this fraction of a range beyond its end still count as inside: the end itself must
not be flagged by rounding.
"""


class InputRange(NamedTuple):
    """Training range of one input: `low` to `high`, (L,) each; linear between `levels`, (L,), of
    the input `at` where that is not None.
    """

    name: str
    at: str | None
    levels: Array
    low: Array
    high: Array

    def ends(self, columns: Columns) -> tuple[Array, Array]:
        """Return the least and the greatest value of the input at every row, (n,) or (1,) each."""
        if self.at is None:
            return self.low[:1], self.high[:1]
        place = columns[self.at]
        return np.interp(place, self.levels, self.low), np.interp(place, self.levels, self.high)


def limits(ranges: Sequence[CurveRange], level: str | None) -> Iterator[InputRange]:
    """Yield the training range of every input, the level first: its own is that of its levels, (1,)
    each.

    That of any other input is interpolated linearly between the curves, since each curve has its
    own (free strain grows with pressure).
    """
    if not ranges:
        return
    levels = (
        np.array([curve_range.level for curve_range in ranges], dtype=np.float64)
        if level is not None
        else np.empty(0)
    )
    if level is not None:
        yield InputRange(level, None, levels, levels[:1], levels[-1:])
    for name in ranges[0].limits:
        if name != level:
            low, high = np.array([curve_range.limits[name] for curve_range in ranges]).T
            yield InputRange(name, level, levels, low, high)


def outside_limits(ranges: Sequence[CurveRange], level: str | None, columns: Columns) -> BoolArray:
    """Return True if an input lies beyond its training range, (n,)."""
    outside = np.zeros(row_count(columns), dtype=np.bool_)
    for input_range in limits(ranges, level):
        if input_range.name in columns:
            (low, high), x = input_range.ends(columns), columns[input_range.name]
            margin = OUTSIDE_TOLERANCE * np.max([high - low, np.abs(low), np.abs(high)], axis=0)
            outside |= (x < low - margin) | (x > high + margin)
    return outside
