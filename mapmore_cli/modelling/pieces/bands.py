"""Bands of the level quantity: at a level, between two, or beyond the outermost; and curves aligned at their thresholds there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mapmore_cli.domain.arrays import Array, Value
from mapmore_cli.domain.models import Fusion, Side
from mapmore_cli.modelling.pieces.weights import carried_share
from mapmore_cli.modelling.signals.rates import running_median

FLAT, LOW = 0.25, 0.2
"""A foot is less steep than this share of the flank, and rises by less than this share of the curve's span."""

WINDOW = 0.05
"""Of the curve's range: what the threshold is looked for on is smoothed that much."""


def threshold(x: Array, y: Array) -> float:
    """The corner between the foot of a curve and its flank; samples in any order, (n,).

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
    """Sum of squared errors and slopes of two lines that meet at x = 0."""
    P = np.column_stack([np.ones(len(x)), np.minimum(x, 0.0), np.maximum(x, 0.0)])
    parameters = np.linalg.lstsq(P, y, rcond=None)[0]
    return float(np.sum((P @ parameters - y) ** 2)), float(parameters[1]), float(parameters[2])


def aligned(x: Array, marks: Array, own: Array) -> Array:
    """The places on one curve that correspond to x: its low end, threshold and high end answer to those at x, linear between, (n,).

    So each curve is looked up within its own range as long as x is within the range interpolated for it.

    Parameters
    ----------
    marks
        Low end, threshold and high end interpolated between the levels, (3, n).
    own
        Those of the curve, (3,).
    """
    low, middle, high = marks
    left = _ratio(own[1] - own[0], middle - low)
    right = _ratio(own[2] - own[1], high - middle)
    place: Array = own[1] + (x - middle) * np.where(x < middle, left, right)
    return place


def _ratio(own: float, between: Array) -> Array:
    return np.divide(own, between, out=np.ones(len(between)), where=between > 0)


Mix = Callable[[Array, Sequence[Value]], Value]
"""From level values (n,) within the band and the values of its curves to the interpolated value, (n,) or one for all."""


@dataclass(frozen=True)
class Band:
    """Where the same curves count.

    Attributes
    ----------
    curves
        Their numbers, ascending; none where the outermost weight has stepped to zero.
    between, levels
        Numbers and values of the levels to the left and to the right; the same one twice at a level and beyond the outermost.
    mix
        The interpolation.
    """

    curves: tuple[int, ...]
    between: tuple[int, int]
    levels: tuple[float, float]
    mix: Mix

    def position(self, x: Array) -> Array:
        """The place between the two levels, from 0 to 1, (n,)."""
        low, high = self.levels
        return (x - low) / (high - low) if high > low else np.zeros(len(x))


def bands(levels: Array, sides: tuple[Side, Side], fusion: Fusion) -> tuple[Array, tuple[Band, ...]]:
    """Edges, (2L,) ascending, and the bands that they part, 2L + 1: number i holds where i edges are at or below the level value.

    Beyond the outermost level, `continue` and `saturate` hold its curve, `continue_linear` goes on with the slope at that level, and `zero`
    lets the weight drop to zero (M2 figure 7d).
    """
    last = len(levels) - 1
    edges = np.stack([levels, np.nextafter(levels, np.inf)], axis=1).ravel()
    inner = [band for i in range(last) for band in (alone(i, levels[i]), _inner(levels, i, fusion))]
    below, above = _outer(levels, 0, sides[0], fusion), _outer(levels, last, sides[1], fusion)
    return edges, (below, *inner, alone(last, levels[last]), above)


def alone(number: int, level: float) -> Band:
    """Where one curve counts, as it is."""
    return Band((number,), (number, number), (level, level), lambda _x, values: values[0])


def _outer(levels: Array, end: int, side: Side, fusion: Fusion) -> Band:
    if side == "zero":
        return Band((), (end, end), (levels[end], levels[end]), lambda _x, _values: np.float64(0.0))
    if side != "continue_linear" or len(levels) == 1:
        return alone(end, levels[end])
    first, second = (0, 1) if end == 0 else (end - 1, end)
    curves = _counting(levels, first, second, fusion.levels)

    def straight(x: Array, values: Sequence[Value]) -> Value:
        slope = _slope(levels[list(curves)], values, curves.index(end), fusion.levels)
        y: Value = values[curves.index(end)] + slope * (x - levels[end])
        return y

    return Band(curves, (end, end), (levels[end], levels[end]), straight)


def _inner(levels: Array, left: int, fusion: Fusion) -> Band:
    curves = _counting(levels, left, left + 1, fusion.levels)
    own, place = levels[list(curves)], curves.index(left)
    low, width = float(levels[left]), float(levels[left + 1] - levels[left])

    def mix(x: Array, values: Sequence[Value]) -> Value:
        t = (x - low) / width
        if fusion.levels == "linear":
            y: Value = (1 - t) * values[0] + t * values[1]
        else:
            slopes = (_slope(own, values, place, fusion.levels) * width, _slope(own, values, place + 1, fusion.levels) * width)
            y = _hermite(t, values[place], values[place + 1], *slopes)
        return y if fusion.shrink == 1.0 else y * carried_share(t, fusion.shrink)

    return Band(curves, (left, left + 1), (low, float(levels[left + 1])), mix)


def _counting(levels: Array, left: int, right: int, scheme: str) -> tuple[int, ...]:
    """The curves that the interpolant between two levels depends on: with `pchip`, those that its slopes there depend on."""
    reach = 0 if scheme == "linear" else 1
    return tuple(range(max(left - reach, 0), min(right + reach, len(levels) - 1) + 1))


def _hermite(t: Array, left: Value, right: Value, slope_left: Value, slope_right: Value) -> Value:
    """Cubic Hermite interpolant on [0, 1]."""
    return left * (1 + 2 * t) * (1 - t) ** 2 + slope_left * t * (1 - t) ** 2 + right * t**2 * (3 - 2 * t) - slope_right * t**2 * (1 - t)


def _slope(levels: Array, values: Sequence[Value], number: int, scheme: str) -> Value:
    """Slope across levels of the interpolant at one of them.

    Of `pchip` inside, the weighted harmonic mean of the neighbouring differences, or zero where they differ in sign; at the ends,
    three-point differences held back so that the outermost interval stays monotone (Fritsch and Butland 1984).
    """
    h = np.diff(levels)
    delta: list[Value] = [(after - before) / width for (before, after), width in zip(pairwise(values), h, strict=True)]
    if scheme == "linear" or len(h) == 1:
        return delta[min(number, len(h) - 1)]
    if number == 0:
        return _end_slope(h[0], h[1], delta[0], delta[1])
    if number == len(h):
        return _end_slope(h[-1], h[-2], delta[-1], delta[-2])
    before, after, h_before, h_after = delta[number - 1], delta[number], h[number - 1], h[number]
    w_before, w_after = h_before + 2 * h_after, 2 * h_before + h_after
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(np.sign(before) * np.sign(after) > 0, before / (w_after * before + w_before * after), 0.0)
    slope: Value = (w_before + w_after) * share * after
    return slope


def _end_slope(h: float, h_next: float, delta: Value, delta_next: Value) -> Value:
    slope: Value = ((2 * h + h_next) * delta - h * delta_next) / (h + h_next)
    slope = np.where(np.sign(slope) == np.sign(delta), slope, 0.0)
    turning = (np.sign(delta) != np.sign(delta_next)) & (np.abs(slope) > 3 * np.abs(delta))
    held: Value = np.where(turning, 3 * delta, slope)
    return held
