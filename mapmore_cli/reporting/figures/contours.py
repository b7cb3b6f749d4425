"""Compute the outlines of the regions in which a quantity on a grid lies above a level."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array, Ends

Outline = tuple[list[float], list[float]]
"""Corners of a region in the order of its outline: their horizontal and their vertical
coordinates.
"""


def outlines_above(x: Array, heights: Array, z: Array, level: float) -> list[Outline]:
    """Return the regions where `z` is at least a level.

    `x` and `z`, (m, n), are given on a grid of m rows, whose heights are `heights`, (m,). Within a
    row, the ends of a region are found by linear interpolation between neighbours. From row to row,
    the sides of a region are straight lines. Points where `z` is NaN belong to no region.
    """
    outlines: list[Outline] = []
    rows = [_intervals(*row, level) for row in zip(x, z, strict=True)]
    regions: list[Outline] = [([], []) for _ in rows[0]]
    for number, (intervals, height) in enumerate(zip(rows, heights.tolist(), strict=True)):
        before = rows[number - 1] if number else intervals
        # if the number of regions changes, old ones end and new ones begin between the two rows
        if len(intervals) != len(before):
            middle = (heights[number - 1] + height) / 2
            _go_on(regions, before, middle)
            outlines += [_closed(region) for region in regions]
            regions = [([], []) for _ in intervals]
            _go_on(regions, intervals, middle)
        _go_on(regions, intervals, height)
    return outlines + [_closed(region) for region in regions]


def _go_on(regions: Sequence[Outline], intervals: Sequence[Ends], height: float) -> None:
    """Extend each region by one row: add the two ends of its interval, at the height of the row, to
    the corners of the region.
    """
    for (across, up), ends in zip(regions, intervals, strict=True):
        across.extend(ends)
        up.extend((height, height))


def _closed(region: Outline) -> Outline:
    """Return the corners of a region in the order of its outline: upwards on the left side, then
    downwards on the right side.
    """
    across, up = region
    return across[::2] + across[::-2], up[::2] + up[::-2]


def _intervals(x: Array, z: Array, level: float) -> list[Ends]:
    """Return the intervals of x in which `z` is at least a level. `x` and `z`, (n,) each, are one
    row of the grid.
    """
    above = np.concatenate([[False], z >= level, [False]])
    starts, stops = np.flatnonzero(~above[:-1] & above[1:]), np.flatnonzero(above[:-1] & ~above[1:])
    return [
        (_crossing(x, z, level, first, first - 1), _crossing(x, z, level, last, last + 1))
        for first, last in zip(starts.tolist(), (stops - 1).tolist(), strict=True)
    ]


def _crossing(x: Array, z: Array, level: float, inside: int, outside: int) -> float:
    """Return the x at which `z` crosses a level between two neighbours in a row, by linear
    interpolation. If the outer neighbour does not exist or is NaN, return the x of the inner
    neighbour.
    """
    if not 0 <= outside < len(z) or not np.isfinite(z[outside]):
        return float(x[inside])
    share = (z[inside] - level) / (z[inside] - z[outside])
    return float(x[inside] + share * (x[outside] - x[inside]))
