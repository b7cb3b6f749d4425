"""Weights of the segments along one variable, of the curves across levels, and what a variable does beyond its limits.

Weights along a variable are a partition of unity (M1 eq 5-6, M2 eq 9-11). Between the curves of neighbouring levels there are two ways,
both exact at the levels and both reproducing constants and straight lines across levels:

- `linear`: triangles (M1 figure 2), a partition of unity;
- `pchip`: the cubic Hermite interpolant of the curves' values with slopes that keep its shape (Fritsch and Butland 1984), once
  continuously differentiable across levels. Its weights depend on the values, but they sum to one. Smooth weights that do not depend
  on the values, as `3t^2 - 2t^3`, would make a flat step at every level: with two neighbours alone they cannot reproduce a line.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray, Value
from mapmore_cli.domain.models import Side

TRANSITIONS: Mapping[str, Callable[[Value], Value]] = {
    "linear": lambda t: t,
    "quadratic": lambda t: np.where(t < 0.5, 2 * t**2, 1 - 2 * (1 - t) ** 2),
    "cubic": lambda t: 3 * t**2 - 2 * t**3,
}
"""`s(t)` for t in [0, 1]; each satisfies `s(t) + s(1 - t) = 1` (M2 figure 5)."""


def zones(boundaries: Array, z_s: float) -> tuple[Array, Array]:
    """Start and end of the transition zone at each inner boundary, (count - 1,) each (M2 eq 10 and 11).

    `seg_i - z_s (seg_i - seg_{i-1})` to `seg_i + z_s (seg_{i+1} - seg_i)`, shared by the falling weight of the left segment and the
    rising weight of the right one.
    """
    widths = np.diff(boundaries)
    inner = boundaries[1:-1]
    return inner - z_s * widths[:-1], inner + z_s * widths[1:]


def cell_weights(x: Array, boundaries: Array, transition: str, z_s: float) -> Array:
    """Weight of every segment along one variable, (n, count); each row sums to one.

    With `rise_i` the rising weight at inner boundary i, segment i has `rise_i - rise_{i+1}`: the sum telescopes. `z_s = 0` is a step, at
    which the boundary itself belongs to the left segment.
    """
    start, end = zones(boundaries, z_s)
    rise = np.ones((len(x), len(boundaries)))
    rise[:, -1] = 0.0
    for i, (low, high) in enumerate(zip(start, end, strict=True), start=1):
        if high > low:
            rise[:, i] = TRANSITIONS[transition]((np.clip(x, low, high) - low) / (high - low))
        else:
            rise[:, i] = x > low
    return rise[:, :-1] - rise[:, 1:]


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


def clamped(x: Array, limits: tuple[float, float], sides: tuple[Side, Side]) -> Array:
    """The extrapolation function E (M2 eq 12), (n,)."""
    inside = x
    for side, limit, beyond in zip(sides, limits, (x < limits[0], x > limits[1]), strict=True):
        if side != "continue":
            inside = np.where(beyond, held_at(side, limit), inside)
    return inside


def held_at(side: Side, limit: float) -> float:
    """Where a variable is held beyond a limit: there, or at the value that the side gives."""
    return side if isinstance(side, float) else limit
