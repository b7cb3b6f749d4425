"""Where to cut: boundaries at changes of slope, and boundaries whose segment fits leave the least."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.modelling.pieces.recipe import Cuts
from mapmore_cli.modelling.signals.rates import STEPS, running_median

DEFAULT_WINDOW = 0.1
"""Of the curve's range."""

ROUNDING = 1e-9
"""Of the separation: two grid points exactly so far apart are far enough, whatever the unit."""

FEWEST_SAMPLES = 5
"""In a segment: where a curve has a gap its course is made up, and a bend there must not become a segment of its own."""


def gradient_boundaries(x: Array, y: Array, cut: Cuts) -> Array:
    """Return the `count - 1` inner boundaries at the largest peaks of |change of slope|, ascending.

    No boundary lies nearer than the separation to another one or to an end of the range, or leaves a segment with hardly any sample;
    there are fewer where the curve has fewer such peaks.

    - `x`, `y`: samples in any order, (n,).
    """
    low, high = float(x.min()), float(x.max())
    window = min(cut.window or DEFAULT_WINDOW * (high - low), high - low)
    separation = (cut.separation or window) * (1 - ROUNDING)
    at, change = slope_change(x, y, window)
    inner = (at >= low + separation) & (at <= high - separation)
    peaks = _peaks(np.where(inner, np.abs(change), 0.0))
    chosen: list[float] = []
    for peak in at[peaks]:
        if len(chosen) == cut.segments - 1:
            break
        if all(abs(peak - other) >= separation for other in chosen) and _filled(x, [*chosen, float(peak)]):
            chosen.append(float(peak))
    return np.sort(np.array(chosen))


def _filled(x: Array, boundaries: list[float]) -> bool:
    """Return True where every segment holds samples enough."""
    places = np.searchsorted(np.sort(np.array(boundaries)), x)
    return int(np.bincount(places, minlength=len(boundaries) + 1).min()) >= FEWEST_SAMPLES


def slope_change(x: Array, y: Array, window: float) -> tuple[Array, Array]:
    """Slope over the window to the right of a place less the slope over the window to its left: `(place, change)`, (m,) each.

    Slopes join moving averages over windows around a place and its neighbours one window away. Near the ends windows are cut off, and
    averages of x and y over what is left keep a straight line straight.
    """
    at, smooth = running_median(x, y, window)
    mean_x, mean_y = _moving_average(at), _moving_average(smooth)
    here = np.arange(len(at))
    before, after = np.maximum(here - STEPS, 0), np.minimum(here + STEPS, len(at) - 1)
    left = _slope(mean_x, mean_y, before, here)
    right = _slope(mean_x, mean_y, here, after)
    return at, np.nan_to_num(right - left)


def _moving_average(values: Array) -> Array:
    reach = STEPS // 2
    total = np.concatenate([[0.0], np.cumsum(values)])
    place = np.arange(len(values))
    first, last = np.maximum(place - reach, 0), np.minimum(place + reach + 1, len(values))
    mean: Array = (total[last] - total[first]) / (last - first)
    return mean


def _slope(x: Array, y: Array, first: IntArray, last: IntArray) -> Array:
    """Slope between two places; NaN at an end of the curve, where they are the same."""
    width = x[last] - x[first]
    slope: Array = np.divide(y[last] - y[first], width, out=np.full(len(width), np.nan), where=width > 0)
    return slope


def _peaks(height: Array) -> IntArray:
    """Places of the local maxima, the highest first; the first place of a plateau."""
    padded = np.concatenate([[0.0], height, [0.0]])
    places = np.flatnonzero((height > padded[:-2]) & (height >= padded[2:]))
    return places[np.argsort(-height[places], kind="stable")]


TIE_TOLERANCE = 1e-9
"""Of the largest cost: partitions nearer to each other than this tie, and the first wins, so that rounding decides nothing."""


def optimal_partition(cost: Callable[[int, int], float], cells: int, count: int) -> tuple[int, ...] | None:
    """Inner boundaries that cut cells 0..cells-1 into `count` intervals of least summed cost; None where every partition costs infinity.

    With `best_k(j)` the least cost of the first j cells in k intervals, `best_k(j) = min_i best_{k-1}(i) + cost(i, j)` (Bellman 1961):
    at most `cells (cells + 1) / 2` costs are asked for instead of one for every partition.

    - `cost`: of the interval of cells i..j-1; infinity forbids it.
    """
    table = np.full((cells + 1, cells + 1), np.inf)
    for i in range(cells):
        for j in range(i + 1, cells + 1):
            table[i, j] = cost(i, j)
    finite = table[np.isfinite(table)]
    tie = TIE_TOLERANCE * float(finite.max()) if len(finite) else 0.0
    best, came_from = table[0], []
    for _ in range(count - 1):
        sums = best[:, None] + table
        least = sums.min(axis=0)
        came_from.append(np.argmax(sums <= least + tie, axis=0))
        best = least
    if not np.isfinite(best[cells]):
        return None
    places, end = [], cells
    for previous in reversed(came_from):
        end = int(previous[end])
        places.append(end)
    return tuple(reversed(places))
