"""The curves of a model between and beyond their levels, as statements (M1 figure 2, M2 figure 7); a part of `definition`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import pairwise

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.models import Fusion, Side
from mapmore_cli.modelling.expressions import Expression, Name, Number, call
from mapmore_cli.modelling.expressions.syntax import ZERO, Condition
from mapmore_cli.modelling.program.writing import Writer
from mapmore_cli.modelling.signals.rates import running_median

CurveAt = Callable[[int, int, int, Expression], Expression]
"""Writes a curve, given the numbers of the two levels that are joined, its own number, and the place t between the levels."""


def across_levels(
    m: Writer, level: Expression, levels: Sequence[float], sides: tuple[Side, Side], fusion: Fusion, curve_at: CurveAt
) -> Expression:
    """Write the curves between their levels and beyond the outermost.

    Between levels i and i + 1, at the place t between them: with `linear` triangles, `(1 - t) f_i + t f_{i+1}` (M1 figure 2); with `pchip`
    the cubic Hermite interpolant of slopes that keep the shape of the curves' values (Fritsch and Butland 1984). A share
    `g + (1 - g)(1 - 2t)^2` of it is carried, g = `shrink`. At a level its own curve counts alone: another may have no value there.

    Beyond the outermost level, `continue` and `saturate` hold its curve, `continue_linear` goes on with the slope at that level, and `zero`
    lets the weight drop to zero (M2 figure 7d). `curve_at` writes a curve, given the numbers of two levels, of the curve, and t.
    """
    last = len(levels) - 1

    def alone(i: int) -> Expression:
        return curve_at(i, i, i, ZERO)

    def counting(i: int) -> range:  # between levels i and i + 1: with `pchip`, slopes there depend on the curves beside them
        reach = 0 if fusion.levels == "linear" else 1
        return range(max(i - reach, 0), min(i + 1 + reach, last) + 1)

    def between(i: int) -> Expression:
        width = levels[i + 1] - levels[i]
        t = m.let("t", (level - levels[i]) / width)
        f = {number: curve_at(i, i + 1, number, t) for number in counting(i)}
        if fusion.levels == "linear":
            y = (1 - t) * f[i] + t * f[i + 1]
        else:
            left, right = (m.let("slope", _slope(m, levels, f, number) * width) for number in (i, i + 1))
            rest = m.let("rest", 1 - t)
            y = f[i] * (1 + 2 * t) * rest**2 + left * t * rest**2 + f[i + 1] * t**2 * (3 - 2 * t) - right * t**2 * rest
        if fusion.shrink == 1.0:
            return y
        return m.let("between", y) * (fusion.shrink + (1 - fusion.shrink) * (1 - 2 * t) ** 2)

    def straight(end: int) -> Expression:
        f = {number: curve_at(end, end, number, ZERO) for number in counting(min(end, last - 1))}
        return f[end] + _slope(m, levels, f, end) * (level - levels[end])

    def beyond(end: int, side: Side) -> Callable[[], Expression]:
        if side == "zero":
            return lambda: ZERO
        return partial(straight if side == "continue_linear" and last > 0 else alone, end)

    below, above = beyond(0, sides[0]), beyond(last, sides[1])
    if last == 0:
        return m.choose("across", [(level < levels[0], below), (level > levels[0], above)], partial(alone, 0))
    cases: list[tuple[Condition, Callable[[], Expression]]] = [(level < levels[0], below)]
    cases += [(Condition(level, "==", Number(at)), partial(alone, i)) for i, at in enumerate(levels)]
    for i in range(last):
        within = level < levels[i + 1] if i + 1 < last else level <= levels[last]
        cases.append((within, partial(between, i)))
    return m.choose("across", cases, above)


def _slope(m: Writer, levels: Sequence[float], f: Mapping[int, Expression], number: int) -> Expression:
    """Write the slope across levels at one of them, from the values of the curves that count.

    With two of them it is that of the line. Else, inside, the weighted harmonic mean of the neighbouring differences, or zero where they
    differ in sign; at the ends, three-point differences held back so that the outermost interval stays monotone.
    """
    h = [levels[j] - levels[i] for i, j in pairwise(f)]
    delta = [m.let("delta", (f[j] - f[i]) / width) for (i, j), width in zip(pairwise(f), h, strict=True)]
    at = number - min(f)
    if len(h) == 1:
        return delta[0]
    if at == 0:
        return m.use("slope", _end_slope(m), [delta[0], delta[1], h[0], h[1]])
    if at == len(h):
        return m.use("slope", _end_slope(m), [delta[-1], delta[-2], h[-1], h[-2]])
    return m.use("slope", _inner_slope(m), [delta[at - 1], delta[at], h[at - 1], h[at]])


def _inner_slope(m: Writer) -> str:
    names = ["before", "after", "h_before", "h_after"]
    before, after, h_before, h_after = map(Name, names)

    def mean() -> Expression:
        w_before, w_after = m.let("w_before", h_before + 2 * h_after), m.let("w_after", 2 * h_before + h_after)
        return (w_before + w_after) * (before / (w_after * before + w_before * after)) * after

    value = lambda: m.where(_sign(before) * _sign(after) > 0.0, mean, 0.0)  # noqa: E731 - short
    return m.function("slope_inside", names, value, "slope at an inner level, which keeps the shape")


def _end_slope(m: Writer) -> str:
    names = ["delta", "delta_next", "h", "h_next"]
    delta, delta_next, h, h_next = map(Name, names)

    def held_back() -> Expression:
        three = m.let("three", ((2 * h + h_next) * delta - h * delta_next) / (h + h_next))
        kept = m.where(_sign(three) * _sign(delta) > 0.0, three, 0.0)
        steepest = 3 * delta
        held = m.where(call("abs", kept) > call("abs", steepest), steepest, kept)
        return m.where(_sign(delta) * _sign(delta_next) > 0.0, kept, held)

    return m.function("slope_at_end", names, held_back, "slope at an outermost level, which keeps the shape")


def _sign(x: Expression) -> Expression:
    return call("sign", x)


Marks = tuple[float, float, float]
"""Low end, threshold and high end of a curve."""


def aligned(m: Writer, x: Expression, t: Expression, left: Marks, right: Marks, own: Marks) -> Expression:
    """Write the place on one curve that corresponds to x: low end, threshold and high end answer to those at x, linear between.

    So each curve is looked up within its own range as long as x is within the range interpolated for it. `left`, `right` and `own` are
    those marks of the two curves, at the place t between them, and of the curve itself.
    """
    low, middle, high = (m.let("mark", (1 - t) * a + t * b if a != b else a) for a, b in zip(left, right, strict=True))
    way = m.let("way", x - middle)

    def along(width: float, between: Expression) -> Expression:
        wide = m.let("wide", between)
        return own[1] + way * m.where(wide > 0.0, lambda: width / wide, 1.0)

    return m.where(x < middle, partial(along, own[1] - own[0], middle - low), partial(along, own[2] - own[1], high - middle))


FLAT, LOW = 0.25, 0.2  # a foot is less steep than this share of the flank, and rises by less than this share of the curve's span
WINDOW = 0.05  # of the curve's range: what the threshold is looked for on is smoothed that much


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
