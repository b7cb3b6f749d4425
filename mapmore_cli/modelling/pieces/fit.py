"""Scaling of a segment's data before term selection (M1 step 1, M2 step i)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import product
from typing import TypeVar

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns, Value
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import Scaling, Segment, SegmentedCurve, SegmentFit, Selection
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.expressions import Expression, NotFinite, dictionary_blocks, dictionary_matrix, parse
from mapmore_cli.modelling.frols import TIE_TOLERANCE, frols, frols_streamed, reads_once
from mapmore_cli.modelling.pieces.recipe import Recipe
from mapmore_cli.modelling.pieces.segmentation import samples_of

V = TypeVar("V", Array, Value)

END_FRACTION = 0.05
"""Share of the segment whose mean stands for an end of the trend, so that the anchor does not hang on one noisy sample."""

EVERY_CORNER_UP_TO = 3
"""Variables for which all `2^v` corners are tried as origins; beyond, only all-left and all-right."""


def placements(rule: str, X: Array, y: Array, variables: Sequence[str]) -> tuple[Scaling, ...]:
    """Return all scalings that satisfy a rule; the caller keeps the one with the least training error.

    - `unit_square`: x and y span one unit and the trend passes through the origin, which lies at the left or at the right end of each
      variable: scaled data lie in [0, 1] or [-1, 0]. The two are not equivalent for one-term fits, since left-anchored powers of a
      falling curve are concave and right-anchored ones convex.
    - `max_abs`: division by the largest magnitude, no offset.
    - `none`: data as they are.

    - `X`: independent variables, (n, v).
    - `y`: dependent variable, (n,).
    """
    names = tuple(variables)
    count = len(names)
    if rule == "unit_square":
        return tuple(_anchored(X, y, names, right) for right in _corners(count))
    slope, y_slope = np.ones(count), 1.0
    if rule == "max_abs":
        slope, y_slope = 1 / _span(np.abs(X).max(axis=0)), float(_span(np.abs(y).max()))
    elif rule != "none":
        raise ValueError(f"unknown scaling rule {rule!r}: unit_square, max_abs or none")
    return (Scaling(rule, "-", names, slope, np.zeros(count), y_slope, 0.0),)


def _corners(count: int) -> list[tuple[bool, ...]]:
    if count > EVERY_CORNER_UP_TO:
        return [(False,) * count, (True,) * count]
    return list(product((False, True), repeat=count))


def _anchored(X: Array, y: Array, variables: tuple[str, ...], right: tuple[bool, ...]) -> Scaling:
    low, high = X.min(axis=0), X.max(axis=0)
    slope = 1 / _span(high - low)
    anchor = np.where(right, high, low)
    return Scaling(
        rule="unit_square",
        placement=",".join("right" if r else "left" for r in right) or "-",
        variables=variables,
        slope=slope,
        intercept=-slope * anchor,
        y_slope=float(_span(y.max() - y.min())),
        y_intercept=_end_value(np.abs(X - anchor) * slope, y),
    )


def _end_value(distance: Array, y: Array) -> float:
    """Return the mean of y over the samples nearest to the anchor; all at the same distance count, so the order of rows does not matter."""
    if distance.shape[1] == 0:
        return 0.0
    far = distance.max(axis=1)
    nearest = max(1, int(np.ceil(END_FRACTION * len(y))))
    return float(y[far <= np.partition(far, nearest - 1)[nearest - 1]].mean())


def _span(width: Array) -> Array:
    """Return widths to divide by; a constant variable stays as it is."""
    return np.where(width > 0, width, 1.0)


def scaled(scaling: Scaling, columns: Mapping[str, V]) -> dict[str, V]:
    """Return independent variables in scaled coordinates, `z = slope x + intercept` (M2 eq 8)."""
    return {name: columns[name] * m + c for name, m, c in zip(scaling.variables, scaling.slope, scaling.intercept, strict=True)}


def dictionary_inputs(dictionary: Sequence[str]) -> tuple[str, ...]:
    """Quantities that occur in a dictionary, in the order of their names."""
    return tuple(sorted(frozenset[str]().union(*(parse(term).names for term in dictionary))))


def fit_segments(
    curves: Sequence[Curve], segmentation: Sequence[SegmentedCurve], recipe: Recipe, tick: Callable[[], None] = lambda: None
) -> tuple[SegmentFit, ...]:
    """Fit every segment of every training curve; `tick` is called after each.

    Raises DataError where a segment has too few samples, or a term is not finite on its samples.
    """
    by_id = {curve.id: curve for curve in curves}
    terms = [parse(text) for text in recipe.dictionary]
    fits = []
    for segmented in segmentation:
        for segment in segmented.segments:
            fits.append(fit_segment(segment, samples_of(by_id[segmented.curve], segment.rows), terms, recipe))
            tick()
    return tuple(fits)


def fit_segment(segment: Segment, samples: Columns, terms: Sequence[Expression], recipe: Recipe) -> SegmentFit:
    """Choose and fit the terms of one segment, for every placement of its scaling; the least training SSE wins, the first of equals.

    All placements share the slope of y, so their scaled SSE compare.

    Rows are sorted first: the numbers then do not depend on the order in which a logger wrote them.
    """
    if len(segment.rows) <= recipe.fit.most_terms:
        raise DataError(
            f"segment {segment.id}: {len(segment.rows)} training sample(s), too few for {recipe.fit.most_terms} term(s)",
            f"use fewer segments, join them by `min_samples: {recipe.fit.most_terms + 1}`, keep more samples of this curve, or set "
            f"fit.max_terms below {max(2, len(segment.rows))}",
        )
    variables = sorted(frozenset[str]().union(*(term.names for term in terms)))
    X = np.column_stack([samples[name] for name in variables]) if variables else np.empty((len(segment.rows), 0))
    y = samples[recipe.target]
    order = np.lexsort((y, *X.T[::-1]))
    X, y = X[order], y[order]
    best: SegmentFit | None = None
    for scaling in placements(recipe.fit.scaling, X, y, variables):
        z = scaled(scaling, dict(zip(variables, X.T, strict=True)))
        with _located(segment):
            selection = _selection(terms, z, (y - scaling.y_intercept) / scaling.y_slope, recipe)
        if best is None or selection.sse < best.selection.sse * (1 - TIE_TOLERANCE):
            best = SegmentFit(segment.id, segment.curve, segment.cell, recipe.dictionary, scaling, selection)
    assert best is not None
    return best


def _selection(terms: Sequence[Expression], z: Columns, y: Array, recipe: Recipe) -> Selection:
    """FROLS on the dictionary, which is never there as a whole where it need not be read more than once or twice."""
    n = len(y)
    how = (recipe.fit.most_terms, recipe.fit.tolerance)
    if reads_once(n, len(terms), recipe.fit.most_terms):
        return frols_streamed(lambda: ((P, y[rows]) for rows, P in dictionary_blocks(terms, z, n)), *how, stop=recipe.fit.stop)
    return frols(dictionary_matrix(terms, z, n), y, *how, stop=recipe.fit.stop)


@contextmanager
def _located(segment: Segment) -> Iterator[None]:
    try:
        yield
    except NotFinite as error:
        raise DataError(
            f"segment {segment.id}: {error}",
            "terms are evaluated in the segment's scaled coordinates; set fit.scaling: none, or leave the term out",
        ) from error
