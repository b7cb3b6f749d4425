"""Views of fits and models."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from mapmore_cli.cli.views import remembering
from mapmore_cli.cli.views.view import View

if TYPE_CHECKING:
    from mapmore_cli.domain.fits import FormulaFit, SegmentFit, Selection
    from mapmore_cli.domain.models import CurveFunction, Fusion, Model, SegmentFunction
    from mapmore_cli.domain.results import FitResult


def of_fit(result: FitResult) -> View:
    """The segments, or the model with memory, with their terms in the order of selection; theta is in scaled coordinates."""
    from mapmore_cli.reporting.tables import terms_table

    document = {
        "segments": [_segment(fit, fit.selection) for fit in result.pieces],
        "memory": remembering.fit_document(result.memory),
        "backbone": _formula(result.backbone),
        "notes": result.notes,
    }
    tables = [terms_table(result)] if result.pieces else []
    tables += remembering.fit_tables(result.memory) if result.memory is not None else ()
    return View(document, tuple(tables), (*_formula_lines(result.backbone), *result.notes))


def of_model(model: Model) -> View:
    """The segments, and how they are joined; weights, limits and equations are in physical units."""
    from mapmore_cli.modelling.equations import model_equations
    from mapmore_cli.reporting.tables import Column, Table

    equations = model_equations(model)
    document = {
        "name": model.name,
        "output": asdict(model.output),
        "inputs": [asdict(quantity) for quantity in model.inputs],
        "level": model.level,
        "segments": [_segment(segment, segment) for curve in model.curves for segment in curve.segments],
        "memory": remembering.model_document(model.memory),
        "backbone": _formula(model.backbone),
        "cross_validation": [asdict(error) for error in model.cross_validation],
        "weights": _weights(model),
        "limits": {curve.curve: curve.limits for curve in model.curves},
        "equations": [asdict(equation) for equation in equations],
        "notes": model.notes,
    }
    inputs = ", ".join(f"{quantity.name} [{quantity.unit}]" for quantity in model.inputs) or "its own past"
    title = f"{model.name}: {model.output.name} [{model.output.unit}] from {inputs}"
    table = Table("equations", title, (Column("piece"), Column("equation")), tuple((equation.id, equation.text) for equation in equations))
    tables = (table, *(one for memory in model.memories for one in remembering.model_tables(memory)))
    lines = _fusion_lines(model.fusion) if model.memory is None else ()
    return View(document, tables, (*lines, *remembering.running_lines(model), *model.notes))


def _segment(named: SegmentFit | SegmentFunction, found: Selection | SegmentFunction) -> dict[str, Any]:
    return {
        "id": named.id,
        "terms": named.terms,
        "theta": found.theta,
        "theta_error": found.theta_error,
        "g": found.g,
        "err": found.err,
        "scaling": asdict(named.scaling),
        "samples": found.samples,
        "stop": found.stop,
        "condition": found.condition,
    }


def _formula(formula: FormulaFit | None) -> dict[str, Any] | None:
    return None if formula is None else asdict(formula)


def _weights(model: Model) -> dict[str, Any]:
    return {
        "transition": model.fusion.transition,
        "z_s": model.fusion.z_s,
        "extrapolation": model.fusion.extrapolation,
        "levels": [curve.level for curve in model.curves if curve.level is not None],
        "between_levels": model.fusion.levels,
        "aligned": model.fusion.aligned,
        "thresholds": {curve.curve: curve.threshold for curve in model.curves if curve.threshold is not None},
        "shrink": model.fusion.shrink,
        "curves": [_curve_weights(model, curve) for curve in model.curves],
    }


def _curve_weights(model: Model, curve: CurveFunction) -> dict[str, Any]:
    """Boundaries of the segments, and start and end of the transition zone at each inner one (M2 eq 10-11)."""
    from mapmore_cli.modelling.pieces.weights import zones

    boundaries = dict(zip(model.variables, curve.boundaries, strict=True))
    at = {name: [list(zone) for zone in zip(*zones(ends, model.fusion.z_s), strict=True)] for name, ends in boundaries.items()}
    return {"id": curve.curve, "level": curve.level, "boundaries": boundaries, "zones": at}


def _formula_lines(formula: FormulaFit | None) -> tuple[str, ...]:
    if formula is None:
        return ()
    parameters = ", ".join(f"{name} = {value:.6g}" for name, value in formula.parameters.items())
    return (f"{formula.name} ({formula.status.replace('_', ' ')}, {formula.method}): {parameters}",)


def _fusion_lines(fusion: Fusion) -> tuple[str, ...]:
    sides = "; ".join(f"{name}: {below} below, {above} above" for name, (below, above) in fusion.extrapolation.items())
    between = fusion.levels + (f", aligned at the threshold along {fusion.aligned}" if fusion.aligned else "")
    carried = f", {fusion.shrink:.0%} of the residual midway" if fusion.shrink < 1 else ""
    return (f"Transition: {fusion.transition}, z_s = {fusion.z_s:g}. Between levels: {between}{carried}. Extrapolation: {sides}.",)
