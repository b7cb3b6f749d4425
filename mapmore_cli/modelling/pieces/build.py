"""MAPMORE from curves to a model: segment, fit, fuse (M1 section III, M2 section 3).

The stages of the pipeline call the three steps one by one, with files between; cross-validation calls them in one go.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import IntArray
from mapmore_cli.domain.declared import taken
from mapmore_cli.domain.fits import FormulaFit, Scaling, Segment, SegmentedCurve, SegmentFit
from mapmore_cli.domain.models import CurveFunction, Fusion, Model, Pieces, SegmentFunction, Side
from mapmore_cli.domain.recording import Curve, Quantity, united
from mapmore_cli.domain.results import FitResult, PiecesFit
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.expressions import parse
from mapmore_cli.modelling.literature.backbone import residual_of
from mapmore_cli.modelling.pieces.fit import dictionary_inputs, fit_segment, fit_segments
from mapmore_cli.modelling.pieces.levels import threshold
from mapmore_cli.modelling.pieces.recipe import Recipe
from mapmore_cli.modelling.pieces.segmentation import samples_of, segment_curve, training_curves


def model_inputs(recipe: Recipe, backbone: FormulaFit | None) -> tuple[str, ...]:
    """Every quantity that the model needs: of the dictionary, the segmentation, the level and the backbone."""
    names = {*dictionary_inputs(recipe.dictionary), *recipe.cuts}
    if recipe.level is not None:
        names.add(recipe.level)
    if backbone is not None:
        names.update(literature.of(backbone).inputs)
    return tuple(sorted(names))


def segment(curves: Sequence[Curve], recipe: Recipe, backbone: FormulaFit | None = None) -> tuple[SegmentedCurve, ...]:
    """Cut every training curve: by its measured course, or (`optimal`) by what the fits of its segments would leave.

    Raises DataError where a segment holds no sample, or a curve has too few for the cut.
    """
    terms = [parse(text) for text in recipe.dictionary]
    training = training_curves(curves, recipe.level is not None)
    fitted = {curve.id: residual_of(curve, recipe.target, backbone) for curve in training}

    def cost(curve: Curve, rows: IntArray) -> float:
        if len(rows) <= recipe.fit.most_terms:
            return float("inf")
        trial = Segment(f"{curve.id}/trial", curve.id, (), rows)
        found = fit_segment(trial, samples_of(fitted[curve.id], rows), terms, recipe)
        return found.selection.sse * found.scaling.y_slope**2

    return tuple(segment_curve(curve, recipe.cuts, recipe.target, cost) for curve in training)


def fit(
    curves: Sequence[Curve],
    segmentation: Sequence[SegmentedCurve],
    recipe: Recipe,
    backbone: FormulaFit | None = None,
    tick: Callable[[], None] = lambda: None,
) -> tuple[SegmentFit, ...]:
    """Fit every segment, to what the backbone leaves where there is one."""
    pooled = training_curves(curves, recipe.level is not None)
    return fit_segments([residual_of(curve, recipe.target, backbone) for curve in pooled], segmentation, recipe, tick)


def fuse(
    name: str,
    curves: Sequence[Curve],
    segmentation: Sequence[SegmentedCurve],
    result: FitResult,
    recipe: Recipe,
    quantities: Mapping[str, Quantity],
) -> Model:
    """Join the segment functions; curves come in the order of their levels.

    Where the recipe leaves it open how far a residual is carried between levels, all of it is: see `shrinkage`.
    """
    inputs = model_inputs(recipe, result.backbone)
    limits = _segment_limits(curves, segmentation, recipe)
    along = _aligned_variable(recipe, inputs)
    thresholds = _thresholds(curves, recipe, along) if along else {}
    fits: dict[str, list[SegmentFit]] = {}
    for one in result.segments:
        fits.setdefault(one.curve, []).append(one)
    functions = [
        CurveFunction(
            curve=s.curve,
            level=s.level,
            boundaries=s.boundaries,
            limits={i: s.limits[i] for i in inputs},
            segments=tuple(_function(f, limits[f.id]) for f in fits.get(s.curve, ())),
            threshold=thresholds.get(s.curve),
        )
        for s in sorted(segmentation, key=lambda s: (s.level is not None, s.level))
    ]
    share = _share(recipe, result.backbone)
    if recipe.level is None and share != 1.0:
        functions = [replace(function, segments=multiplied(function.segments, share)) for function in functions]
    sides = _extrapolation(recipe, result, inputs)
    fusion = taken(
        Fusion,
        recipe.fuse,
        extrapolation=sides,
        aligned=along,
        shrink=1.0 if recipe.level is None else share,
        domain=_domain(segmentation, recipe, inputs),
    )
    return Model(
        name=name,
        output=quantities[recipe.target],
        inputs=tuple(quantities[i] for i in inputs),
        body=Pieces(recipe.level, tuple(recipe.cuts), tuple(functions), fusion, result.backbone),
        notes=(*result.notes, *_remarks(recipe, result, sides)),
    )


def build(
    name: str, curves: Sequence[Curve], recipe: Recipe, quantities: Mapping[str, Quantity], backbone: FormulaFit | None = None
) -> Model:
    """Return a model from curves in one go."""
    segmentation = segment(curves, recipe, backbone)
    return fuse(name, curves, segmentation, FitResult(PiecesFit(fit(curves, segmentation, recipe, backbone)), backbone), recipe, quantities)


def multiplied(segments: Sequence[SegmentFunction], share: float) -> tuple[SegmentFunction, ...]:
    """Segment functions times a number, which their scalings hold."""

    def scaled(scaling: Scaling) -> Scaling:
        return replace(scaling, y_slope=share * scaling.y_slope, y_intercept=share * scaling.y_intercept)

    return tuple(replace(segment, scaling=scaled(segment.scaling)) for segment in segments)


def _domain(segmentation: Sequence[SegmentedCurve], recipe: Recipe, inputs: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Limits of the whole training domain, for every input but the level, where extrapolation is to begin there."""
    if recipe.fuse.limits == "curve":
        return {}
    whole = united(curve.limits for curve in segmentation)
    return {name: whole[name] for name in inputs if name != recipe.level}


def _share(recipe: Recipe, backbone: FormulaFit | None) -> float:
    """Share of the residual that the recipe asks for; all of it without a backbone, where there is nothing to shrink towards."""
    return 1.0 if backbone is None or recipe.fuse.shrink == "auto" else recipe.fuse.shrink


def _aligned_variable(recipe: Recipe, inputs: Sequence[str]) -> str | None:
    """Return the variable along which thresholds are looked for: the first that is cut, else the first input that is not the level."""
    if recipe.fuse.align == "none" or recipe.level is None:
        return None
    return next(iter([*recipe.cuts, *(name for name in inputs if name != recipe.level)]), None)


def _thresholds(curves: Sequence[Curve], recipe: Recipe, along: str) -> dict[str, float]:
    """Thresholds of the measured curves, also where segments explain what a backbone leaves of them."""
    measured = [(curve.id, samples_of(curve, np.flatnonzero(curve.training))) for curve in curves if curve.training.any()]
    return {name: threshold(samples[along], samples[recipe.target]) for name, samples in measured}


def _segment_limits(
    curves: Sequence[Curve], segmentation: Sequence[SegmentedCurve], recipe: Recipe
) -> dict[str, dict[str, tuple[float, float]]]:
    """Range of every segment's samples along every segmented variable, by the segment's id."""
    by_id = {curve.id: curve for curve in training_curves(curves, recipe.level is not None)}
    ranges = {}
    for segmented in segmentation:
        for one in segmented.segments:
            samples = {name: by_id[segmented.curve].columns[name][one.rows] for name in segmented.variables}
            ranges[one.id] = {name: (float(x.min()), float(x.max())) for name, x in samples.items()}
    return ranges


def _function(fit: SegmentFit, limits: Mapping[str, tuple[float, float]]) -> SegmentFunction:
    chosen = fit.selection
    return SegmentFunction(
        id=fit.id,
        cell=fit.cell,
        terms=fit.terms,
        theta=chosen.theta,
        theta_error=chosen.theta_error,
        g=chosen.g,
        err=chosen.err,
        scaling=fit.scaling,
        samples=chosen.samples,
        condition=chosen.condition,
        stop=chosen.stop,
        limits=limits,
    )


def _extrapolation(recipe: Recipe, result: FitResult, inputs: Sequence[str]) -> dict[str, tuple[Side, Side]]:
    """Return the declared behaviour, or the default: `continue` for one-term fits, else `saturate`.

    A polynomial of several terms explodes beyond its data, and while interpolating between levels a curve is evaluated past its own end
    as a matter of course: on a simulated muscle that made a validation RMSE of 771 N out of 19.6 N.
    """
    default: Side = "saturate" if _several_terms(result) else "continue"
    asked = {name: recipe.fuse.beyond(name) for name in inputs}
    return {name: (default if below is None else below, default if above is None else above) for name, (below, above) in asked.items()}


def _several_terms(result: FitResult) -> list[str]:
    """Curves with a segment of more than one term."""
    return list(dict.fromkeys(one.curve for one in result.segments if len(one.terms) > 1))


def _remarks(recipe: Recipe, result: FitResult, sides: Mapping[str, tuple[Side, Side]]) -> tuple[str, ...]:
    """Return what the user should know about extrapolation."""
    curves = _several_terms(result)
    if not curves:
        return ()
    explosive = sorted(name for name, side in sides.items() if "continue" in side and name != recipe.level)
    if explosive:
        where = f"{', '.join(explosive)} on {', '.join(curves)}"
        return (f"segments of several terms continue beyond their data along {where}: polynomials explode there; consider saturate",)
    return ("segments have several terms, so each curve saturates at the ends of its own range (fuse.extrapolation)",)
