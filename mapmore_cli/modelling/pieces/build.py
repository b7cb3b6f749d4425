"""Build a MAPMORE model from curves: segment, fit, fuse (M1 section III, M2 section 3).

The stages of the pipeline call the three steps separately and store the results in between;
cross-validation calls `build`, which does all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from mapmore_cli.domain.arrays import (
    LONG,
    WIDE,
    Array,
    Columns,
    IntArray,
    Rows,
    columns_at,
    extremes,
    give_back,
    picked,
    row_blocks,
    row_numbers,
)
from mapmore_cli.domain.declared import from_fields
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import (
    FormulaFit,
    Scaling,
    Segment,
    SegmentedCurve,
    SegmentFit,
)
from mapmore_cli.domain.joining import Fusion, Side
from mapmore_cli.domain.models import CurveFunction, Model, Pieces, SegmentFunction
from mapmore_cli.domain.recording import Curve, Quantity, uncertainty_of
from mapmore_cli.domain.results import FitResult, PiecesFit
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.expressions import (
    Expression,
    NotFinite,
    candidate,
    dictionary_block,
    dictionary_matrix,
    parse,
)
from mapmore_cli.modelling.expressions.ranged import placed
from mapmore_cli.modelling.expressions.syntax import names_in
from mapmore_cli.modelling.frols import TIE_TOLERANCE, Regression
from mapmore_cli.modelling.frols.correlated import MOST
from mapmore_cli.modelling.frols.engine import choose, choose_together, reads_once
from mapmore_cli.modelling.frols.select import Stopping
from mapmore_cli.modelling.frols.weighing import (
    FREEDOM,
    LARGEST_TUNING,
    SHORT,
    Choice,
    Weighing,
    gross_outlier,
    loss_weights,
)
from mapmore_cli.modelling.literature.backbone import residual_of
from mapmore_cli.modelling.pieces.placement import placements, span
from mapmore_cli.modelling.pieces.recipe import Recipe
from mapmore_cli.modelling.pieces.remarks import beyond_remarks
from mapmore_cli.modelling.pieces.segmentation import (
    samples_at,
    scaled_inputs,
    segment_curve,
    training_curves,
)
from mapmore_cli.modelling.pieces.shaped import shaped


def quantities_in(terms: Iterable[Expression]) -> tuple[str, ...]:
    """Return the quantities that occur in the terms, in alphabetical order."""
    return tuple(sorted(names_in(terms)))


def segment(
    curves: Sequence[Curve],
    recipe: Recipe,
    backbone: FormulaFit | None = None,
    also: Sequence[str] = (),
) -> tuple[SegmentedCurve, ...]:
    """Cut every training curve into segments. The method of the recipe finds the boundaries from
    the measured values, or, with `optimal`, from the errors of fits. With several outputs (`also`),
    these errors are divided by the range of their output and summed.

    Raises DataError if a segment holds no sample, or if a curve has too few samples for the cut.
    """
    terms = [candidate(text) for text in recipe.dictionary]
    # a robust loss gives each segment different weights, so that errors could not be compared
    recipe = replace(recipe, fit=replace(recipe.fit, loss="squares", scale="auto"))
    recipes = [recipe, *(replace(recipe, target=name) for name in also)]
    training = training_curves(curves, recipe.level is not None)
    fitted = {curve.id: residual_of(curve, recipe.target, backbone) for curve in training}

    def cost(curve: Curve, rows: IntArray) -> float:
        if len(rows) <= min(recipe.fit.max_terms, len(terms)):
            return float("inf")
        trial, columns = Segment(f"{curve.id}/trial", curve.id, (), rows), fitted[curve.id].columns
        _, scalings, choices = _best_placement(trial, columns, terms, recipes)
        spans = [span(np.ptp(columns[each.target])) if also else 1.0 for each in recipes]
        return float(
            sum(
                choice.selection.sse * (scaling.y_slope / span) ** 2
                for choice, scaling, span in zip(choices, scalings, spans, strict=True)
            )
        )

    return tuple(segment_curve(curve, recipe.cuts, recipe.target, cost) for curve in training)


def fit(
    curves: Sequence[Curve],
    segmentation: Sequence[SegmentedCurve],
    recipe: Recipe,
    backbone: FormulaFit | None = None,
    tick: Callable[[], None] = lambda: None,
    also: Sequence[str] = (),
) -> tuple[tuple[SegmentFit, ...], ...]:
    """Fit every segment of every training curve. If there is a backbone, segments are fitted to its
    residual. Return the fits of the target, then those of the outputs in `also`. `tick` is called
    after each segment.

    Raises DataError if a segment has too few samples, or a term is not finite on its samples.
    """
    fitted = {
        curve.id: residual_of(curve, recipe.target, backbone)
        for curve in training_curves(curves, recipe.level is not None)
    }
    terms = [candidate(text) for text in recipe.dictionary]
    recipes = [recipe, *(replace(recipe, target=name) for name in also)]
    single = {curve.id for curve in curves}
    fits = []
    for segmented in segmentation:
        curve = fitted[segmented.curve]
        for part in segmented.segments:
            origin = _labels_of_curves(part.rows, curves, curve, curve.id not in single)
            fits.append(fit_together(part, curve.columns, terms, recipes, origin))
            tick()
    return tuple(zip(*fits, strict=True))


def _labels_of_curves(
    rows: Rows, curves: Sequence[Curve], curve: Curve, pooled: bool
) -> IntArray | None:
    """Return a label for each sample, shape (n,). Residuals of samples with the same label may be
    correlated. If several curves are pooled, the label is the curve of the sample; otherwise, it is
    the recording. Return None if all samples have the same label.
    """
    if pooled:
        ends = np.cumsum([curve.size for curve in curves])
        return np.searchsorted(ends, row_numbers(rows), side="right")
    alone = curve.origin is None or len(curve.recordings) < 2
    return None if alone else np.asarray(picked(curve.origin, rows))


_Placed = tuple[tuple[str, ...], Sequence[Scaling], Sequence[Choice]]
"""The candidates as texts at one placement, and for each output its scaling and the chosen terms.
"""


def fit_together(
    segment: Segment,
    columns: Columns,
    terms: Sequence[Expression],
    recipes: Sequence[Recipe],
    origin: IntArray | None = None,
) -> tuple[SegmentFit, ...]:
    """Choose and fit the terms of one segment at its best placement (`placement.placements`).
    `columns` holds the columns of the segment's curve. The `recipes` differ only in their targets,
    which share terms and placement.

    `origin`, shape (n,), has a label for each row of the segment. Residuals with the same label are
    treated as correlated.
    """
    texts, scalings, choices = _best_placement(segment, columns, terms, recipes, origin)
    return tuple(
        SegmentFit(segment.id, segment.curve, segment.cell, texts, scaling, choice.with_errors())
        for scaling, choice in zip(scalings, choices, strict=True)
    )


def _best_placement(
    segment: Segment,
    columns: Columns,
    terms: Sequence[Expression],
    recipes: Sequence[Recipe],
    origin: IntArray | None = None,
) -> _Placed:
    """Return the placement with the smallest training SSE, and the terms that were chosen for it.
    If several placements are equally good, the first is returned.

    All placements scale y by the same factor (`y_slope`), so that their scaled SSE can be compared.
    If there are at most a million rows, they are sorted first, so that the result does not depend
    on the order in which they were recorded.
    """
    recipe, n = recipes[0], len(segment.rows)
    most = min(recipe.fit.max_terms, len(terms))
    if n <= most:
        ways = (
            f"use fewer segments, join small ones with `min_samples: {most + 1}`, loosen "
            "`data.keep`"
        )
        what = f"segment {segment.id}: {n} training sample(s), too few for {most} term(s)"
        raise DataError(what, f"{ways}, or set fit.max_terms to less than {max(2, n)}")
    variables = quantities_in(terms)
    outputs = [_samples_of(segment, columns, variables, each, origin) for each in recipes]
    robust = recipe.fit.loss != "squares"
    # robust weights differ between placements, so the scale of residuals is compared, not the SSE
    missed = "scale" if robust else "sse"
    ends = {
        name: np.array(extremes(x)) for name, x in zip(variables, outputs[0].inputs, strict=True)
    }
    best: _Placed | None = None
    least = np.inf
    places = zip(*(output.placements(recipe, variables) for output in outputs), strict=True)
    for place, of_outputs in enumerate(places):
        scalings: Sequence[Scaling] = of_outputs
        texts = placed(
            recipe.dictionary,
            tuple((name, *z.tolist()) for name, z in scaled_inputs(scalings[0], ends).items()),
        )
        candidates = terms if texts == recipe.dictionary else list(map(parse, texts))
        try:
            if robust:
                scalings, choices = _robust(candidates, scalings, outputs, recipe, place)
            else:
                choices = _chosen_terms(candidates, scalings, outputs, recipe)
        except NotFinite as error:
            remedy = (
                "terms are evaluated in the scaled coordinates of a segment; set "
                "fit.scaling: none, or remove the term"
            )
            raise DataError(f"segment {segment.id}: {error}", remedy) from error
        left = sum(getattr(choice.selection, missed) for choice in choices)
        if best is None or left < least * (1 - TIE_TOLERANCE):
            least, best = left, (texts, scalings, choices)
    assert best is not None  # there is at least one placement
    return best


# number of samples per term in the fit that finds outliers
SAMPLES_PER_TERM = 3


@dataclass(frozen=True)
class _Samples:
    """Samples of a segment (`inputs` and one output `y`, shape (n,) each) and their weights."""

    inputs: Sequence[Array]
    y: Array
    weighing: Weighing

    def placements(
        self, recipe: Recipe, variables: Sequence[str], robust: Array | None = None
    ) -> tuple[Scaling, ...]:
        """Return all scalings. Samples are weighted by their uncertainty and by the `robust`
        weights.
        """
        sigma, weights = self.weighing.sigma, robust
        if sigma is not None:
            weights = (1.0 if robust is None else robust) / sigma**2
        return placements(recipe.fit.scaling, self.inputs, self.y, variables, weights)

    def blocks(
        self, terms: Sequence[Expression], scaling: Scaling
    ) -> Iterator[tuple[Array, Array]]:
        """Yield the values of the terms and of the output in scaled coordinates, block by block."""
        block_of = dictionary_block(terms)
        for rows in row_blocks(len(self.y)):
            z, target = self.scaled(rows, scaling)
            yield block_of(z, rows), target
            for column in (self.y, *self.inputs) if rows.stop % WIDE == 0 else ():
                give_back(column)

    def scaled(self, rows: slice, scaling: Scaling) -> tuple[dict[str, Array], Array]:
        """Return the inputs by name and the output, for some of the rows, in scaled coordinates."""
        inputs = {name: x[rows] for name, x in zip(scaling.variables, self.inputs, strict=True)}
        return scaled_inputs(scaling, inputs), (
            self.y[rows] - scaling.y_intercept
        ) / scaling.y_slope


def _samples_of(
    segment: Segment,
    columns: Columns,
    variables: Sequence[str],
    recipe: Recipe,
    origin: IntArray | None,
) -> _Samples:
    unsure = uncertainty_of(recipe.target)
    unsure_columns = [unsure] if unsure in columns else []
    samples = samples_at(columns, segment.rows, (*variables, recipe.target, *unsure_columns))
    n = len(samples[recipe.target])
    recorded = np.arange(n) if n <= MOST else None
    if samples[recipe.target].nbytes <= LONG:
        recorded = order = np.lexsort(
            [samples[name] for name in (*unsure_columns, recipe.target, *variables[::-1])]
        )
        samples = columns_at(samples, order)
        origin = None if origin is None else origin[order]
    weighing = Weighing(
        samples[unsure] if unsure_columns else None,
        recipe.fit.loss,
        recipe.fit.known_scale,
        origin,
        recipe.fit.weight == "curve",
        recorded,
    )
    return _Samples([samples[name] for name in variables], samples[recipe.target], weighing)


def _robust(
    terms: Sequence[Expression],
    scalings: Sequence[Scaling],
    outputs: Sequence[_Samples],
    recipe: Recipe,
    place: int,
) -> tuple[Sequence[Scaling], Sequence[Choice]]:
    """Choose a placement and terms that do not depend on single outliers.

    Outliers are found by two robust fits with a free constant. One fit has as many terms as the
    segment, and the other has so many terms that it follows the curve closely. An outlier that
    pulls a fit towards itself is found by a further fit, which leaves this sample out.

    The residuals of each fit give the samples weights, which determine the placement. The terms are
    then chosen twice, starting with these weights or with equal weights. Of all results, the one
    with the smallest scale of the residuals is used.
    """
    free, n, most = [*terms, parse("1")], len(outputs[0].y), recipe.fit.max_terms
    ways = []
    for count in dict.fromkeys((most + 1, max(most + 1, min(len(free), n // SAMPLES_PER_TERM)))):
        more = replace(recipe, fit=replace(recipe.fit, max_terms=count, tolerance=0.0))
        choices, anchored, starting = _chosen_terms(free, scalings, outputs, more), [], []
        for output, scaling, choice in zip(outputs, scalings, choices, strict=True):
            selection = choice.selection
            chosen = [free[i] for i in selection.chosen]
            blocks = output.weighing.rows(partial(output.blocks, chosen, scaling))()
            left = np.concatenate([y - P @ selection.theta for P, y in blocks]) / selection.scale
            outlier = None
            if n <= SHORT:
                every = free if n - len(free) > FREEDOM else chosen
                ((P, y),) = output.weighing.rows(partial(output.blocks, every, scaling))()
                deleted, outlier = gross_outlier(P, y)
                if outlier is not None and abs(left[outlier]) < LARGEST_TUNING:
                    left = deleted
            weighing = output.weighing.without(outlier, loss_weights(recipe.fit.loss, left))
            anchored.append(output.placements(recipe, scaling.variables, weighing.start)[place])
            starting.append(replace(output, weighing=weighing))
        ways += [
            (anchored, _chosen_terms(terms, anchored, some, recipe)) for some in (outputs, starting)
        ]
    return min(ways, key=lambda way: sum(choice.selection.scale for choice in way[1]))


def _chosen_terms(
    terms: Sequence[Expression],
    scalings: Sequence[Scaling],
    outputs: Sequence[_Samples],
    recipe: Recipe,
) -> tuple[Choice, ...]:
    """Return, for each output, the terms that FROLS chooses.

    The dictionary is built block by block if one or two passes over it are enough, so that it is
    never in memory as a whole.
    """
    n, how = len(outputs[0].y), recipe.fit
    stopping = Stopping(how.max_terms, how.tolerance, how.stop)
    weighings = [
        output.weighing.in_unit(scaling.y_slope)
        for output, scaling in zip(outputs, scalings, strict=True)
    ]
    problems = [
        Regression(
            partial(output.blocks, terms, scaling),
            weighing,
            lambda chosen, output=output, scaling=scaling: partial(  # type: ignore[misc]
                output.blocks, [terms[i] for i in chosen], scaling
            ),
        )
        for output, scaling, weighing in zip(outputs, scalings, weighings, strict=True)
    ]
    if len(outputs) > 1 or reads_once(n, len(terms), how.max_terms):
        return choose_together(problems, stopping)
    z, target = outputs[0].scaled(slice(0, n), scalings[0])
    P = dictionary_matrix(terms, z, n)
    choice = choose(P, target, stopping, weighings[0])
    # `only` does not refer to P, so that a wide dictionary is released before the next is built
    return (replace(choice, only=problems[0].of),)


def fuse(
    name: str,
    curves: Sequence[Curve],
    segmentation: Sequence[SegmentedCurve],
    result: FitResult,
    recipe: Recipe,
    quantities: Mapping[str, Quantity],
) -> Model:
    """Join the segment functions to a model, with the curves in the order of their levels.

    If there is a backbone, this function joins the fitted residual in its full size, also between
    levels. Later, `cross_validation` chooses the factor by which it is reduced between levels.
    """
    backbone, level = result.backbone, recipe.level
    needed = {
        *quantities_in(map(candidate, recipe.dictionary)),
        *recipe.cuts,
        *(() if backbone is None else literature.of(backbone).inputs),
    }
    inputs = tuple(sorted(needed if level is None else {*needed, level}))
    training = {curve.id: curve for curve in training_curves(curves, level is not None)}
    fits = {fit.id: fit for fit in result.segments}
    functions = []
    for cut in sorted(segmentation, key=lambda cut: (cut.level is not None, cut.level)):
        segments = tuple(
            _segment_function(
                fits[part.id], samples_at(training[cut.curve].columns, part.rows, cut.variables)
            )
            for part in cut.segments
            if part.id in fits
        )
        functions.append(
            from_fields(CurveFunction, cut.of(inputs), boundaries=cut.boundaries, segments=segments)
        )
    several = any(len(part.terms) > 1 for part in result.segments)
    sides = _extrapolation(recipe, inputs, "saturate" if several else "continue")
    fusion = from_fields(Fusion, recipe.fuse, extrapolation=sides)
    model = Model(
        name=name,
        output=quantities[recipe.target],
        inputs=tuple(quantities[key] for key in inputs),
        body=Pieces(level, tuple(recipe.cuts), tuple(functions), fusion, backbone),
        notes=result.notes,
    )
    return replace(model, notes=(*result.notes, *beyond_remarks(model, curves, recipe)))


def build(
    name: str,
    curves: Sequence[Curve],
    recipe: Recipe,
    quantities: Mapping[str, Quantity],
    backbone: FormulaFit | None = None,
) -> Model:
    """Build a model from curves in one call: segment, fit and fuse."""
    segmentation = segment(curves, recipe, backbone)
    result = FitResult(PiecesFit(*fit(curves, segmentation, recipe, backbone)), backbone)
    model = fuse(name, curves, segmentation, result, recipe, quantities)
    return shaped(model, curves, segmentation, recipe)


def _segment_function(fit: SegmentFit, samples: Columns) -> SegmentFunction:
    limits = {name: extremes(values) for name, values in samples.items()}
    return from_fields(
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
    """Return the declared extrapolation, or the default: `continue` for one-term fits, otherwise
    `saturate`.

    A polynomial with several terms takes extreme values outside its data, and interpolation between
    levels evaluates a curve beyond its own end. For a simulated muscle, the validation RMSE was 771
    N with `continue`, and 19.6 N with `saturate`.
    """
    asked = {name: recipe.fuse.beyond(name) for name in inputs}
    return {
        name: (default if below is None else below, default if above is None else above)
        for name, (below, above) in asked.items()
    }
