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


def shape_preserving(x: Array, levels: Array, values: Array, below: str = "continue", above: str = "continue") -> Array:
    """Cubic Hermite interpolation of `values` (n, L) at the level values x, (n,), with the slopes of `shape_preserving_slopes`.

    Beyond the outermost level as `level_weights`, `continue_linear` with the slope at that level.
    """
    if len(levels) == 1:
        return values[:, 0]
    left, t = level_position(x, levels, below, above)
    beyond = t - np.clip(t, 0.0, 1.0)
    t = t - beyond
    rows = np.arange(len(x))
    width = levels[left + 1] - levels[left]
    slopes = shape_preserving_slopes(levels, values)
    slope_left, slope_right = slopes[rows, left] * width, slopes[rows, left + 1] * width
    y = (
        values[rows, left] * (1 + 2 * t) * (1 - t) ** 2
        + slope_left * t * (1 - t) ** 2
        + values[rows, left + 1] * t**2 * (3 - 2 * t)
        - slope_right * t**2 * (1 - t)
    )
    y += beyond * np.where(beyond < 0, slope_left, slope_right)
    y[_beyond(x, levels, below, above)] = 0.0
    return y


def shape_preserving_slopes(levels: Array, values: Array) -> Array:
    """Slope of the interpolant at every level, (n, L), for values (n, L).

    Inside, the weighted harmonic mean of the neighbouring differences, or zero where they differ in sign; at the ends, three-point
    differences held back so that the outermost interval stays monotone (Fritsch and Butland 1984).
    """
    h = np.diff(levels)
    delta = np.diff(values, axis=1) / h
    if len(h) == 1:
        return np.repeat(delta, 2, axis=1)
    slopes = np.zeros(values.shape)
    before, after = delta[:, :-1], delta[:, 1:]
    w_before, w_after = h[:-1] + 2 * h[1:], 2 * h[:-1] + h[1:]
    same = np.sign(before) * np.sign(after) > 0
    share = np.divide(before, w_after * before + w_before * after, out=np.zeros(before.shape), where=same)
    slopes[:, 1:-1] = (w_before + w_after) * share * after
    slopes[:, 0] = _end_slope(h[0], h[1], delta[:, 0], delta[:, 1])
    slopes[:, -1] = _end_slope(h[-1], h[-2], delta[:, -1], delta[:, -2])
    return slopes


def _end_slope(h: float, h_next: float, delta: Array, delta_next: Array) -> Array:
    slope = ((2 * h + h_next) * delta - h * delta_next) / (h + h_next)
    slope = np.where(np.sign(slope) == np.sign(delta), slope, 0.0)
    turning = (np.sign(delta) != np.sign(delta_next)) & (np.abs(slope) > 3 * np.abs(delta))
    return np.where(turning, 3 * delta, slope)


def carried_share(x: Array, levels: Array, shrink: float) -> Array:
    """Share `g + (1 - g)(1 - 2t)^2` of a residual that is carried to the place t between two levels, (n,).

    All of it at the levels and beyond the outermost, g = `shrink` of it in the middle.
    """
    if len(levels) == 1 or shrink == 1.0:
        return np.ones(len(x))
    _, t = level_position(x, levels)
    return shrink + (1 - shrink) * (1 - 2 * t) ** 2


def _beyond(x: Array, levels: Array, below: str, above: str) -> BoolArray:
    """Rows at which the outermost weight has stepped to zero."""
    dropped: BoolArray = ((x < levels[0]) & (below == "zero")) | ((x > levels[-1]) & (above == "zero"))
    return dropped
