"""Find the threshold of a curve: the corner between its foot and its flank."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.signals.rates import running_median

FLAT, LOW = 0.25, 0.2
"""A foot is less steep than this share of the flank, and rises by less than this share of the curve's span."""

WINDOW = 0.05
"""Of the curve's range: what the threshold is looked for on is smoothed that much."""


def threshold(x: Array, y: Array) -> float:
    """Return the corner between the foot of a curve and its flank; samples in any order, (n,).

    Of all pairs of straight lines that meet at a point of the smoothed curve, the pair with the least sum of squared errors has its
    corner there. A curve without a foot has its threshold at the lower of its ends: on the left for a force that grows with pressure, on
    the right for one that falls with strain. (A share of the span would not do: the foot of a measured muscle creeps by a tenth of it.)
    """
    low, high = float(x.min()), float(x.max())
    if low == high:
        return low
    at, smooth = running_median(x, y, WINDOW * (high - low))
    corners = at[1:-1]
    fits = [_two_lines(at - corner, smooth) for corner in corners]
    best = int(np.argmin([sse for sse, _, _ in fits]))
    _, left, right = fits[best]
    corner = float(corners[best])
    foot, flank, end = (left, right, low) if smooth[0] <= smooth[-1] else (right, left, high)
    rise = abs(foot * (corner - end))
    return corner if abs(foot) < FLAT * abs(flank) and rise < LOW * float(np.ptp(smooth)) else end


def _two_lines(x: Array, y: Array) -> tuple[float, float, float]:
    """Return the sum of squared errors and slopes of two lines that meet at x = 0."""
    P = np.column_stack([np.ones(len(x)), np.minimum(x, 0.0), np.maximum(x, 0.0)])
    parameters = np.linalg.lstsq(P, y, rcond=None)[0]
    return float(np.sum((P @ parameters - y) ** 2)), float(parameters[1]), float(parameters[2])
