"""MAPMORE from curves to a model: segment, fit, fuse (M1 section III, M2 section 3).

The stages of the pipeline call the three steps one by one, with files between; cross-validation calls them in one go.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from mapmore_cli.domain.fits import FitResult, FormulaFit, SegmentedCurve, SegmentFit
from mapmore_cli.domain.models import CurveFunction, Fusion, Model, SegmentFunction, Side
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.backbone import residual_of
from mapmore_cli.modelling.recipe import Cut, Recipe
from mapmore_cli.modelling.regression import dictionary_inputs, fit_segments
from mapmore_cli.modelling.segmentation import segment_curve, training_curves


def model_inputs(recipe: Recipe, backbone: FormulaFit | None) -> tuple[str, ...]:
    """Every quantity that the model needs: of the dictionary, the segmentation, the level and the backbone."""
    names = {*dictionary_inputs(recipe.dictionary), *recipe.cuts}
    if recipe.level is not None:
        names.add(recipe.level)
    if backbone is not None:
        names.update(literature.get(backbone.name).inputs)
    return tuple(sorted(names))


def segment(curves: Sequence[Curve], cuts: Mapping[str, Cut], by_level: bool) -> tuple[SegmentedCurve, ...]:
    """Cut every training curve."""
    return tuple(segment_curve(curve, cuts) for curve in training_curves(curves, by_level))


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
    segmentation: Sequence[SegmentedCurve],
    result: FitResult,
    recipe: Recipe,
    quantities: Mapping[str, Quantity],
) -> Model:
    """Join the segment functions; curves come in the order of their levels."""
    inputs = model_inputs(recipe, result.backbone)
    fits: dict[str, list[SegmentFit]] = {}
    for one in result.fits:
        fits.setdefault(one.curve, []).append(one)
    curves = [
        CurveFunction(s.curve, s.level, s.boundaries, {i: s.limits[i] for i in inputs}, tuple(_function(f) for f in fits.get(s.curve, ())))
        for s in sorted(segmentation, key=lambda s: (s.level is not None, s.level))
    ]
    sides = _extrapolation(recipe, result, inputs)
    return Model(
        name=name,
        output=quantities[recipe.target],
        inputs=tuple(quantities[i] for i in inputs),
        level=recipe.level,
        variables=tuple(recipe.cuts),
        curves=tuple(curves),
        fusion=Fusion(recipe.transition, recipe.z_s, sides),
        backbone=result.backbone,
        notes=(*result.notes, *_remarks(recipe, result, sides)),
    )


def build(
    name: str, curves: Sequence[Curve], recipe: Recipe, quantities: Mapping[str, Quantity], backbone: FormulaFit | None = None
) -> Model:
    """A model from curves in one go."""
    segmentation = segment(curves, recipe.cuts, recipe.level is not None)
    return fuse(name, segmentation, FitResult(fit(curves, segmentation, recipe, backbone), backbone), recipe, quantities)


def _function(fit: SegmentFit) -> SegmentFunction:
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
    )


def _extrapolation(recipe: Recipe, result: FitResult, inputs: Sequence[str]) -> dict[str, tuple[Side, Side]]:
    """The declared behaviour, or the default: `continue` for one-term fits, else `saturate`.

    A polynomial of several terms explodes beyond its data, and while interpolating between levels a curve is evaluated past its own end
    as a matter of course: on a simulated muscle that made a validation RMSE of 771 N out of 19.6 N.
    """
    default: Side = recipe.beyond if recipe.beyond is not None else "saturate" if _several_terms(result) else "continue"
    asked = {name: recipe.extrapolation.get(name, (None, None)) for name in inputs}
    return {name: (default if below is None else below, default if above is None else above) for name, (below, above) in asked.items()}


def _several_terms(result: FitResult) -> list[str]:
    """Curves with a segment of more than one term."""
    return list(dict.fromkeys(one.curve for one in result.fits if len(one.terms) > 1))


def _remarks(recipe: Recipe, result: FitResult, sides: Mapping[str, tuple[Side, Side]]) -> tuple[str, ...]:
    """What the user should know about extrapolation."""
    curves = _several_terms(result)
    if not curves:
        return ()
    explosive = sorted(name for name, side in sides.items() if "continue" in side and name != recipe.level)
    if explosive:
        where = f"{', '.join(explosive)} on {', '.join(curves)}"
        return (f"segments of several terms continue beyond their data along {where}: polynomials explode there; consider saturate",)
    return ("segments have several terms, so each curve saturates at the ends of its own range (fuse.extrapolation)",)
