"""Define MAPMORE as statements: scaling, segment functions, weights, levels and extrapolation (M2
eq 8-12).

Predictions, derivatives, the knots of the inverse, C, Python and FMUs are all derived from these
statements. Each function writes one equation with a `Writer` m. Branches are written with `where`
and `choose`; a branch is computed only if a sample takes it.

    y = sum_l w_l(level) sum_i f_i(E(x)) prod_j w_ij(E(x_j))
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import inf

import numpy as np

from mapmore_cli.domain.arrays import Array, Ends
from mapmore_cli.domain.joining import TRANSITIONS, Fusion, Side
from mapmore_cli.domain.models import CurveFunction, Pieces, SegmentFunction
from mapmore_cli.modelling.expressions import Expression, Name, Number, add, derivative, parse
from mapmore_cli.modelling.expressions.syntax import ONE, ZERO, Condition
from mapmore_cli.modelling.pieces.levels import across_levels
from mapmore_cli.modelling.program.statements import Program
from mapmore_cli.modelling.program.values import INPUT, evaluator
from mapmore_cli.modelling.program.writing import Inputs, Writer, renamed_all


def pieces_value(m: Writer, body: Pieces, inputs: Inputs) -> Expression:
    """Write the statements of the pieces, without their backbone, and return the expression of
    their output. `inputs` holds the inputs in the order in which the model lists them.
    """
    free = [name for name in inputs if name != body.level]
    functions = [_curve_function(m, curve, body, free) for curve in body.curves]
    if body.level is None:
        return m.use("pieces", functions[0], inputs.values())
    levels = [float(curve.level) for curve in body.curves if curve.level is not None]
    sides = body.fusion.extrapolation[body.level]
    m.knot(body.level, *levels)
    level = m.choose(
        "level",
        _held_places(inputs[body.level], (levels[0], levels[-1]), sides, words=("saturate",)),
        inputs[body.level],
    )

    def curve_at(number: int) -> Expression:
        return m.use("value", functions[number], [*(inputs[name] for name in free), level])

    how = body.fusion.levels, body.fusion.shrink
    return across_levels(m, level, levels, sides, *how, curve_at)


def segment_value(
    m: Writer,
    segment: SegmentFunction,
    x: Inputs,
    beyond: Mapping[str, list[tuple[Condition, Expression]]],
) -> Expression:
    """Write a segment function (M2 eq 8).

    The function is `f(x) = y_slope sum_k theta_k D_k(z) + y_intercept` with `z = slope x +
    intercept`.

    A curve may continue as a straight line beyond its limits. For each input, `beyond` holds the
    conditions under which it does so, and the distance of the sample from the limit.
    """
    scaling = segment.scaling
    scales = zip(scaling.variables, scaling.slope.tolist(), scaling.intercept.tolist(), strict=True)
    z = {name: m.let(f"z_{name}", slope * x[name] + intercept) for name, slope, intercept in scales}
    terms = [parse(text) for text in segment.terms]
    value = m.let("segment", combination(segment, renamed_all(terms, z)))
    for name, cases in beyond.items():
        if name in z:
            scale = float(scaling.slope[scaling.variables.index(name)])
            slope = scale * add(
                *weighted_terms(segment, renamed_all([derivative(term, name) for term in terms], z))
            )
            value = m.choose(
                "straight", [(beyond_it, value + slope * way) for beyond_it, way in cases], value
            )
    return value


def combination(segment: SegmentFunction, regressors: Sequence[Expression]) -> Expression:
    """Return `y_slope sum_k theta_k D_k + y_intercept` for the given `regressors` D_k."""
    return add(Number(float(segment.scaling.y_intercept)), *weighted_terms(segment, regressors))


def weighted_terms(segment: SegmentFunction, regressors: Sequence[Expression]) -> list[Expression]:
    """Return the summands of `combination`, `y_slope theta_k D_k`, one for each regressor D_k."""
    return [
        float(segment.scaling.y_slope * theta) * D
        for theta, D in zip(segment.theta, regressors, strict=True)
    ]


def _curve_function(m: Writer, curve: CurveFunction, body: Pieces, free: Sequence[str]) -> str:
    """Write a curve as a function of the program, and return the name of the function. Its
    arguments are the inputs that vary within the curve, and the level if there is one.
    """
    fusion = body.fusion
    names = [*free, *([body.level] if body.level is not None else [])]
    limits = {name: curve.limits[name] for name in free}
    straight = [name for name in free if "continue_linear" in fusion.extrapolation[name]]
    x = {name: Name(m.fresh(f"at_{name}")) for name in names}
    for name, boundaries in zip(body.variables, curve.boundaries, strict=True):
        m.knot(name, *boundaries.tolist(), *np.concatenate(zones(boundaries, fusion)).tolist())
    functions = {
        segment.cell: _segment_function(m, segment, curve, body, names, straight)
        for segment in curve.segments
    }

    def inside() -> Expression:
        held = {
            name: m.choose(
                f"held_{name}",
                _held_places(x[name], limits[name], fusion.extrapolation[name]),
                x[name],
            )
            for name in free
        }
        arguments = [*({**x, **held}.values()), *(x[name] for name in straight)]
        along = [held[name] for name in body.variables]
        return fused_value(
            m,
            along,
            curve.boundaries,
            fusion,
            lambda cell: m.use("part", functions[cell], arguments),
        )

    nothing = [
        (beyond, ZERO)
        for name in free
        for beyond, _ in _beyond_with(x[name], limits[name], fusion.extrapolation[name], "zero")
    ]
    parameters = [name.name for name in x.values()]
    return m.function(
        m.fresh("curve"),
        parameters,
        lambda: m.choose("curve", nothing, inside),
        f"the curve {curve.curve}",
    )


def _segment_function(
    m: Writer,
    segment: SegmentFunction,
    curve: CurveFunction,
    body: Pieces,
    names: Sequence[str],
    straight: Sequence[str],
) -> str:
    """Write a segment as a function of the program, and return the name of the function. Its first
    arguments are the inputs `names`, limited to the range of the curve. Further arguments are the
    inputs in `straight`, along which the curve continues as a straight line outside its range;
    these are not limited.
    """
    held, asked = (
        {name: Name(m.fresh(f"at_{name}")) for name in some} for some in (names, straight)
    )
    beyond = {
        name: _beyond_with(
            x, curve.limits[name], body.fusion.extrapolation[name], "continue_linear"
        )
        for name, x in asked.items()
    }
    return m.function(
        m.fresh("segment"),
        [name.name for name in (*held.values(), *asked.values())],
        lambda: segment_value(
            m, segment, {**held, **_reached(m, segment, curve, body, held)}, beyond
        ),
        f"the segment {segment.id}",
    )


def fused_value(
    m: Writer,
    x: Sequence[Expression],
    boundaries: Sequence[Array],
    fusion: Fusion,
    of_cell: Callable[[tuple[int, ...]], Expression],
    cell: tuple[int, ...] = (),
) -> Expression:
    """Write `sum_i f_i prod_j w_ij(x_j)`, one variable after the other (M2 eq 9-11).

    Outside all transition zones, the value is that of the segment in which the sample lies. In the
    zone at boundary i, the value is `(1 - s) f_i + s f_{i+1}`, so that the weights sum to one. With
    `z_s = 0`, the transition is a step, and the boundary itself belongs to the left segment.
    """
    if not boundaries:
        return of_cell(cell)
    along = partial(fused_value, m, x[1:], boundaries[1:], fusion, of_cell)
    cases: list[tuple[Condition, Callable[[], Expression]]] = []

    def in_zone(i: int, start: float, end: float) -> Expression:
        s = m.let(
            "rise", TRANSITIONS[fusion.transition].s(m, m.let("t", (x[0] - start) / (end - start)))
        )
        return (1 - s) * m.let("left", along((*cell, i))) + s * m.let(
            "right", along((*cell, i + 1))
        )

    for i, (start, end) in enumerate(
        zip(*(ends.tolist() for ends in zones(boundaries[0], fusion)), strict=True), start=1
    ):
        cases.append((x[0] <= start, partial(along, (*cell, i))))
        if fusion.z_s:
            cases.append((x[0] < end, partial(in_zone, i, start, end)))
    return m.choose("joined", cases, partial(along, (*cell, len(boundaries[0]) - 1)))


def zones(boundaries: Array, fusion: Fusion) -> tuple[Array, Array]:
    """Return the start and the end of the transition zone at each inner boundary, (count - 1,) each
    (M2 eq 10 and 11).

    The zone at boundary i begins at `seg_i - z_s (seg_i - seg_{i-1})` and ends at `seg_i + z_s
    (seg_{i+1} - seg_i)`. In the zone, the weight of the left segment falls from 1 to 0, and the
    weight of the right segment rises from 0 to 1.
    """
    widths = np.diff(boundaries)
    inner = boundaries[1:-1]
    return inner - fusion.z_s * widths[:-1], inner + fusion.z_s * widths[1:]


def zones_of(curve: CurveFunction, body: Pieces) -> dict[str, tuple[Array, Array]]:
    """Return the transition zones of a curve along each segmented variable, (count - 1,) each."""
    return {
        name: zones(boundaries, body.fusion)
        for name, boundaries in zip(body.variables, curve.boundaries, strict=True)
    }


def _side_conditions(
    x: Expression, limits: Ends, sides: tuple[Side, Side]
) -> tuple[tuple[Condition, Side, float], ...]:
    """Return the conditions for the lower and for the upper side of an input, as two tuples of
    three values: the condition that the input lies outside the limit, the extrapolation on this
    side, and the limit.
    """
    return ((x < limits[0], sides[0], limits[0]), (x > limits[1], sides[1], limits[1]))


def _held_places(
    x: Expression,
    limits: Ends,
    sides: tuple[Side, Side],
    words: Sequence[str] = ("saturate", "continue_linear"),
) -> list[tuple[Condition, Expression]]:
    """Return the cases in which the extrapolation function E (M2 eq 12) replaces an input by a
    constant. Each case consists of the condition that the input lies outside a limit, and the
    constant. The constant is the limit, or a value from the spec.
    """
    held = [
        (beyond, side if isinstance(side, float) else end if side in words else None)
        for beyond, side, end in _side_conditions(x, limits, sides)
    ]
    return [(beyond, Number(float(place))) for beyond, place in held if place is not None]


def _beyond_with(
    x: Expression, limits: Ends, sides: tuple[Side, Side], word: str
) -> list[tuple[Condition, Expression]]:
    """Return the sides of an input x on which the extrapolation is `word`, for example `zero`. For
    each of these sides, return the condition that x lies outside the limit, and the distance of x
    from the limit.
    """
    return [
        (beyond, x - end)
        for beyond, side, end in _side_conditions(x, limits, sides)
        if side == word
    ]


def _reached(
    m: Writer, segment: SegmentFunction, curve: CurveFunction, body: Pieces, x: Inputs
) -> dict[str, Expression]:
    """Return the inputs of a segment function. With `hold: samples`, each input is limited to the
    range of the segment's samples, extended by z_s times the width of this range.

    The limits are needed because a transition zone covers the fraction z_s of the widths of *both*
    segments (M2 eq 10 and 11). Without limits, the function of a narrow segment beside a wide
    segment would be evaluated far outside its samples, at a distance of several times its own
    width. A polynomial takes extreme values there. Limits that no transition zone reaches are left
    out. At the outer ends of a curve, `extrapolation` applies instead.
    """
    held = {}
    for name, (below, above) in held_between(segment, curve, body).items():
        m.knot(name, *(edge for edge in (below, above) if edge is not None))
        held[name] = m.clip(x[name], below, above, f"reached_{name}")
    return held


def held_between(
    segment: SegmentFunction, curve: CurveFunction, body: Pieces
) -> dict[str, tuple[float | None, float | None]]:
    """Return the lower and the upper limit of each variable, outside which a segment function is
    constant. A limit is None if the function is not limited on this side. With `hold: none`, the
    mapping is empty.
    """
    if body.fusion.hold == "none":
        return {}
    between = {}
    for name, boundaries, place in zip(body.variables, curve.boundaries, segment.cell, strict=True):
        low, high = segment.limits.get(name, (-inf, inf))
        reach = body.fusion.z_s * (high - low)
        start, end = zones(boundaries, body.fusion)
        between[name] = (
            low - reach if place > 1 and low - reach > start[place - 2] else None,
            high + reach if place < len(boundaries) - 1 and high + reach < end[place - 1] else None,
        )
    return between


def pieces_program(body: Pieces, names: Sequence[str]) -> Program:
    """Return the pieces, without their backbone, as a program whose inputs have the given names."""
    m = Writer()
    value = pieces_value(m, body, {name: Name(f"{INPUT}{name}") for name in names})
    return m.program(names, value)


def rule_of_weights(body: Pieces) -> str:
    """Return a sentence about the transition zones: how the weights of two neighbouring segments
    change along one variable (M2 eq 10 and 11).
    """
    fusion = body.fusion
    return (
        f"The weight of a piece is w in the zone in which it rises, 1 - w in the zone in which it "
        f"falls, 1 between these zones and 0 outside; {TRANSITIONS[fusion.transition].words}, with "
        f"t from 0 to 1 across a zone (z_s = {fusion.z_s:g}). The pieces of one curve are "
        "multiplied by their weights and added. With several variables, the weights are multiplied."
    )


def cell_weights(x: Array, boundaries: Array, fusion: Fusion) -> Array:
    """Return the weight of every segment along one variable at x, shape (n, count). The weights in
    each row sum to one (M2 eq 10 and 11).
    """

    def weight(place: int) -> Array:
        m = Writer()
        value = fused_value(
            m,
            [Name(f"{INPUT}x")],
            [boundaries],
            fusion,
            lambda cell: ONE if cell == (place,) else ZERO,
        )
        return evaluator(m.program(["x"], value))({"x": x})[0]

    return np.stack([weight(place) for place in range(1, len(boundaries))], axis=1)
