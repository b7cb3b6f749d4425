"""Weights of the segments along one variable: a partition of unity (M1 eq 5-6, M2 eq 9-11)."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from mapmore_cli.domain.arrays import Array, Value

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
