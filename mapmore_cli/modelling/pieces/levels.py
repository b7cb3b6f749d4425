"""Interpolate the curves of a model between their levels, and continue them outside the outermost
levels.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import pairwise

from mapmore_cli.domain.joining import Side
from mapmore_cli.domain.models import Pieces
from mapmore_cli.modelling.expressions import Expression, Name, Number, call
from mapmore_cli.modelling.expressions.syntax import ZERO, Condition
from mapmore_cli.modelling.program.writing import Writer


def across_levels(
    m: Writer,
    level: Expression,
    levels: Sequence[float],
    sides: tuple[Side, Side],
    interpolation: str,
    shrink: float,
    curve_at: Callable[[int], Expression],
) -> Expression:
    """Write the interpolation of the curves between their levels and its continuation outside the
    outermost levels.

    Let t be the position between levels i and i + 1, from 0 to 1. With the `interpolation`
    `linear`, the value is `(1 - t) f_i + t f_{i+1}` (triangular weights, M1 figure 2). With
    `pchip`, it is the cubic Hermite interpolant with slopes that keep the shape of the curves'
    values (Fritsch and Butland 1984). The value is multiplied by the factor `g + (1 - g)(1 -
    2t)^2` with g = `shrink`. At a level itself, only the curve of this level is computed, because
    the other curves may have no value there.

    Beyond the outermost level, `continue` and `saturate` use its curve unchanged, `continue_linear`
    continues with the slope at that level, and `zero` reduces the weight to zero (M2 figure 7d).
    `curve_at` writes the curve with a number.
    """
    last = len(levels) - 1

    def values(i: int) -> dict[int, Expression]:
        """Write the values of the curves that are needed between the levels i and i + 1. These are
        the curves i and i + 1, and with `pchip` also the next curve on either side.
        """
        reach = 0 if interpolation == "linear" else 1
        numbers = range(max(i - reach, 0), min(i + 1 + reach, last) + 1)
        return {number: curve_at(number) for number in numbers}

    def between(i: int) -> Expression:
        y, t = _between(m, level, levels, i, values, interpolation)
        if shrink == 1.0:
            return y
        return m.let("between", y) * (shrink + (1 - shrink) * (1 - 2 * t) ** 2)

    def straight(end: int) -> Expression:
        f = values(min(end, last - 1))
        return f[end] + _slope(m, levels, f, end) * (level - levels[end])

    def beyond(end: int, side: Side) -> Callable[[], Expression]:
        if side == "zero":
            return lambda: ZERO
        return partial(straight if side == "continue_linear" and last > 0 else curve_at, end)

    below, above = beyond(0, sides[0]), beyond(last, sides[1])
    if last == 0:
        return m.choose(
            "across", [(level < levels[0], below), (level > levels[0], above)], partial(curve_at, 0)
        )
    cases: list[tuple[Condition, Callable[[], Expression]]] = [(level < levels[0], below)]
    cases += [
        (Condition(level, "==", Number(at)), partial(curve_at, i)) for i, at in enumerate(levels)
    ]
    for i in range(last):
        within = level < levels[i + 1] if i + 1 < last else level <= levels[last]
        cases.append((within, partial(between, i)))
    return m.choose("across", cases, above)


def _between(
    m: Writer,
    level: Expression,
    levels: Sequence[float],
    i: int,
    values: Callable[[int], dict[int, Expression]],
    interpolation: str,
) -> tuple[Expression, Expression]:
    """Write the interpolation between the levels i and i + 1. Return its value, and the position t
    of the sample between both levels, from 0 to 1. `values` writes the values of the curves that
    are needed.
    """
    width = levels[i + 1] - levels[i]
    t = m.let("t", (level - levels[i]) / width)
    f = values(i)
    if interpolation == "linear":
        return (1 - t) * f[i] + t * f[i + 1], t
    left, right = (m.let("slope", _slope(m, levels, f, number) * width) for number in (i, i + 1))
    rest = m.let("rest", 1 - t)
    return (
        f[i] * (1 + 2 * t) * rest**2
        + left * t * rest**2
        + f[i + 1] * t**2 * (3 - 2 * t)
        - right * t**2 * rest
    ), t


def _slope(
    m: Writer, levels: Sequence[float], f: Mapping[int, Expression], number: int
) -> Expression:
    """Write the derivative of the interpolant with respect to the level, at level `number`. It is
    computed from the values `f` of the curves at this level and at neighbouring levels. With two
    curves, the derivative is the slope of the line between them. At an inner level, the derivative
    is the weighted harmonic mean of the slopes to both neighbours, or zero if these slopes differ
    in sign. At the lowest and the highest level, the derivative is a three-point difference,
    limited so that the interpolant stays monotone.
    """
    h = [levels[j] - levels[i] for i, j in pairwise(f)]
    delta = [
        m.let("delta", (f[j] - f[i]) / width) for (i, j), width in zip(pairwise(f), h, strict=True)
    ]
    at = number - min(f)
    if len(h) == 1:
        return delta[0]
    if at == 0:
        return m.use("slope", _end_slope(m), [delta[0], delta[1], h[0], h[1]])
    if at == len(h):
        return m.use("slope", _end_slope(m), [delta[-1], delta[-2], h[-1], h[-2]])
    return m.use("slope", _inner_slope(m), [delta[at - 1], delta[at], h[at - 1], h[at]])


sign = partial(call, "sign")


def _inner_slope(m: Writer) -> str:
    names = ["before", "after", "h_before", "h_after"]
    before, after, h_before, h_after = map(Name, names)

    def mean() -> Expression:
        w_before = m.let("w_before", h_before + 2 * h_after)
        w_after = m.let("w_after", 2 * h_before + h_after)
        return (w_before + w_after) * (before / (w_after * before + w_before * after)) * after

    return m.function(
        "slope_inside",
        names,
        lambda: m.where(sign(before) * sign(after) > 0.0, mean, 0.0),
        "slope at an inner level, which keeps the shape",
    )


def _end_slope(m: Writer) -> str:
    names = ["delta", "delta_next", "h", "h_next"]
    delta, delta_next, h, h_next = map(Name, names)

    def held_back() -> Expression:
        three = m.let("three", ((2 * h + h_next) * delta - h * delta_next) / (h + h_next))
        kept = m.where(sign(three) * sign(delta) > 0.0, three, 0.0)
        steepest = 3 * delta
        held = m.where(call("abs", kept) > call("abs", steepest), steepest, kept)
        return m.where(sign(delta) * sign(delta_next) > 0.0, kept, held)

    return m.function(
        "slope_at_end", names, held_back, "slope at an outermost level, which keeps the shape"
    )


def rule_of_levels(body: Pieces) -> str:
    """Return a text for the reader of a model: how its output between two levels is computed from
    the curves at these levels. `across_levels` writes the same rule as statements.
    """
    between = "(1 - t) times the lower curve plus t times the upper"
    if body.fusion.levels == "pchip":
        between = (
            "the cubic of Fritsch and Butland (PCHIP) through the values of the curves at their "
            "levels, which is f*(1 + 2*t)*(1 - t)^2 + g*t^2*(3 - 2*t) + h*t*(1 - t)*(m*(1 - t) - "
            "n*t) with the lower value f, the upper value g, the distance h of the two levels, and "
            "the slopes m and n at them"
        )
    shrink = body.fusion.shrink
    carried = f", all times {shrink:.6g} + {1 - shrink:.6g}*(1 - 2*t)^2" * (shrink < 1.0)
    rule = f"Between two levels of {body.level}, at the fraction t of the way: {between}{carried}."
    return rule + (f" {RULE_OF_SLOPES}" if body.fusion.levels == "pchip" else "")


RULE_OF_SLOPES = (
    "Let u and v be the widths of the intervals before and after a level, and c and d the "
    "differences of the values over these intervals, divided by their widths. The slope at the "
    "level is 3*(u + v)*c*d/((2*u + v)*c + (u + 2*v)*d), or 0 if c*d <= 0. At an outermost level, "
    "c and u belong to the interval next to it, and d and v to the following interval. The slope "
    "is then ((2*u + v)*c - u*d)/(u + v), but 0 if this value and c differ in sign, and at most "
    "3*c in magnitude if c and d differ in sign. With two levels, the slope is c."
)
"""Rule for the slopes at levels, as `_slope` writes it, in words."""
