"""Segment functions: scaling, dictionary and term selection put together (M2 section 3.1)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import Segment, SegmentedCurve, SegmentFit, Selection
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.frols import TIE_TOLERANCE, frols, frols_streamed, reads_once
from mapmore_cli.modelling.pieces.recipe import Recipe
from mapmore_cli.modelling.pieces.scaling import placements, scaled
from mapmore_cli.modelling.pieces.segmentation import samples_of
from mapmore_cli.modelling.terms import Expression, NotFinite, dictionary_blocks, dictionary_matrix, parse


def dictionary_inputs(dictionary: Sequence[str]) -> tuple[str, ...]:
    """Quantities that occur in a dictionary, in the order of their names."""
    return tuple(sorted(frozenset[str]().union(*(parse(term).names for term in dictionary))))


def fit_segments(
    curves: Sequence[Curve], segmentation: Sequence[SegmentedCurve], recipe: Recipe, tick: Callable[[], None] = lambda: None
) -> tuple[SegmentFit, ...]:
    """Fit every segment of every training curve; `tick` is called after each.

    Raises
    ------
    DataError
        Where a segment has too few samples, or a term is not finite on its samples.
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
