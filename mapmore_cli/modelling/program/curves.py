"""The fused segment functions of one curve as a function of its free inputs (M2 eq 9-12), as `pieces.curve` evaluates them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf

from mapmore_cli.domain.models import CurveFunction, Fusion, SegmentFunction
from mapmore_cli.modelling.pieces.weights import held_at, zones
from mapmore_cli.modelling.program.statements import Block, Function
from mapmore_cli.modelling.program.writing import Lines, Names, combination, less, renamed_all, times, total
from mapmore_cli.modelling.terms import Expression, Name, Number, add, derivative, parse, power
from mapmore_cli.modelling.terms.syntax import Condition

Rise = Expression | None
"""Weight of the segment above at a place; None where there is one segment alone."""

Place = tuple[int, Rise]
"""Number of a segment along one variable, from 1, and the weight of the next one."""


@dataclass(frozen=True)
class Along:
    """A free input of a curve: where it is looked up, and what happens beyond its ends."""

    name: str
    asked: Name
    held: Expression
    straight: tuple[float | None, float | None]  # limits from which on the curve goes straight on
    zero: tuple[float | None, float | None]  # limits beyond which there is nothing


def curve_function(
    curve: CurveFunction, fusion: Fusion, free: Sequence[str], level: str | None, variables: Sequence[str], names: Names
) -> Function:
    """The curve as a function of its free inputs, in their order, and of the level where there is one."""
    lines = Lines(names)
    along = {name: _along(lines, curve, fusion, name) for name in free}
    if level is not None:
        place = Name(names.fresh(f"at_{level}"))
        along[level] = Along(level, place, place, (None, None), (None, None))
    writer = _Curve(curve, fusion, tuple(variables), names, along)
    value = writer.value(lines)
    for one in along.values():
        beyond = [Condition(one.asked, sign, Number(end)) for sign, end in zip("<>", one.zero, strict=True) if end is not None]
        value = lines.choose("inside", [(condition, Number(0.0)) for condition in beyond], value)
    parameters = tuple(one.asked.name for one in along.values())
    return Function(names.fresh("curve"), parameters, lines.block(value), f"the curve {curve.curve}")


def _along(lines: Lines, curve: CurveFunction, fusion: Fusion, name: str) -> Along:
    asked, sides = Name(lines.names.fresh(f"at_{name}")), fusion.extrapolation[name]
    ends = fusion.domain.get(name, curve.limits[name])
    cases = [
        (Condition(asked, sign, Number(end)), Number(held_at(side, end)))
        for sign, side, end in zip("<>", sides, ends, strict=True)
        if side not in ("continue", "zero")
    ]
    held = lines.choose(f"held_{name}", cases, asked)
    straight, zero = (
        (ends[0] if sides[0] == word else None, ends[1] if sides[1] == word else None) for word in ("continue_linear", "zero")
    )
    return Along(name, asked, held, straight, zero)


@dataclass(frozen=True)
class _Curve:
    """Writes one curve down."""

    curve: CurveFunction
    fusion: Fusion
    variables: tuple[str, ...]
    names: Names
    along: Mapping[str, Along]

    def value(self, lines: Lines, places: tuple[Place, ...] = ()) -> Expression:
        """The curve, variable by variable: which segments count along each, until the cell is known."""
        if len(places) == len(self.variables):
            return self._mixed(lines, places)
        number = len(places)
        at = self.along[self.variables[number]].held
        cases, last = [], 1
        for i, (start, end) in enumerate(zip(*(z.tolist() for z in zones(self.curve.boundaries[number], self.fusion.z_s)), strict=True), 1):
            cases.append((Condition(at, "<=", Number(start)), self._block((*places, (i, None)))))
            if end > start:
                cases.append((Condition(at, "<", Number(end)), self._in_zone(places, i, at, start, end)))
            last = i + 1
        return lines.choose("curve", cases, self._block((*places, (last, None))))

    def _block(self, places: tuple[Place, ...]) -> Block:
        lines = Lines(self.names)
        return lines.block(self.value(lines, places))

    def _in_zone(self, places: tuple[Place, ...], number: int, at: Expression, start: float, end: float) -> Block:
        lines = Lines(self.names)
        t = lines.let("t", times(less(at, Number(start)), power(Number(end - start), -1)))
        rise = _transition(lines, self.fusion.transition, t)
        return lines.block(self.value(lines, (*places, (number, rise))))

    def _mixed(self, lines: Lines, places: tuple[Place, ...]) -> Expression:
        """The sum of the segments that count, each times its weights."""
        segments = {segment.cell: segment for segment in self.curve.segments}
        values = []
        for cell, weights in _cells(places):
            value = self._segment(lines, segments[cell])
            values.append(lines.let("part", times(value, *weights)))
        return total(values)

    def _segment(self, lines: Lines, segment: SegmentFunction) -> Expression:
        """A segment function where it is looked up, and straight on from there where its curve goes straight on."""
        at = {name: one.held for name, one in self.along.items()}
        for name, low, high in self._reach(segment):
            at[name] = lines.clip(at[name], low, high, f"reached_{name}")
        scaling = segment.scaling
        scales = zip(scaling.variables, scaling.slope.tolist(), scaling.intercept.tolist(), strict=True)
        z = {name: lines.let(f"z_{name}", total([times(Number(slope), at[name]), Number(shift)])) for name, slope, shift in scales}
        value = lines.let(
            "segment",
            combination(lines, (segment.theta * scaling.y_slope).tolist(), renamed_all(map(parse, segment.terms), z), scaling.y_intercept),
        )
        for name, one in self.along.items():
            if name in scaling.variables:
                value = self._straight_on(lines, segment, one, z, value)
        return value

    def _straight_on(
        self, lines: Lines, segment: SegmentFunction, one: Along, z: Mapping[str, Expression], value: Expression
    ) -> Expression:
        """Beyond a limit with `continue_linear`, the value there and the slope there times the way."""
        cases = []
        scaling = segment.scaling
        slopes = [derivative(parse(term), one.name) for term in segment.terms]
        outer = scaling.y_slope * scaling.slope[scaling.variables.index(one.name)]
        for sign, limit in zip("<>", one.straight, strict=True):
            if limit is None:
                continue
            beyond = Lines(self.names)
            texts = renamed_all(slopes, z)
            slope = beyond.let("slope", combination(beyond, (segment.theta * outer).tolist(), texts, 0.0))
            further = beyond.let("further", times(slope, beyond.let("way", less(one.asked, Number(limit)))))
            cases.append((Condition(one.asked, sign, Number(limit)), beyond.block(add(value, further))))
        return lines.choose("straight", cases, value)

    def _reach(self, segment: SegmentFunction) -> Iterator[tuple[str, float | None, float | None]]:
        """Where a segment function is held, where that lies within the zones in which it counts; see `pieces.curve`."""
        if self.fusion.hold == "none":
            return
        for name, boundaries, place in zip(self.variables, self.curve.boundaries, segment.cell, strict=True):
            low, high = segment.limits.get(name, (-inf, inf))
            reach = self.fusion.z_s * (high - low)
            start, end = zones(boundaries, self.fusion.z_s)
            below = low - reach if place > 1 and low - reach > start[place - 2] else None
            above = high + reach if place < len(boundaries) - 1 and high + reach < end[place - 1] else None
            if below is not None or above is not None:
                yield name, below, above


def _transition(lines: Lines, transition: str, t: Expression) -> Expression:
    """`weights.TRANSITIONS` at t."""
    if transition == "linear":
        return t
    if transition == "cubic":
        square, cube = power(t, 2), power(t, 3)
        return lines.let("rise", less(times(Number(3.0), square), times(Number(2.0), cube)))
    rest = Lines(lines.names)
    left = rest.let("left", less(Number(1.0), t))
    late = rest.block(less(Number(1.0), times(Number(2.0), power(left, 2))))
    return lines.choose("rise", [(Condition(t, "<", Number(0.5)), times(Number(2.0), power(t, 2)))], late)


def _cells(
    places: Sequence[Place], cell: tuple[int, ...] = (), weights: tuple[Expression, ...] = ()
) -> Iterator[tuple[tuple[int, ...], tuple[Expression, ...]]]:
    """Every cell that counts, in order, with its weights that are not one."""
    if not places:
        yield cell, weights
        return
    (number, rise), *rest = places
    if rise is None:
        yield from _cells(rest, (*cell, number), weights)
    else:
        yield from _cells(rest, (*cell, number), (*weights, less(Number(1.0), rise)))
        yield from _cells(rest, (*cell, number + 1), (*weights, rise))
