"""Where one variable of one curve is cut."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.recipe import Breakpoints, Cut, Directions, Even, Gradient, Optimal
from mapmore_cli.modelling.segmentation.gradient import gradient_boundaries
from mapmore_cli.modelling.segmentation.optimal import optimal_partition

IntervalCost = Callable[[Curve, IntArray], float]
"""What the fit of a segment function leaves on some rows of a curve: its sum of squared errors, in the unit of the target squared."""

MOST_SAMPLES = 500
"""Samples of a curve on which costs of intervals are computed; of more, an even share in the order of the variable is taken."""


def cut_points(curve: Curve, rows: IntArray, name: str, target: str, cut: Cut, cost: IntervalCost) -> Array:
    """Segment locations `seg_i` of one variable over the range of the given rows, both ends included, (count + 1,).

    Given breakpoints that lie outside of the curve's own range are left out: a low-pressure curve ends at a smaller strain.
    """
    if isinstance(cut, Directions):
        return np.array([-1.0, 0.0, 1.0])
    x, y = curve.columns[name][rows], curve.columns[target][rows]
    low, high = float(x.min()), float(x.max())
    if low == high:
        return np.array([low, high])
    match cut:
        case Even(count):
            return np.linspace(low, high, count + 1)
        case Breakpoints(at):
            return np.array([low, *(b for b in at if low < b < high), high])
        case Gradient():
            return np.array([low, *gradient_boundaries(x, y, cut), high])
        case Optimal():
            order = np.lexsort((y, x))
            thinned = rows[order[:: -(-len(rows) // MOST_SAMPLES)]]
            return _optimal_points(curve, thinned, name, np.linspace(low, high, cut.grid + 1), cut, cost)


def _optimal_points(curve: Curve, rows: IntArray, name: str, grid: Array, cut: Optimal, cost: IntervalCost) -> Array:
    x = curve.columns[name][rows]

    @cache
    def interval(i: int, j: int) -> float:
        inside = rows[(x >= grid[i]) & (x <= grid[j])]
        return cost(curve, inside) if len(inside) >= cut.min_samples else float("inf")

    places = optimal_partition(interval, cut.grid, cut.count)
    if places is None:
        raise DataError(
            f"curve {curve.id}: cannot be cut into {cut.count} segments of at least {cut.min_samples} samples along {name}",
            f"use fewer segments, lower segment.{name}.min_samples, or raise segment.{name}.grid",
        )
    return np.array([grid[0], *grid[list(places)], grid[-1]])
