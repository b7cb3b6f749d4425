"""A curve freed from noise and local spikes."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array

STEPS = 10
"""Points within one window."""


def running_median(x: Array, y: Array, window: float) -> tuple[Array, Array]:
    """Medians of x and of y over half a window around each point of an even grid over the range of x, (m,) each.

    For samples on a straight line the medians lie on it, and a spike narrower than a quarter of the window is not seen. Where no sample is
    near, the line between the neighbours stands.

    Parameters
    ----------
    x, y
        Samples in any order, (n,).
    window
        In the unit of x.
    """
    order = np.lexsort((y, x))
    x, y = x[order], y[order]
    grid = np.linspace(x[0], x[-1], max(1, round(STEPS * float(x[-1] - x[0]) / window)) + 1)
    reach = window / 4 * (1 + 1e-9)  # a sample right on the rim counts, whatever the unit
    first, last = np.searchsorted(x, grid - reach, "left"), np.searchsorted(x, grid + reach, "right")
    medians = np.full((2, len(grid)), np.nan)
    for place in np.flatnonzero(last > first):
        near = slice(first[place], last[place])
        medians[:, place] = np.median(x[near]), np.median(y[near])
    known = last > first
    return np.interp(grid, grid[known], medians[0, known]), np.interp(grid, grid[known], medians[1, known])
