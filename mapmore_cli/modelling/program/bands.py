"""The curves of a model between and beyond their levels, as `pieces.bands` interpolates them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.models import Fusion, Side
from mapmore_cli.modelling.program.statements import Block, Function
from mapmore_cli.modelling.program.writing import Lines, Names, block_of, less, times, total
from mapmore_cli.modelling.terms import Expression, Name, Number, add, call, power
from mapmore_cli.modelling.terms.syntax import Condition

CurveAt = Callable[[Lines, int, tuple[int, int], Expression], Expression]
"""Writes the value of a curve down, given its number, the numbers of the levels to both sides, and the place t between them."""

INNER, OUTER = "slope_inside", "slope_at_end"
"""Functions of the slopes that keep the shape."""


def slope_functions() -> tuple[Function, Function]:
    """Slopes across levels of the interpolant `pchip` (Fritsch and Butland 1984): at an inner level, and at an outermost one."""
    return _inner_slope(Lines(Names())), _end_slope(Lines(Names()))


def _inner_slope(lines: Lines) -> Function:
    before, after, h_before, h_after = (Name(name) for name in ("before", "after", "h_before", "h_after"))
    same = Lines(lines.names)
    w_before = same.let("w_before", add(h_before, times(Number(2.0), h_after)))
    w_after = same.let("w_after", add(times(Number(2.0), h_before), h_after))
    mixed = same.let("mixed", total([times(w_after, before), times(w_before, after)]))
    share = same.let("share", times(before, power(mixed, -1)))
    both = same.block(times(same.let("w", add(w_before, w_after)), share, after))
    value = lines.choose("slope", [(Condition(_signs(before, after), ">", Number(0.0)), both)], Number(0.0))
    return Function(INNER, ("before", "after", "h_before", "h_after"), lines.block(value), "slope at an inner level, which keeps the shape")


def _end_slope(lines: Lines) -> Function:
    delta, delta_next, h, h_next = (Name(name) for name in ("delta", "delta_next", "h", "h_next"))
    first = lines.let("first", add(times(Number(2.0), h), h_next))
    lean = lines.let("lean", less(times(first, delta), times(h, delta_next)))
    three = lines.let("three", times(lean, power(lines.let("both", add(h, h_next)), -1)))
    kept = lines.choose("kept", [(Condition(_sign(three), "==", _sign(delta)), three)], Number(0.0))
    size, limit = lines.let("size", _abs(kept)), lines.let("limit", times(Number(3.0), _abs(delta)))
    turned = Lines(lines.names)
    held = turned.choose("held", [(Condition(size, ">", limit), times(Number(3.0), delta))], kept)
    same = Condition(_sign(delta), "==", _sign(delta_next))
    value = lines.choose("slope", [(same, kept)], turned.block(held))
    return Function(OUTER, ("delta", "delta_next", "h", "h_next"), lines.block(value), "slope at an outermost level, which keeps the shape")


def _sign(x: Expression) -> Expression:
    return call("sign", x)


def _abs(x: Expression) -> Expression:
    return call("abs", x)


def _signs(left: Expression, right: Expression) -> Expression:
    return times(_sign(left), _sign(right))


def across_levels(
    lines: Lines, level: Expression, levels: Array, sides: tuple[Side, Side], fusion: Fusion, curve_at: CurveAt
) -> Expression:
    """The interpolated value.

    At a level the bands to both sides agree, since each is exact there; the band to its right is taken, and to the left of the last.
    """
    last = len(levels) - 1
    below, above = (_beyond(lines, level, levels, end, side, fusion, curve_at) for end, side in ((0, sides[0]), (last, sides[1])))
    if last == 0:
        return lines.choose("across", _outer_cases(level, levels, below, above), _alone(lines, 0, curve_at))
    inner = [_between(lines, level, levels, i, fusion, curve_at) for i in range(last)]
    cases = [(Condition(level, "<", Number(float(levels[0]))), below)]
    cases += [(Condition(level, "<", Number(float(levels[i + 1]))), block) for i, block in enumerate(inner[:-1])]
    cases += [(Condition(level, "<=", Number(float(levels[last]))), inner[-1])]
    return lines.choose("across", cases, above)


def _outer_cases(level: Expression, levels: Array, below: Block, above: Block) -> list[tuple[Condition, Block]]:
    return [(Condition(level, "<", Number(float(levels[0]))), below), (Condition(level, ">", Number(float(levels[0]))), above)]


def _alone(lines: Lines, number: int, curve_at: CurveAt) -> Block:
    own = Lines(lines.names)
    return own.block(curve_at(own, number, (number, number), Number(0.0)))


def _beyond(lines: Lines, level: Expression, levels: Array, end: int, side: Side, fusion: Fusion, curve_at: CurveAt) -> Block:
    if side == "zero":
        return block_of(Number(0.0))
    if side != "continue_linear" or len(levels) == 1:
        return _alone(lines, end, curve_at)
    first, second = (0, 1) if end == 0 else (end - 1, end)
    own = Lines(lines.names)
    curves = _counting(levels, first, second, fusion.levels)
    values = [curve_at(own, number, (end, end), Number(0.0)) for number in curves]
    slope = _slope(own, levels[list(curves)], values, curves.index(end), fusion.levels)
    way = own.let("way", less(level, Number(float(levels[end]))))
    return own.block(total([values[curves.index(end)], times(slope, way)]))


def _between(lines: Lines, level: Expression, levels: Array, left: int, fusion: Fusion, curve_at: CurveAt) -> Block:
    own = Lines(lines.names)
    low, width = float(levels[left]), float(levels[left + 1] - levels[left])
    t = own.let("t", times(less(level, Number(low)), power(Number(width), -1)))
    curves = _counting(levels, left, left + 1, fusion.levels)
    values = [curve_at(own, number, (left, left + 1), t) for number in curves]
    place, rest = curves.index(left), own.let("rest", less(Number(1.0), t))
    if fusion.levels == "linear":
        y = own.let("mixed", total([times(rest, values[0]), times(t, values[1])]))
    else:
        ends = levels[list(curves)]
        slopes = [own.let("slope", times(_slope(own, ends, values, at, fusion.levels), Number(width))) for at in (place, place + 1)]
        y = _hermite(own, t, rest, values[place], values[place + 1], *slopes)
    if fusion.shrink != 1.0:
        middle = own.let("middle", less(Number(1.0), times(Number(2.0), t)))
        share = own.let("share", total([Number(fusion.shrink), times(Number(1 - fusion.shrink), power(middle, 2))]))
        y = own.let("carried", times(y, share))
    return own.block(y)


def _counting(levels: Array, left: int, right: int, scheme: str) -> tuple[int, ...]:
    """The curves that the interpolant between two levels depends on."""
    reach = 0 if scheme == "linear" else 1
    return tuple(range(max(left - reach, 0), min(right + reach, len(levels) - 1) + 1))


def _hermite(
    lines: Lines, t: Expression, rest: Expression, left: Expression, right: Expression, slope_left: Expression, slope_right: Expression
) -> Expression:
    """Cubic Hermite interpolant on [0, 1]."""
    one = lines.let("one", add(Number(1.0), times(Number(2.0), t)))
    three = lines.let("three", less(Number(3.0), times(Number(2.0), t)))
    parts = [
        times(left, one, power(rest, 2)),
        times(slope_left, t, power(rest, 2)),
        times(right, power(t, 2), three),
        times(Number(-1.0), slope_right, power(t, 2), rest),
    ]
    return lines.let("smooth", total(parts))


def _slope(lines: Lines, levels: Array, values: Sequence[Expression], number: int, scheme: str) -> Expression:
    """Slope across levels of the interpolant at one of them."""
    h = [float(after - before) for before, after in pairwise(levels)]
    delta = [
        lines.let("delta", times(less(after, before), power(Number(width), -1)))
        for before, after, width in zip(values[:-1], values[1:], h, strict=True)
    ]
    if scheme == "linear" or len(h) == 1:
        return delta[min(number, len(h) - 1)]
    if number == 0:
        return lines.use("slope", OUTER, [delta[0], delta[1], Number(h[0]), Number(h[1])])
    if number == len(h):
        return lines.use("slope", OUTER, [delta[-1], delta[-2], Number(h[-1]), Number(h[-2])])
    return lines.use("slope", INNER, [delta[number - 1], delta[number], Number(h[number - 1]), Number(h[number])])
