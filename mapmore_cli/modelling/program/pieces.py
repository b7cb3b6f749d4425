"""Write MAPMORE as statements: the backbone, and the curves between their levels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.models import CurveFunction, Pieces, Side
from mapmore_cli.modelling.pieces.evaluation import level_values
from mapmore_cli.modelling.pieces.weights import held_at
from mapmore_cli.modelling.program.bands import across_levels, slope_functions
from mapmore_cli.modelling.program.curves import curve_function
from mapmore_cli.modelling.program.statements import Function
from mapmore_cli.modelling.program.writing import Lines, less, times, total
from mapmore_cli.modelling.terms import Expression, Number, add, power
from mapmore_cli.modelling.terms.syntax import Condition


def pieces_value(lines: Lines, body: Pieces, inputs: Mapping[str, Expression]) -> tuple[Expression, tuple[Function, ...]]:
    """What the pieces add up to, without their backbone, and the functions that it needs; `inputs` in the order of the model."""
    free = [name for name in inputs if name != body.level]
    curves = [curve_function(curve, body.fusion, free, body.level, body.variables, lines.names) for curve in body.curves]
    if body.level is None:
        return lines.use("pieces", curves[0].name, [inputs[name] for name in free]), (curves[0],)
    levels, sides = level_values(body), body.fusion.extrapolation[body.level]
    level = _within_levels(lines, inputs[body.level], levels, sides)

    def curve_at(own: Lines, number: int, between: tuple[int, int], t: Expression) -> Expression:
        places = dict(inputs)
        if body.fusion.aligned is not None:
            marks = [_marks(body.curves[i], body.fusion.aligned) for i in (*between, number)]
            places[body.fusion.aligned] = _aligned(own, inputs[body.fusion.aligned], marks, t)
        return own.use("value", curves[number].name, [*(places[name] for name in free), level])

    value = across_levels(lines, level, levels, sides, body.fusion, curve_at)
    helpers = slope_functions() if body.fusion.levels != "linear" and len(levels) > 2 else ()
    return value, (*helpers, *curves)


def _within_levels(lines: Lines, level: Expression, levels: Array, sides: tuple[Side, Side]) -> Expression:
    """Only `saturate` and a value move the level itself; the other words act on the weights."""
    ends = (float(levels[0]), float(levels[-1]))
    cases = [
        (Condition(level, sign, Number(end)), Number(held_at(side, end)))
        for sign, side, end in zip("<>", sides, ends, strict=True)
        if side == "saturate" or isinstance(side, float)
    ]
    return lines.choose("level", cases, level)


def _marks(curve: CurveFunction, name: str) -> Array:
    """Low end, threshold and high end."""
    assert curve.threshold is not None
    low, high = curve.limits[name]
    return np.array([low, curve.threshold, high])


def _aligned(lines: Lines, x: Expression, marks: Sequence[Array], t: Expression) -> Expression:
    """The place on one curve that answers to x, as `pieces.alignment.aligned` has it; `marks` left and right of x, and the curve's own."""
    left, right, own = marks
    low: Expression
    middle: Expression
    high: Expression
    if np.array_equal(left, right):
        low, middle, high = (Number(float(mark)) for mark in left)
    else:
        rest = lines.let("rest", less(Number(1.0), t))
        low, middle, high = (
            lines.let("mark", total([times(rest, Number(float(a))), times(t, Number(float(b)))])) for a, b in zip(left, right, strict=True)
        )
    sides = [lines.let("width", less(middle, low)), lines.let("width", less(high, middle))]
    ratios = [_ratio(lines, float(width), between) for width, between in zip(np.diff(own), sides, strict=True)]
    way = lines.let("way", less(x, middle))
    ratio = lines.choose("ratio", [(Condition(x, "<", middle), ratios[0])], ratios[1])
    return lines.let("place", add(Number(float(own[1])), times(way, ratio)))


def _ratio(lines: Lines, own: float, between: Expression) -> Expression:
    wide = Lines(lines.names)
    quotient = wide.let("quotient", times(Number(own), power(between, -1)))
    return lines.choose("ratio", [(Condition(between, ">", Number(0.0)), wide.block(quotient))], Number(1.0))
