"""Cut training curves into a grid of cells, with one segment for each cell (M1 section III,
IV.A).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise, product

import numpy as np

from mapmore_cli.domain.arrays import (
    Array,
    BoolArray,
    Columns,
    Ends,
    IntArray,
    Rows,
    blocks_where,
    by_blocks,
    extremes,
    picked,
    rows_where,
)
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import Scaling, Segment, SegmentedCurve
from mapmore_cli.domain.recording import DIRECTION, Curve, united
from mapmore_cli.modelling.frols.remainders import TIE_TOLERANCE
from mapmore_cli.modelling.pieces.recipe import CELLS, Cut, CutByDirection, Cuts
from mapmore_cli.modelling.signals.rates import STEPS, running_median

# A slope is computed in a window with this fraction of the range of the curve as its width.
# With `method: gradient`, two boundaries are at least one such window apart.
WINDOW = 0.1
# The smallest distance of two boundaries is reduced by this fraction because of rounding errors.
ROUNDING = 1e-9
# smallest number of samples in a segment, so that a gap in a curve gets no segment of its own
FEWEST_SAMPLES = 5


def gradient_boundaries(x: Array, y: Array, count: int) -> Array:
    """Return the `count - 1` inner boundaries in ascending order. They are the places at which the
    slope of the curve changes most. The samples, (n,), may be in any order.

    Each boundary is at least one window away from the others and from the ends of the range, and
    each segment has at least `FEWEST_SAMPLES` samples. If too few places satisfy these conditions,
    fewer boundaries are returned.
    """
    from scipy.signal import find_peaks

    low, high = extremes(x)
    window = WINDOW * (high - low)
    apart = window * (1 - ROUNDING)
    at, change = slope_change(x, y, window)
    height = np.where((at >= low + apart) & (at <= high - apart), np.abs(change), 0.0)
    peaks, _ = find_peaks(height)
    boundaries: list[float] = []
    for peak in at[peaks[np.argsort(-height[peaks], kind="stable")]].tolist():
        more = sorted([*boundaries, peak])
        sizes = np.bincount(np.searchsorted(more, x))
        if sizes.min() >= FEWEST_SAMPLES and all(
            abs(peak - other) >= apart for other in boundaries
        ):
            boundaries.append(peak)
    return np.sort(np.array(boundaries[: count - 1]))


def slope_change(x: Array, y: Array, window: float) -> tuple[Array, Array]:
    """Return places along a curve and the change of slope at each place, shape (m,) each. The
    change is the slope to the right minus the slope to the left.

    Each slope is that of a straight line through two points of the smoothed curve: the point at the
    place, and the point one window to the right or to the left. Near the ends of the curve, windows
    are shorter. The curve is smoothed by a moving average of x and y over the same samples, so that
    a straight line stays straight.
    """
    at, smooth = running_median(x, y, window)
    here = np.arange(len(at))
    first = np.maximum(here - STEPS // 2, 0)
    last = np.minimum(here + STEPS // 2 + 1, len(at))

    def mean(values: Array) -> Array:
        total = np.concatenate([[0.0], np.cumsum(values)])
        return np.asarray((total[last] - total[first]) / (last - first))

    mean_x, mean_y = mean(at), mean(smooth)

    def slope(start: IntArray, end: IntArray) -> Array:
        width = mean_x[end] - mean_x[start]
        return np.asarray(
            np.divide(
                mean_y[end] - mean_y[start], width, out=np.full(len(width), np.nan), where=width > 0
            )
        )

    left = slope(np.maximum(here - STEPS, 0), here)
    right = slope(here, np.minimum(here + STEPS, len(at) - 1))
    # at the ends of the curve, one of the slopes is NaN
    return at, np.nan_to_num(right - left)


def optimal_partition(
    cost: Callable[[int, int], float], cells: int, count: int
) -> tuple[int, ...] | None:
    """Return the inner boundaries that cut cells 0..cells-1 into `count` intervals with the
    smallest total cost; None if every partition has an infinite cost.

    `cost(i, j)` returns the cost of the interval of cells i..j-1; infinity forbids this interval.

    Let `best_k(j)` be the smallest cost of the first j cells in k intervals. Then `best_k(j) =
    min_i best_{k-1}(i) + cost(i, j)` (Bellman 1961). So at most `cells (cells + 1) / 2` costs are
    computed, instead of the costs of every partition.
    """
    table = np.full((cells + 1, cells + 1), np.inf)
    for i in range(cells):
        for j in range(i + 1, cells + 1):
            table[i, j] = cost(i, j)
    tie = TIE_TOLERANCE * float(table[np.isfinite(table)].max(initial=0.0))
    best = table[0]
    came_from = []
    for _ in range(count - 1):
        sums = best[:, None] + table
        least = sums.min(axis=0)
        came_from.append(np.argmax(sums <= least + tie, axis=0))
        best = least
    if not np.isfinite(best[cells]):
        return None
    places = []
    end = cells
    for previous in reversed(came_from):
        end = int(previous[end])
        places.append(end)
    return tuple(reversed(places))


def samples_at(columns: Columns, rows: Rows, names: Iterable[str]) -> dict[str, Array]:
    """Return the columns with the given `names` at the given rows."""
    return {name: picked(columns[name], rows) for name in names}


def scaled_inputs(scaling: Scaling, columns: Columns) -> dict[str, Array]:
    """Return the inputs of a segment in scaled coordinates, `z = slope x + intercept` (M2 eq 8)."""
    return {
        name: columns[name] * m + c
        for name, m, c in zip(scaling.variables, scaling.slope, scaling.intercept, strict=True)
    }


IntervalCost = Callable[[Curve, IntArray], float]
"""Function that returns the sum of squared errors of a segment function on some rows of a curve, in
the squared unit of the target.
"""

# costs of intervals are computed on at most this many samples of a curve, evenly spread
MOST_SAMPLES = 500


def cut_points(
    curve: Curve, training: BoolArray, name: str, target: str, cut: Cut, cost: IntervalCost
) -> Array:
    """Return the segment boundaries `seg_i` of one variable over the range of the training samples,
    including both ends, shape (count + 1,).

    Breakpoints outside the range of the curve are left out. This happens, for example, for a curve
    at a low pressure, which ends at a smaller strain than the others.
    """
    if isinstance(cut, CutByDirection):
        return np.array([-1.0, 0.0, 1.0])
    x, y = curve.columns[name], curve.columns[target]
    low, high = extremes(x, training)
    if low == high:
        return np.array([low, high])
    match cut.method:
        case "even":
            return joined_segments(np.linspace(low, high, cut.segments + 1), x, cut.least, training)
        case "breakpoints":
            return joined_segments(
                np.array([low, *(b for b in cut.at or () if low < b < high), high]),
                x,
                cut.least,
                training,
            )
        case "gradient":
            inner = gradient_boundaries(x[training], y[training], cut.segments)
            return np.array([low, *inner, high])
        case "optimal":
            rows = np.flatnonzero(training)
            order = np.lexsort((y[rows], x[rows]))
            thinned = rows[order[:: -(-len(rows) // MOST_SAMPLES)]]
            return _optimal_points(
                curve, thinned, name, np.linspace(low, high, CELLS + 1), cut, cost
            )


def joined_segments(boundaries: Array, x: Array, least: int, training: BoolArray) -> Array:
    """Remove boundaries of one variable until every segment holds at least `least` of the
    `training` samples, and return the boundaries that are left.

    The segment with the fewest samples is joined with the neighbour that has fewer samples, or with
    the left neighbour if both have the same number. This is repeated until every segment has enough
    samples. Segments must be joined because some parts of a curve may have few samples.
    """
    kept = boundaries.tolist()
    while len(kept) > 2:
        parts = blocks_where(x, training)
        counts = np.sum(
            [[np.sum((x >= low) & (x <= high)) for low, high in pairwise(kept)] for x in parts],
            axis=0,
        )
        i = int(np.argmin(counts))
        if counts[i] >= least:
            break
        to_left = i == len(counts) - 1 or (i > 0 and counts[i - 1] <= counts[i + 1])
        del kept[i if to_left else i + 1]
    return np.array(kept)


def _optimal_points(
    curve: Curve, rows: IntArray, name: str, grid: Array, cut: Cuts, cost: IntervalCost
) -> Array:
    x = curve.columns[name][rows]

    def interval(i: int, j: int) -> float:
        inside = rows[(x >= grid[i]) & (x <= grid[j])]
        return cost(curve, inside) if len(inside) >= cut.least else float("inf")

    places = optimal_partition(interval, CELLS, cut.segments)
    if places is None:
        raise DataError(
            f"curve {curve.id}: cannot be cut into {cut.count} segments of at least "
            f"{cut.least} samples along {name}",
            f"use fewer segments, or lower segment.{name}.min_samples",
        )
    return np.array([grid[0], *grid[list(places)], grid[-1]])


def training_curves(curves: Sequence[Curve], by_level: bool) -> tuple[Curve, ...]:
    """Return the curves that are cut into segments. If curves are interpolated `by_level`, these
    are all curves with training samples. Otherwise, it is one curve called `all` with the samples
    of all curves; a single curve is returned unchanged.
    """
    if by_level:
        return tuple(curve for curve in curves if curve.training.any())
    if len(curves) == 1:
        return tuple(curves)
    whole = Curve(
        id="all",
        level=None,
        columns={
            name: np.concatenate([curve.columns[name] for curve in curves])
            for name in curves[0].columns
        },
        held_out=np.concatenate([curve.held_out for curve in curves]),
        recordings=tuple(dict.fromkeys(r for curve in curves for r in curve.recordings)),
        at_rest=np.concatenate([~(curve.training | curve.held_out) for curve in curves]),
        measured=united([curve.measured for curve in curves]),
    )
    return (whole,)


def trained_at(curves: Sequence[Curve], level: str | float) -> tuple[Curve, ...]:
    """Return the curves, and keep training samples only in the curves at `level`. In all other
    curves, every sample is marked as at rest, so that the fit does not use it. `level` is a number,
    `highest` for the highest training level, or `all` for unchanged curves.
    """
    if level == "all":
        return tuple(curves)
    chosen = (
        max(c.level for c in curves if c.level is not None and c.training.any())
        if level == "highest"
        else level
    )
    return tuple(
        c if c.level == chosen else replace(c, at_rest=np.ones(c.size, dtype=bool)) for c in curves
    )


def segment_curve(
    curve: Curve, cuts: Mapping[str, Cut], target: str, cost: IntervalCost
) -> SegmentedCurve:
    """Cut the training samples of one curve over its own range into a grid of cells, with one
    segment for each cell.

    A sample on a boundary belongs to both segments, because segments include both ends.

    Raises DataError if a segment has no sample, or if the curve has too few samples for the cut.
    """
    training = curve.training
    boundaries = {
        name: cut_points(curve, training, name, target, cut, cost) for name, cut in cuts.items()
    }
    inputs = [curve.columns[name] for name in cuts]
    segments = []
    for cell in product(*(enumerate(pairwise(ends), 1) for ends in boundaries.values())):
        place = tuple(i for i, _ in cell)
        sides = [ends for _, ends in cell]

        def inside(trains: BoolArray, *values: Array, limits: Sequence[Ends] = sides) -> BoolArray:
            within = [
                (x >= low) & (x <= high) for x, (low, high) in zip(values, limits, strict=True)
            ]
            return np.asarray(np.logical_and.reduce([trains, *within]))

        rows = rows_where(by_blocks(inside, training, *inputs))
        segments.append(Segment(segment_id(curve.id, tuple(cuts), place), curve.id, place, rows))
    if empty := [segment.id for segment in segments if not len(segment.rows)]:
        remedy = "use fewer segments, move the breakpoints, or loosen `data.keep`"
        raise DataError(f"segment {empty[0]}: contains no training sample", remedy)
    limits = {name: curve.limits(name) for name in curve.columns}
    return SegmentedCurve(
        curve.id, curve.level, limits, tuple(boundaries.values()), tuple(cuts), tuple(segments)
    )


def cut_by_course(
    curves: Sequence[Curve], by_level: bool, cuts: Mapping[str, Cut], target: str
) -> list[SegmentedCurve]:
    """Return every training curve with the boundaries of its segments. The boundaries follow from
    the measured samples alone. Therefore, `cuts` may have any method except `optimal`, which needs
    fits. Raises the same errors as `segment_curve`.
    """
    return [
        segment_curve(curve, cuts, target, lambda _curve, _rows: 0.0)
        for curve in training_curves(curves, by_level)
    ]


def segment_id(curve: str, variables: Sequence[str], cell: Sequence[int]) -> str:
    """Return the name of a segment, for example `<curve>/strain:2`. Several variables are separated
    by `;`. With directions, it is `<curve>;direction=rise/...`, and without any cut `<curve>/all`.
    """
    places = dict(zip(variables, cell, strict=True))
    direction = places.pop(DIRECTION, None)
    if direction is not None:
        curve = f"{curve};direction={('fall', 'rise')[direction - 1]}"
    return f"{curve}/" + (";".join(f"{name}:{place}" for name, place in places.items()) or "all")
