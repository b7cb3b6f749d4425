"""Evaluation of the pieces of a model, for any number of rows at once (M1 eq 5-6, M2 eq 9-12).

Rows are sorted into regions: where the same curves and segments count in the same way. What is the same within a region is decided
once for all of its rows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass, replace
from math import inf, prod

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns, IntArray, Value
from mapmore_cli.domain.models import Pieces as Body
from mapmore_cli.domain.models import SegmentFunction
from mapmore_cli.modelling.pieces.bands import Band, aligned, alone, bands
from mapmore_cli.modelling.pieces.curve import FusedCurve, Pieces
from mapmore_cli.modelling.pieces.weights import clamped

Axis = tuple[Array, Array]
"""Values of the rows along one direction, (n,), and the edges across it, ascending: interval i has i edges at or below its values."""


def interval(edges: Array, number: int) -> tuple[float, float]:
    """First value of an interval, and the first one beyond it."""
    ends = [-inf, *edges.tolist(), inf]
    return ends[number], ends[number + 1]


def regions(axes: Sequence[Axis], n: int) -> Iterator[tuple[tuple[int, ...], IntArray]]:
    """Every region that holds some of the n rows: the number of its interval on each axis, and its rows.

    Rows that are NaN on an axis count as below its lowest edge. With fewer than 65536 regions the sort is a radix sort, whose time does not
    depend on how the rows lie.
    """
    shape = [len(edges) + 1 for _, edges in axes]
    number = np.zeros(n, dtype=np.min_scalar_type(prod(shape)))
    above = np.empty(n, dtype=bool)
    for (x, edges), count in zip(axes, shape, strict=True):
        number *= number.dtype.type(count)
        for edge in edges:
            number += np.greater_equal(x, edge, out=above).view(np.uint8)
    order = np.argsort(number, kind="stable")
    number = number[order]
    ends = [*(np.flatnonzero(number[1:] != number[:-1]) + 1).tolist(), n]
    for start, end in zip([0, *ends], ends, strict=False):
        if end > start:
            yield tuple(int(i) for i in np.unravel_index(number[start], shape)), order[start:end]


FEW = 255
"""Regions up to which rows are sorted in one go: their numbers fit into a byte. More are sorted band by band, each with its own edges."""


@dataclass(frozen=True)
class Lookup:
    """Where curves are looked up along a free input, by the name of a column, and the edges there.

    `curve` is the number of the one that is, None where all are looked up at the same place.
    """

    name: str
    column: str
    curve: int | None
    edges: Array


class FusedPieces:
    """The pieces of a model, ready for any number of rows; what counts in a region is found out when the first row is found in it."""

    def __init__(self, model: Body, names: Sequence[str]) -> None:
        self.fusion = model.fusion
        self.level = model.level
        self.free = tuple(name for name in names if name != model.level)
        self.curves = [FusedCurve(curve, model.fusion, self.free, model.variables) for curve in model.curves]
        self.levels = level_values(model)
        self.edges, self.bands = _bands(model, self.levels)
        self.across = model.level or names[0]
        self.everywhere = self._lookups(range(len(self.curves)))
        self.within: dict[int, list[Lookup]] = {}
        self.pieces: dict[tuple[int, ...], list[Pieces]] = {}

    def values(self, inputs: Columns) -> Array:
        """What the pieces add up to at every row, (n,)."""
        inputs = self._within_levels(inputs)
        y = np.empty(len(inputs[self.across]))
        level = (inputs[self.across], self.edges)
        axes = [(inputs[lookup.name], lookup.edges) for lookup in self.everywhere]
        if self._aligned() is None and prod(len(edges) + 1 for _, edges in (level, *axes)) <= FEW:
            for place, rows in regions([level, *axes], len(y)):
                y[rows] = self._in_region(place, self.everywhere, {name: x.take(rows) for name, x in inputs.items()})
        else:
            for (band,), rows in regions([level], len(y)):
                y[rows] = self._in_band(band, {name: x.take(rows) for name, x in inputs.items()})
        return y

    def _in_band(self, number: int, inputs: Columns) -> Array:
        """The pieces at rows of one band, (n,)."""
        band = self.bands[number]
        if number not in self.within:
            self.within[number] = self._lookups(band.curves)
        lookups = self.within[number]
        inputs = {**inputs, **self._own_places(band, lookups, inputs)}
        y = np.empty(len(inputs[self.across]))
        for place, rows in regions([(inputs[lookup.column], lookup.edges) for lookup in lookups], len(y)):
            y[rows] = self._in_region((number, *place), lookups, {name: x.take(rows) for name, x in inputs.items()})
        return y

    def _in_region(self, place: tuple[int, ...], lookups: Sequence[Lookup], at: Columns) -> Value:
        """The pieces at rows of one region; `place` has the number of the band, and those of the intervals of the lookups."""
        band = self.bands[place[0]]
        if place not in self.pieces:
            self.pieces[place] = [self._pieces(curve, place[1:], lookups) for curve in band.curves]
        values = []
        for number, pieces in zip(band.curves, self.pieces[place], strict=True):
            own = {lookup.name: at[lookup.column] for lookup in lookups if lookup.curve == number}
            values.append(self.curves[number].value(pieces, {**at, **own}))
        return band.mix(at[self.across], values)

    def _pieces(self, number: int, intervals: Sequence[int], lookups: Sequence[Lookup]) -> Pieces:
        own = [(lookup, i) for lookup, i in zip(lookups, intervals, strict=True) if lookup.curve in (None, number)]
        return self.curves[number].pieces({lookup.name: interval(lookup.edges, i) for lookup, i in own})

    def _lookups(self, numbers: Sequence[int]) -> list[Lookup]:
        """One for every free input, for some curves; one for every curve where they are aligned."""
        found = []
        for name in self.free:
            edges = [self.curves[number].edges(name) for number in numbers]
            if name == self._aligned():
                found += [Lookup(name, f"{name} of curve {number}", number, at) for number, at in zip(numbers, edges, strict=True)]
            else:
                found.append(Lookup(name, name, None, np.unique(np.concatenate([np.empty(0), *edges]))))
        return found

    def _aligned(self) -> str | None:
        return None if self.level is None else self.fusion.aligned

    def _within_levels(self, inputs: Columns) -> Columns:
        """Of the words for beyond the outermost level, most act on the weights; only `saturate` and a value move the level itself."""
        if self.level is None:
            return inputs
        below, above = ("continue" if side in ("continue_linear", "zero") else side for side in self.fusion.extrapolation[self.level])
        return {**inputs, self.level: clamped(inputs[self.level], (self.levels[0], self.levels[-1]), (below, above))}

    def _own_places(self, band: Band, lookups: Sequence[Lookup], inputs: Columns) -> dict[str, Array]:
        """Where each curve of a band is looked up along the aligned variable."""
        name = self._aligned()
        if name is None:
            return {}
        marks = {number: np.array(self.curves[number].marks(name)) for number in (*band.between, *band.curves)}
        t = band.position(inputs[self.across])
        here = np.stack([(1 - t) * left + t * right for left, right in zip(*(marks[number] for number in band.between), strict=True)])
        return {lookup.column: aligned(inputs[name], here, marks[lookup.curve]) for lookup in lookups if lookup.curve is not None}


def _bands(model: Body, levels: Array) -> tuple[Array, tuple[Band, ...]]:
    if model.level is None:
        return np.empty(0), (alone(0, 0.0),)
    return bands(levels, model.fusion.extrapolation[model.level], model.fusion)


def level_values(model: Body) -> Array:
    """The levels of the model's curves, ascending, (L,)."""
    return np.array([curve.level for curve in model.curves], dtype=np.float64)


def weight_of(model: Body, segments: Set[str], columns: Columns) -> Array:
    """Weight of segment functions together in the model, (n,): what they count with where they and the others are told.

    The model itself is asked, with these functions put to one and all others to zero: transitions, the way between levels, the share of a
    residual that is carried there, and extrapolation are all in it. With `levels: pchip` weights between levels depend on the values of
    the curves; these are those of such functions.

    Parameters
    ----------
    segments
        Their ids.
    columns
        All inputs of the model by name, each (n,).
    """
    return FusedPieces(_probe(model, segments), list(columns)).values(columns)


def _probe(model: Body, chosen: Set[str]) -> Body:
    """The model with the chosen segment functions put to one and the others to zero."""

    def constant(segment: SegmentFunction) -> SegmentFunction:
        scaling = replace(segment.scaling, y_slope=1.0, y_intercept=float(segment.id in chosen))
        return replace(segment, terms=(), theta=np.empty(0), scaling=scaling)

    return replace(model, curves=tuple(replace(c, segments=tuple(map(constant, c.segments))) for c in model.curves))
