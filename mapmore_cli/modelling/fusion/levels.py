"""Interpolation between the curves of neighbouring levels.

Two ways, both exact at the levels and both reproducing constants and straight lines across levels:

- `linear`: triangles (M1 figure 2), a partition of unity;
- `pchip`: the cubic Hermite interpolant of the curves' values with slopes that keep its shape (Fritsch and Butland 1984), once
  continuously differentiable across levels. Its weights depend on the values, but they sum to one: adding a constant to all curves adds
  it to the result. Smooth weights that do not depend on the values, as `3t^2 - 2t^3`, would make a flat step at every level, since
  with two neighbours alone they cannot reproduce a line.
"""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray


def level_position(x: Array, levels: Array, below: str = "continue", above: str = "continue") -> tuple[IntArray, Array]:
    """Number of the level to the left, and the place t between it and the next, (n,) each; two levels at least.

    t stays within [0, 1], but for sides with `continue_linear`.
    """
    left = np.clip(np.searchsorted(levels, x, side="right") - 1, 0, len(levels) - 2)
    t = (x - levels[left]) / (levels[left + 1] - levels[left])
    if below != "continue_linear":
        t = np.maximum(t, 0.0)
    if above != "continue_linear":
        t = np.minimum(t, 1.0)
    return left, t


def level_weights(x: Array, levels: Array, below: str = "continue", above: str = "continue") -> Array:
    """Weight of every curve at the level values x, (n, L): triangles between neighbouring levels (M1 figure 2).

    Beyond the outermost level, `continue` and `saturate` hold its curve, `continue_linear` goes on with the slope of the last triangle
    (rows still sum to one), and `zero` lets the weight drop to zero (M2 figure 7d).
    """
    if len(levels) == 1:
        return np.ones((len(x), 1))
    left, t = level_position(x, levels, below, above)
    weights = np.zeros((len(x), len(levels)))
    rows = np.arange(len(x))
    weights[rows, left] = 1 - t
    weights[rows, left + 1] = t
    weights[_beyond(x, levels, below, above)] = 0.0
    return weights


def _beyond(x: Array, levels: Array, below: str, above: str) -> BoolArray:
    """Rows at which the outermost weight has stepped to zero."""
    dropped: BoolArray = ((x < levels[0]) & (below == "zero")) | ((x > levels[-1]) & (above == "zero"))
    return dropped


def carried_share(t: Array, shrink: float) -> Array:
    """Share `g + (1 - g)(1 - 2t)^2` of a residual that is carried to the place t between two levels, (n,).

    All of it at the levels, g = `shrink` of it in the middle.
    """
    return shrink + (1 - shrink) * (1 - 2 * t) ** 2
