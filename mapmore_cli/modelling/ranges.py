"""Describe the training range of a model. It is the range of every input, which is interpolated
between the levels of the training curves.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, row_count
from mapmore_cli.domain.recording import CurveRange

OUTSIDE_TOLERANCE = 1e-9
"""Distance from a range, as a fraction of its width, up to which an input is treated as inside. An
input at the end of a range may lie slightly outside because of rounding errors.
"""


class InputRange(NamedTuple):
    """Training range of one input, from `low` to `high`, shape (L,) each. The range is interpolated
    linearly between the `levels`, shape (L,), of the input `at`. If `at` is None, there is only one
    range.
    """

    name: str
    at: str | None
    levels: Array
    low: Array
    high: Array

    def ends(self, columns: Columns) -> tuple[Array, Array]:
        """Return the smallest and the largest value of the input at every row, shape (n,) or (1,)
        each.
        """
        if self.at is None:
            return self.low[:1], self.high[:1]
        place = columns[self.at]
        return np.interp(place, self.levels, self.low), np.interp(place, self.levels, self.high)


def limits(ranges: Sequence[CurveRange], level: str | None) -> Iterator[InputRange]:
    """Yield the training range of every input. The first result is the range of the level, which
    reaches from the lowest to the highest level, shape (1,) each.

    The range of any other input is interpolated linearly between the curves, because curves have
    different ranges: for example, the free strain grows with the pressure.
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
    """Return True for rows at which an input lies outside its training range, shape (n,)."""
    outside = np.zeros(row_count(columns), dtype=np.bool_)
    for input_range in limits(ranges, level):
        if input_range.name in columns:
            (low, high), x = input_range.ends(columns), columns[input_range.name]
            margin = OUTSIDE_TOLERANCE * np.max([high - low, np.abs(low), np.abs(high)], axis=0)
            outside |= (x < low - margin) | (x > high + margin)
    return outside
