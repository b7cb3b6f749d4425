"""Boundaries whose segment fits leave the least, by dynamic programming."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

TIE_TOLERANCE = 1e-9
"""Of the largest cost: partitions nearer to each other than this tie, and the first wins, so that rounding decides nothing."""


def optimal_partition(cost: Callable[[int, int], float], cells: int, count: int) -> tuple[int, ...] | None:
    """Inner boundaries that cut cells 0..cells-1 into `count` intervals of least summed cost; None where every partition costs infinity.

    With `best_k(j)` the least cost of the first j cells in k intervals, `best_k(j) = min_i best_{k-1}(i) + cost(i, j)` (Bellman 1961):
    at most `cells (cells + 1) / 2` costs are asked for instead of one for every partition.

    Parameters
    ----------
    cost
        Of the interval of cells i..j-1; infinity forbids it.
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
