"""MAPMORE from curves to a model: segment, fit, fuse (M1 section III, M2 section 3).

The stages of the pipeline call the three steps one by one, with files between; cross-validation
calls them in one go.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, IntArray, extremes, give_back
from mapmore_cli.domain.declared import taken
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import (
    FormulaFit,
    Scaling,
    Segment,
    SegmentedCurve,
    SegmentFit,
    Selection,
)
from mapmore_cli.domain.models import CurveFunction, Fusion, Model, Pieces, SegmentFunction, Side
from mapmore_cli.domain.recording import Curve, Quantity, uncertainty_of
from mapmore_cli.domain.results import FitResult, PiecesFit
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.expressions import (
    Expression,
    NotFinite,
    candidate,
    dictionary_blocks,
    dictionary_matrix,
    parse,
)
from mapmore_cli.modelling.expressions.ranged import placed
from mapmore_cli.modelling.frols import TIE_TOLERANCE, frols, frols_streamed, reads_once
from mapmore_cli.modelling.frols.robust import (
    Robust,
    curves_told_apart,
    reweighted,
    standard_errors,
)
from mapmore_cli.modelling.literature.backbone import residual_of
from mapmore_cli.modelling.pieces.recipe import Recipe
from mapmore_cli.modelling.pieces.segmentation import samples_at, segment_curve, training_curves

# share of the segment whose mean stands for an end of the trend, so that the anchor does not hang
# on one noisy sample
END_FRACTION = 0.05
# variables for which all `2^v` corners are tried as origins; beyond, only all-left and all-right
EVERY_CORNER_UP_TO = 3


def placements(
    rule: str, X: Array, y: Array, variables: Sequence[str], sigma: Array | None = None
) -> tuple[Scaling, ...]:
    """Return all scalings of the samples `X`, (n, v), and `y`, (n,), that satisfy a rule; the
    caller keeps the one that errs least. `sigma`, (n,), is the uncertainty of y.

    - `unit_square`: x and y span one unit and the trend passes through the origin, which lies at
      the left or at the right end of each
      variable: scaled data lie in [0, 1] or [-1, 0]. The two are not equivalent for one-term fits,
      since left-anchored powers of a falling curve are concave and right-anchored ones convex.
    - `max_abs`: division by the largest magnitude, no offset.
    - `none`: data as they are.
    """
    names, count = tuple(variables), len(variables)
    if rule == "unit_square":
        every = (
            product((False, True), repeat=count)
            if count <= EVERY_CORNER_UP_TO
            else [(False,) * count, (True,) * count]
        )
        return tuple(_anchored(X, y, names, right, sigma) for right in every)
    slope, y_slope = np.ones(count), 1.0
    if rule == "max_abs":
        slope, y_slope = 1 / _span(np.abs(X).max(axis=0)), float(_span(np.abs(y).max()))
    elif rule != "none":
        raise ValueError(f"unknown scaling rule {rule!r}: unit_square, max_abs or none")
    return (Scaling(rule, "-", names, slope, np.zeros(count), y_slope, 0.0),)


def _anchored(
    X: Array, y: Array, variables: tuple[str, ...], right: tuple[bool, ...], sigma: Array | None
) -> Scaling:
    low, high = X.min(axis=0), X.max(axis=0)
    slope, anchor = 1 / _span(high - low), np.where(right, high, low)
    y_anchor = 0.0
    # mean over the samples nearest to the anchor; all at the same distance count, so the order of
    # rows does not matter
    if variables:
        far = np.zeros(len(y))
        for x, at, steepness in zip(X.T, anchor, slope, strict=True):
            distance = x - at
            np.abs(distance, out=distance)
            np.maximum(far, np.multiply(distance, steepness, out=distance), out=far)
        nearest = max(1, int(np.ceil(END_FRACTION * len(y))))
        near = far <= np.partition(far, nearest - 1)[nearest - 1]
        weights = None if sigma is None else sigma[near] ** -2.0
        y_anchor = float(y[near].mean() if weights is None else np.average(y[near], None, weights))
    place = ",".join("right" if r else "left" for r in right) or "-"
    return Scaling(
        "unit_square", place, variables, slope, -slope * anchor, float(_span(np.ptp(y))), y_anchor
    )


def _span(width: ArrayLike) -> Array:
    """Return widths to divide by; a constant variable stays as it is."""
    return np.where(np.asarray(width) > 0, width, 1.0)


def scaled_inputs(scaling: Scaling, columns: Columns) -> dict[str, Array]:
    """Return independent variables in scaled coordinates, `z = slope x + intercept` (M2 eq 8)."""
    return {
        name: columns[name] * m + c
        for name, m, c in zip(scaling.variables, scaling.slope, scaling.intercept, strict=True)
    }


def quantities_in(terms: Iterable[Expression]) -> tuple[str, ...]:
    """Return the quantities that occur in some terms, in the order of their names."""
    return tuple(sorted(frozenset[str]().union(*(term.names for term in terms))))


def segment(
    curves: Sequence[Curve], recipe: Recipe, backbone: FormulaFit | None = None
) -> tuple[SegmentedCurve, ...]:
    """Cut every training curve: by its measured course, or (`optimal`) by what the fits of its
    segments would leave.

    Raises DataError where a segment holds no sample, or a curve has too few for the cut.
    """
    terms = [candidate(text) for text in recipe.dictionary]
    # losses that leave samples out do not compare
    recipe = replace(recipe, fit=replace(recipe.fit, loss="squares", scale="auto"))
    training = training_curves(curves, recipe.level is not None)
    fitted = {curve.id: residual_of(curve, recipe.target, backbone) for curve in training}

    def cost(curve: Curve, rows: IntArray) -> float:
        if len(rows) <= recipe.fit.max_terms:
            return float("inf")
        trial = Segment(f"{curve.id}/trial", curve.id, (), rows)
        trial_fit = fit_segment(trial, fitted[curve.id].columns, terms, recipe)
        return trial_fit.selection.sse * trial_fit.scaling.y_slope**2

    return tuple(segment_curve(curve, recipe.cuts, recipe.target, cost) for curve in training)


def fit(
    curves: Sequence[Curve],
    segmentation: Sequence[SegmentedCurve],
    recipe: Recipe,
    backbone: FormulaFit | None = None,
    tick: Callable[[], None] = lambda: None,
) -> tuple[SegmentFit, ...]:
    """Fit every segment of every training curve, to what the backbone leaves where there is one;
    `tick` is called after each.

    Raises DataError where a segment has too few samples, or a term is not finite on its samples.
    """
    fitted = {
        curve.id: residual_of(curve, recipe.target, backbone)
        for curve in training_curves(curves, recipe.level is not None)
    }
    terms = [candidate(text) for text in recipe.dictionary]
    fits = []
    for segmented in segmentation:
        curve = fitted[segmented.curve]
        for one in segmented.segments:
            groups = _curves_of(one.rows, curves, curve)
            fits.append(fit_segment(one, curve.columns, terms, recipe, groups))
            tick()
    return tuple(fits)


def residuals(
    curves: Sequence[Curve],
    segmentation: Sequence[SegmentedCurve],
    fits: Sequence[SegmentFit],
    recipe: Recipe,
    backbone: FormulaFit | None = None,
) -> Iterator[tuple[IntArray, Array, Array, Array]]:
    """Yield for each segment the rows of its samples, counted over all curves in a row, what its
    own function leaves of the target, the uncertainty and the target, (n,) each.
    """
    fit_of, whole = {one.id: one for one in fits}, {curve.id: curve for curve in curves}
    starts = dict(zip(whole, np.cumsum([0, *(curve.size for curve in curves)]), strict=False))
    training = {one.id: one for one in training_curves(curves, recipe.level is not None)}
    for segmented in segmentation:
        curve = residual_of(training[segmented.curve], recipe.target, backbone)
        for one in segmented.segments:
            own, columns = fit_of[one.id], {n: x[one.rows] for n, x in curve.columns.items()}
            z, y = scaled_inputs(own.scaling, columns), columns[recipe.target]
            P = dictionary_matrix(list(map(parse, own.terms)), z, len(y))
            fitted = own.scaling.y_slope * (P @ own.selection.theta) + own.scaling.y_intercept
            sigma = columns.get(uncertainty_of(recipe.target), np.ones(len(y)))
            yield one.rows + starts.get(segmented.curve, 0), y - fitted, sigma, y


def _curves_of(rows: IntArray, curves: Sequence[Curve], curve: Curve) -> IntArray | None:
    """Return which residuals go together, (n,): those of a curve where several are pooled, else
    those of a recording; None where all are of one.
    """
    if all(one.id != curve.id for one in curves):
        return np.searchsorted(np.cumsum([one.size for one in curves]), rows, side="right")
    return None if curve.origin is None or len(curve.recordings) < 2 else curve.origin[rows]


def fit_segment(
    segment: Segment,
    columns: Columns,
    terms: Sequence[Expression],
    recipe: Recipe,
    groups: IntArray | None = None,
) -> SegmentFit:
    """Choose and fit the terms of one segment, for every placement of its scaling; the least
    training SSE wins, the first of equals. `columns` are those of its curve.

    All placements share the slope of y, so their scaled SSE compare. Rows are sorted first: the
    numbers then do not depend on the order in which a logger wrote them. `groups` says which
    residuals go together, (n,) for the rows of the segment.
    """
    n, most = len(segment.rows), recipe.fit.max_terms
    if n <= most:
        ways = (
            f"use fewer segments, join them by `min_samples: {most + 1}`, keep more samples "
            "of this curve"
        )
        what = f"segment {segment.id}: {n} training sample(s), too few for {most} term(s)"
        raise DataError(what, f"{ways}, or set fit.max_terms below {max(2, n)}")
    variables, unsure = quantities_in(terms), uncertainty_of(recipe.target)
    given = [unsure] if unsure in columns else []
    samples = samples_at(columns, segment.rows, (*variables, recipe.target, *given))
    order = np.lexsort([samples[name] for name in (*given, recipe.target, *variables[::-1])])
    X, y = np.empty((n, len(variables)), order="F"), samples[recipe.target][order]
    for place, name in enumerate(variables):
        X[:, place] = samples.pop(name)[order]
    sigma = samples[unsure][order] if given else None
    groups = None if groups is None else groups[order]
    del samples, order  # of a long record they take more than all else
    give_back(segment.rows)
    return _SegmentSamples(segment, recipe, terms, variables, X, y, sigma).fitted(groups)


@dataclass(frozen=True)
class _SegmentSamples:
    """The n samples of a segment in canonical order: inputs `X`, (n, v), target `y`, (n,), and its
    standard deviation `sigma`, (n,), where it is known.
    """

    segment: Segment
    recipe: Recipe
    terms: Sequence[Expression]
    variables: tuple[str, ...]
    X: Array
    y: Array
    sigma: Array | None

    def fitted(self, groups: IntArray | None) -> SegmentFit:
        """Return the fit, with standard errors that know which residuals go together."""
        robust, weights = Robust.of(self.recipe.fit), None
        if robust is None:
            best = self.best()
        else:
            best, weights = reweighted(robust, self.best, self._regressors)
        k = len(best.selection.chosen)
        curves, groups = (0, None) if groups is None else curves_told_apart(groups, k)
        if robust is None and groups is None:
            return best
        blocks = partial(self._blocks, best)
        errors = standard_errors(blocks, best.selection.theta, groups, robust, weights)
        return replace(best, selection=replace(best.selection, theta_error=errors, curves=curves))

    def best(self, weights: Array | None = None) -> SegmentFit:
        """Return the best placement with its terms, with `weights` of the samples, (n,)."""
        recipe, sigma = self.recipe, self.sigma
        if weights is not None:
            sigma = (1.0 if sigma is None else sigma) / np.sqrt(weights)
        best: SegmentFit | None = None
        for scaling in placements(recipe.fit.scaling, self.X, self.y, self.variables, sigma):
            z = self._scaled(scaling)
            written = placed(
                recipe.dictionary, tuple((name, *extremes(values)) for name, values in z.items())
            )
            try:
                selection = _selected_terms(
                    self.terms if written == recipe.dictionary else list(map(parse, written)),
                    z,
                    (self.y - scaling.y_intercept) / scaling.y_slope,
                    sigma,
                    recipe,
                )
            except NotFinite as error:
                remedy = (
                    "terms are evaluated in the segment's scaled coordinates; set fit.scaling: "
                    "none, or leave the term out"
                )
                raise DataError(f"segment {self.segment.id}: {error}", remedy) from error
            if best is None or selection.sse < best.selection.sse * (1 - TIE_TOLERANCE):
                one = self.segment
                best = SegmentFit(one.id, one.curve, one.cell, written, scaling, selection)
        assert best is not None
        return best

    def _scaled(self, scaling: Scaling) -> Columns:
        return scaled_inputs(scaling, dict(zip(self.variables, self.X.T, strict=True)))

    def _blocks(self, fit: SegmentFit) -> Iterator[tuple[Array, Array]]:
        """Yield the chosen regressors and the target, in units of the uncertainty."""
        scaling, y = fit.scaling, self.y
        for rows, P in dictionary_blocks(
            list(map(parse, fit.terms)), self._scaled(scaling), len(y)
        ):
            unit = np.ones(1) if self.sigma is None else self.sigma[rows]
            yield P * (scaling.y_slope / unit)[:, None], (y[rows] - scaling.y_intercept) / unit

    def _regressors(self, fit: SegmentFit) -> tuple[Array, Array, BoolArray]:
        P, y = map(np.concatenate, zip(*self._blocks(fit), strict=True))
        return P, y, np.ones(len(y), dtype=np.bool_)


def _selected_terms(
    terms: Sequence[Expression], z: Columns, y: Array, sigma: Array | None, recipe: Recipe
) -> Selection:
    """FROLS on the dictionary, which is never there as a whole where it need not be read more than
    once or twice.
    """
    n, how = len(y), (recipe.fit.max_terms, recipe.fit.tolerance)
    if reads_once(n, len(terms), recipe.fit.max_terms):
        return frols_streamed(
            lambda: ((P, y[rows]) for rows, P in dictionary_blocks(terms, z, n)),
            *how,
            stop=recipe.fit.stop,
            uncertainty=sigma,
        )
    P = dictionary_matrix(terms, z, n)
    return frols(P, y, *how, stop=recipe.fit.stop, uncertainty=sigma)


def fuse(
    name: str,
    curves: Sequence[Curve],
    segmentation: Sequence[SegmentedCurve],
    result: FitResult,
    recipe: Recipe,
    quantities: Mapping[str, Quantity],
) -> Model:
    """Join the segment functions; curves come in the order of their levels.

    All of a residual is carried between levels; `cross_validation` says how much of it is kept.
    """
    backbone, level = result.backbone, recipe.level
    needed = {
        *quantities_in(map(candidate, recipe.dictionary)),
        *recipe.cuts,
        *(() if backbone is None else literature.of(backbone).inputs),
    }
    inputs = tuple(sorted(needed if level is None else {*needed, level}))
    training = {curve.id: curve for curve in training_curves(curves, level is not None)}
    functions = []
    for s in sorted(segmentation, key=lambda s: (s.level is not None, s.level)):
        curve, rows = training[s.curve], {one.id: one.rows for one in s.segments}
        segments = tuple(
            _segment_function(f, samples_at(curve.columns, rows[f.id], s.variables))
            for f in result.segments
            if f.curve == s.curve
        )
        functions.append(
            CurveFunction(
                curve=s.curve,
                level=s.level,
                boundaries=s.boundaries,
                limits={name: s.limits[name] for name in inputs},
                segments=segments,
            )
        )
    several = list(dict.fromkeys(one.curve for one in result.segments if len(one.terms) > 1))
    sides = _extrapolation(recipe, inputs, "saturate" if several else "continue")
    fusion = taken(Fusion, recipe.fuse, extrapolation=sides)
    return Model(
        name=name,
        output=quantities[recipe.target],
        inputs=tuple(quantities[one] for one in inputs),
        body=Pieces(level, tuple(recipe.cuts), tuple(functions), fusion, backbone),
        notes=(*result.notes, *_remarks(recipe, several, sides)),
    )


def build(
    name: str,
    curves: Sequence[Curve],
    recipe: Recipe,
    quantities: Mapping[str, Quantity],
    backbone: FormulaFit | None = None,
) -> Model:
    """Return a model from curves in one go."""
    segmentation = segment(curves, recipe, backbone)
    return fuse(
        name,
        curves,
        segmentation,
        FitResult(PiecesFit(fit(curves, segmentation, recipe, backbone)), backbone),
        recipe,
        quantities,
    )


def _segment_function(fit: SegmentFit, samples: Columns) -> SegmentFunction:
    limits = {name: extremes(values) for name, values in samples.items()}
    return taken(
        SegmentFunction,
        fit.selection,
        id=fit.id,
        cell=fit.cell,
        terms=fit.terms,
        scaling=fit.scaling,
        limits=limits,
    )


def _extrapolation(
    recipe: Recipe, inputs: Sequence[str], default: Side
) -> dict[str, tuple[Side, Side]]:
    """Return the declared behaviour, or the default: `continue` for one-term fits, else `saturate`.

    A polynomial of several terms explodes beyond its data, and while interpolating between levels a
    curve is evaluated past its own end as a matter of course: on a simulated muscle that made a
    validation RMSE of 771 N out of 19.6 N.
    """
    asked = {name: recipe.fuse.beyond(name) for name in inputs}
    return {
        name: (default if below is None else below, default if above is None else above)
        for name, (below, above) in asked.items()
    }


def _remarks(
    recipe: Recipe, several: Sequence[str], sides: Mapping[str, tuple[Side, Side]]
) -> tuple[str, ...]:
    """Return what the user should know about extrapolation, of curves that have segments of several
    terms.
    """
    if not several:
        return ()
    if explosive := sorted(
        name for name, side in sides.items() if "continue" in side and name != recipe.level
    ):
        where = f"{', '.join(explosive)} on {', '.join(several)}"
        return (
            f"segments of several terms continue beyond their data along {where}: polynomials "
            "explode there; consider saturate",
        )
    return (
        "segments have several terms, so each curve saturates at the ends of its own range "
        "(fuse.extrapolation)",
    )
