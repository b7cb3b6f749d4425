"""Build a MAPMORE model from curves: segment, fit, fuse (M1 section III, M2 section 3).

The stages of the pipeline call the three steps separately and store the results in between;
cross-validation calls `build`, which does all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import (
    Columns,
    IntArray,
    Rows,
    extremes,
    picked,
    row_numbers,
)
from mapmore_cli.domain.declared import from_fields
from mapmore_cli.domain.fits import (
    FormulaFit,
    Segment,
    SegmentedCurve,
    SegmentFit,
)
from mapmore_cli.domain.joining import Fusion, Side
from mapmore_cli.domain.models import CurveFunction, Model, Pieces, SegmentFunction
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.domain.results import FitResult, PiecesFit
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.expressions import (
    candidate,
)
from mapmore_cli.modelling.literature.backbone import residual_of
from mapmore_cli.modelling.pieces.placement import span
from mapmore_cli.modelling.pieces.recipe import Recipe
from mapmore_cli.modelling.pieces.remarks import beyond_remarks
from mapmore_cli.modelling.pieces.segment_fit import best_placement, fit_together, quantities_in
from mapmore_cli.modelling.pieces.segmentation import (
    samples_at,
    segment_curve,
    training_curves,
)
from mapmore_cli.modelling.pieces.shaped import shaped


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
    # Boundaries are always compared by the errors of least-squares fits, even with a robust loss.
    # The weights of a robust fit depend on the boundaries, so that errors are not comparable.
    recipe = replace(recipe, fit=replace(recipe.fit, loss="squares", scale="auto"))
    recipes = [recipe, *(replace(recipe, target=name) for name in also)]
    training = training_curves(curves, recipe.level is not None)
    fitted = {curve.id: residual_of(curve, recipe.target, backbone) for curve in training}

    def cost(curve: Curve, rows: IntArray) -> float:
        if len(rows) <= min(recipe.fit.max_terms, len(terms)):
            return float("inf")
        trial = Segment(f"{curve.id}/trial", curve.id, (), rows)
        columns = fitted[curve.id].columns
        _, scalings, choices = best_placement(trial, columns, terms, recipes)
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
    correlated. If several curves are pooled into one surface, samples of the same curve have the
    same label; otherwise, samples of the same recording have the same label. Return None if all
    samples would have the same label.
    """
    if pooled:
        ends = np.cumsum([curve.size for curve in curves])
        return np.searchsorted(ends, row_numbers(rows), side="right")
    alone = curve.origin is None or len(curve.recordings) < 2
    return None if alone else np.asarray(picked(curve.origin, rows))


def fuse(
    name: str,
    curves: Sequence[Curve],
    segmentation: Sequence[SegmentedCurve],
    result: FitResult,
    recipe: Recipe,
    quantities: Mapping[str, Quantity],
) -> Model:
    """Join the segment functions into one model. Its curves are in the order of their levels.

    If there is a backbone, the segment functions describe the residual of the backbone. Here, this
    residual is added in full, also between levels. Later, `residual_share` chooses a factor that
    reduces the residual between levels.
    """
    backbone = result.backbone
    level = recipe.level
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
