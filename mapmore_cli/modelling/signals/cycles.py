"""Split load cycles into branches, and find where cycles begin."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, IntArray, columns_at
from mapmore_cli.domain.errors import DataError

# a reversal by less than this fraction of the range is noise or a minor loop
SWING = 0.1
# Rests are cut off at both ends of a branch, at each end at most this fraction of the whole range.
TRIM = 0.01
FEWEST = 5  # smallest number of places at which a branch must be measured
REMEDY = "leave out `cycles`, or record a movement there and back with more samples"


@dataclass(frozen=True)
class Branches:
    """Both branches of a load cycle at common values of `over`, shape (samples,) each.

    On the `contraction` branch, `over` rises; on the `extension` branch, it falls. If `over` is the
    strain, the force is lower on the `contraction` branch.
    """

    over: Array
    contraction: Columns
    extension: Columns

    def static(self) -> dict[str, Array]:
        """Return the mean of both branches for every quantity."""
        return {
            name: (self.extension[name] + values) / 2 for name, values in self.contraction.items()
        }

    def hysteresis(self, name: str) -> Array:
        """Return half the difference `extension - contraction` of the quantity `name`."""
        return (self.extension[name] - self.contraction[name]) / 2


def split_cycles(over: Array, columns: Columns, samples: int) -> Branches:
    """Split load cycles of `over`, (n,), in the order of time, into two branches with `samples`
    evenly spaced common values.

    Reversals smaller than a tenth of the range of `over` are ignored, so that neither noise nor
    quantisation splits a branch. Rests at the ends of the stroke, during which the force relaxes,
    belong to neither branch. Several cycles are pooled. Each branch is averaged in `samples` bins
    over the common range, and then interpolated linearly between the mean positions of the bins.
    The result therefore does not depend on the speed of the cycle.

    Raises DataError if there is no full cycle, or too few samples on a branch.
    """
    runs = _trimmed_runs(over)
    for direction, name in ((1, "contraction"), (-1, "extension")):
        if not runs[direction]:
            message = f"there is no full load cycle, because the {name} branch is missing"
            raise DataError(message, REMEDY)
    rising, falling = np.concatenate(runs[1]), np.concatenate(runs[-1])
    low = max(over[rising].min(), over[falling].min())
    high = min(over[rising].max(), over[falling].max())
    edges = np.linspace(low, high, samples + 1)
    means = [bin_means(over[rows], columns_at(columns, rows), edges) for rows in (rising, falling)]
    for (places, _), name in zip(means, ("contraction", "extension"), strict=True):
        if len(places) < FEWEST:
            raise DataError(
                f"the {name} branch was measured at {len(places)} different places, but "
                f"{FEWEST} are needed",
                REMEDY,
            )
    grid = np.linspace(max(x[0] for x, _ in means), min(x[-1] for x, _ in means), samples)
    contraction, extension = (
        {name: np.interp(grid, x, y) for name, y in values.items()} for x, values in means
    )
    return Branches(grid, contraction, extension)


def turning_points(values: Array, swing: float) -> IntArray:
    """Return the rows of the minima and maxima at which `values`, (n,), reverse, including the two
    ends of the movement.

    Except for the end of the movement, a minimum or maximum is returned only if the values then
    move back by at least `swing`. If consecutive values are equal, the first of them is the minimum
    or maximum. The result is empty if no movement is as large as `swing`.
    """
    series = values.tolist()
    turns: list[int] = []
    low = high = direction = 0
    for row, value in enumerate(series):
        low = row if value < series[low] else low
        high = row if value > series[high] else high
        if direction >= 0 and series[high] - value >= swing > 0:
            turns.append(high)
            direction = -1
            low = row
        elif direction <= 0 and value - series[low] >= swing > 0:
            turns.append(low)
            direction = 1
            high = row
    if turns:
        turns.append(high if direction == 1 else low)
    return np.array(turns, dtype=np.int64)


def bin_means(over: Array, columns: Columns, edges: Array) -> tuple[Array, dict[str, Array]]:
    """Return the mean of `over` and of every quantity for each bin that has samples, in the order
    of the bins.
    """
    inside = (over >= edges[0]) & (over <= edges[-1])
    place = np.clip(np.searchsorted(edges, over[inside], side="right") - 1, 0, len(edges) - 2)
    counts = np.bincount(place, minlength=len(edges) - 1)
    filled = counts > 0

    def means(values: Array) -> Array:
        return np.bincount(place, values[inside], minlength=len(counts))[filled] / counts[filled]

    return means(over), {name: means(values) for name, values in columns.items()}


def _trimmed_runs(over: Array) -> Mapping[int, list[IntArray]]:
    """Return the rows of each movement between two turning points, grouped by direction (1 rising,
    -1 falling). Rests at the ends of a movement are left out.
    """
    runs: dict[int, list[IntArray]] = {1: [], -1: []}
    if not len(over):
        return runs
    span = float(np.ptp(over))
    # second differences are zero for a steady movement, so they show the noise
    bends = np.diff(over, 2)
    noise = 1.4826 * float(np.median(np.abs(bends))) / math.sqrt(6.0) if len(bends) else 0.0
    tolerance = min(2 * noise, TRIM * span)
    for begin, end in pairwise(turning_points(over, SWING * span)):
        direction = int(np.sign(over[end] - over[begin]))
        travelled = direction * (over[begin : end + 1] - over[begin])
        first = int(np.flatnonzero(travelled <= tolerance)[-1])
        last = first + int(np.flatnonzero(travelled[first:] >= travelled[-1] - tolerance)[0])
        runs[direction].append(np.arange(begin + first, begin + last + 1))
    return runs


def cycle_starts(x: Array) -> IntArray:
    """Return the row at which each cycle of `x`, (n,), begins: the last row at rest before x rises.
    The result is empty if x never moves.

    A cycle begins with a rise by at least 0.4 of the range of x. x is at rest if it is at most
    0.05 of the range above its lowest value since the last cycle. So the value at rest may drift.
    """
    span = float(np.ptp(x)) if len(x) else 0.0
    turns = turning_points(x, 0.4 * span)
    starts = []
    for before, after in pairwise(turns.tolist()):
        if x[after] > x[before]:
            rising = x[before : after + 1]
            starts.append(before + int(np.flatnonzero(rising <= x[before] + 0.05 * span)[-1]))
    return np.array(starts, dtype=np.int64)


def last_cycles(x: Array, share: float) -> BoolArray:
    """Return a mask of the samples that belong to the last cycles of `x`, (n,). `share` is the
    number of these cycles divided by the number of all cycles; the number of cycles is rounded
    down. Samples at rest before the first of these cycles are not included.

    Raises DataError if there are fewer than two cycles, or if the share gives no cycle or all
    cycles.
    """
    starts = cycle_starts(x)
    first = math.ceil((1 - share) * len(starts) - 1e-9)
    if not 0 < first < len(starts):
        raise DataError(
            f"{len(starts)} cycle(s) were found; the last {100 * share:g} % of them cannot be held "
            "out, because at least one cycle must be held out and one must remain for training",
            "hold out a share of the samples instead, for example `last: 0.5`",
        )
    return np.asarray(np.arange(len(x)) >= starts[first])
