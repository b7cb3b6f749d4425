"""The fused segment functions of one curve, within one region of its inputs (M1 eq 5-6, M2 eq 9-12).

A region is where no segment begins or ceases to count and no limit is crossed, so that which segments count, and how, is known from the
intervals alone. Rows outside of a transition zone then cost one segment function, rows in it two.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product
from math import inf, nextafter

import numpy as np

from mapmore_cli.domain.arrays import Array, Value
from mapmore_cli.domain.models import CurveFunction, Fusion, SegmentFunction
from mapmore_cli.modelling.pieces.scaling import prepared, segment_slope
from mapmore_cli.modelling.pieces.weights import TRANSITIONS, held_at, zones

Interval = tuple[float, float]
"""Values from the first up to, but without, the second."""

NOT_YET, ALL = (inf, inf), (-inf, -inf)
"""Zones of a weight that has not begun to rise, and of one that has risen."""


@dataclass(frozen=True)
class Weight:
    """`rise(x) - rise(x)` over the zones at the left and the right boundary of a segment (M2 eq 10 and 11) along one variable."""

    name: str
    left: Interval
    right: Interval


@dataclass(frozen=True)
class Piece:
    """A segment that counts in a region, its weights where they are not one, and how far it reaches along variables where that matters."""

    segment: SegmentFunction
    function: Callable[[Mapping[str, Value]], Value]
    weights: tuple[Weight, ...]
    reach: tuple[tuple[str, Interval], ...]


@dataclass(frozen=True)
class Pieces:
    """All that counts in a region, with the inputs that are held there, and those from where on the curve goes straight on."""

    pieces: tuple[Piece, ...]
    held: Mapping[str, np.float64]
    straight: Mapping[str, float]


NOTHING = Pieces((), {}, {})


@dataclass(frozen=True)
class FusedCurve:
    """One curve with what it needs of its model: its `free` inputs, all but the level, and the segmented ones among them."""

    curve: CurveFunction
    fusion: Fusion
    free: tuple[str, ...]
    variables: tuple[str, ...]

    def edges(self, name: str) -> Array:
        """Where something begins or ends along a free input, ascending: limits beyond which it does not simply go on, transition zones."""
        (low, high), (below, above) = self.limits(name), self.fusion.extrapolation[name]
        edges = [low] * (below != "continue") + [nextafter(high, inf)] * (above != "continue")
        edges += [edge for start, end in self._zones.get(name, ()) for edge in (nextafter(start, inf), end)]
        return np.unique(np.array(edges, dtype=np.float64))

    def limits(self, name: str) -> tuple[float, float]:
        """Where extrapolation begins along a free input: at the curve's own ends, or at those of the whole training domain."""
        return self.fusion.domain.get(name, self.curve.limits[name])

    def marks(self, name: str) -> tuple[float, float, float]:
        """Low end, threshold and high end along the aligned variable."""
        (low, high), threshold = self.curve.limits[name], self.curve.threshold
        assert threshold is not None
        return low, threshold, high

    def pieces(self, intervals: Mapping[str, Interval]) -> Pieces:
        """What counts in a region, given its interval of every free input, which no `edges` part."""
        within, held, straight = dict(intervals), {}, {}
        for name in self.free:
            (low, high), (below, above) = self.limits(name), self.fusion.extrapolation[name]
            start, end = intervals[name]
            side, limit = (below, low) if end <= low else (above, high) if start > high else ("continue", 0.0)
            if side == "zero":
                return NOTHING
            if side != "continue":
                at = held_at(side, limit)
                held[name], within[name] = np.float64(at), (at, nextafter(at, inf))
            if side == "continue_linear":
                straight[name] = limit
        return Pieces(tuple(self._counting(within)), held, straight)

    def value(self, pieces: Pieces, inputs: Mapping[str, Value]) -> Value:
        """The curve at rows of the region, (n,), or one number where it is constant."""
        at = {**inputs, **pieces.held}
        total: Value = np.float64(0.0)
        for piece in pieces.pieces:
            reached = {**at, **{name: np.clip(at[name], *ends) for name, ends in piece.reach}}
            value = piece.function(reached)
            for name, limit in pieces.straight.items():
                value = value + segment_slope(piece.segment, reached, name) * (inputs[name] - limit)
            for weight in piece.weights:
                value = value * self._weight(weight, at[weight.name])
            total = total + value
        return total

    @cached_property
    def _zones(self) -> dict[str, list[Interval]]:
        """The transition zones along every segmented variable."""
        along = (zones(boundaries, self.fusion.z_s) for boundaries in self.curve.boundaries)
        return {name: list(zip(*(ends.tolist() for ends in pair), strict=True)) for name, pair in zip(self.variables, along, strict=True)}

    @cached_property
    def _segments(self) -> dict[tuple[int, ...], SegmentFunction]:
        return {segment.cell: segment for segment in self.curve.segments}

    def _counting(self, within: Mapping[str, Interval]) -> Iterator[Piece]:
        """The segments whose weight is not zero."""
        along = [self._places(name, within[name]) for name in self.variables]
        for cell in product(*along):
            segment = self._segments[tuple(place for place, _ in cell)]
            weights = tuple(weight for _, weight in cell if (weight.left, weight.right) != (ALL, NOT_YET))
            yield Piece(segment, prepared(segment), weights, tuple(self._reach(segment, within)))

    def _places(self, name: str, within: Interval) -> list[tuple[int, Weight]]:
        """Place and weight of the segments that count along one variable."""
        rising = [ALL, *(_zone_from(within, zone) for zone in self._zones[name]), NOT_YET]
        return [(place, Weight(name, *sides)) for place, sides in enumerate(pairwise(rising), start=1) if sides[0] != sides[1]]

    def _weight(self, weight: Weight, x: Value) -> Value:
        if weight.right == NOT_YET:
            return self._rise(x, weight.left)
        risen = 1.0 if weight.left == ALL else self._rise(x, weight.left)
        return risen - self._rise(x, weight.right)

    def _rise(self, x: Value, zone: Interval) -> Value:
        start, end = zone
        return TRANSITIONS[self.fusion.transition]((x - start) / (end - start))

    def _reach(self, segment: SegmentFunction, within: Mapping[str, Interval]) -> Iterator[tuple[str, Interval]]:
        """Where a segment function is held (`hold: samples`): beyond its samples by more than z_s of their width.

        M2 eq 10 and 11 make a transition zone z_s of *both* neighbours' widths: in the zone beside a wide segment, the function of a narrow
        one would be carried several times its width beyond its data, where a polynomial explodes. Segments of one width that are full of
        samples are not held. The outer ends of a curve are left to `extrapolation`.
        """
        if self.fusion.hold == "none":
            return
        for name, boundaries, place in zip(self.variables, self.curve.boundaries, segment.cell, strict=True):
            low, high = segment.limits.get(name, (-inf, inf))
            reach = self.fusion.z_s * (high - low)
            ends = low - reach if place > 1 else -inf, high + reach if place < len(boundaries) - 1 else inf
            if within[name][0] < ends[0] or within[name][1] > ends[1]:
                yield name, ends


def _zone_from(within: Interval, zone: Interval) -> Interval:
    """The zone, or what it comes to in an interval that lies before or behind it."""
    if within[1] <= nextafter(zone[0], inf):
        return NOT_YET
    return ALL if within[0] >= zone[1] else zone
