"""Views of models: what all have in common, and what each kind has to show."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any, NamedTuple

from mapmore_cli.cli.views import fitted
from mapmore_cli.cli.views.fitted import View, formula_document, formula_lines, segment_document
from mapmore_cli.domain.models import CurveFunction, CurveRange, Formula, Fusion, Memory, Model, Part, Pieces, StateSpace, Sum
from mapmore_cli.modelling.kinds import equations, kind_of
from mapmore_cli.reporting.table import Column, Table


class Shown(NamedTuple):
    """What a kind shows beside the equations."""

    document: dict[str, Any]
    tables: tuple[Table, ...] = ()
    lines: tuple[str, ...] = ()


def of_model(model: Model) -> View:
    """Return the inputs, what the kind has to show, and the equations; weights, limits and equations are in physical units."""
    found = equations(model)
    inputs = ", ".join(f"{quantity.name} [{quantity.unit}]" for quantity in model.inputs) or "its own past"
    title = f"{model.name}: {model.output.name} [{model.output.unit}] from {inputs}"
    table = Table("equations", title, (Column("piece"), Column("equation")), tuple((one.id, one.text) for one in found))
    shown = _shown(model)
    document = {**_document(model, shown), "equations": [asdict(one) for one in found]}
    return View(document, (table, *shown.tables), (*shown.lines, *model.notes))


def _shown(model: Model) -> Shown:
    word = kind_of(model).name
    shown = SHOWN.get(word, _plain)(model)
    return shown._replace(document={"kind": word, **shown.document})


def _plain(model: Model) -> Shown:
    """Show the body as it is stored, where a kind has nothing of its own to show."""
    return Shown(asdict(model.body))  # type: ignore[call-overload]


def _document(model: Model, shown: Shown) -> dict[str, Any]:
    head = {"name": model.name, "output": asdict(model.output), "inputs": [asdict(quantity) for quantity in model.inputs]}
    return {**head, **shown.document, "notes": model.notes}


def _pieces(model: Model) -> Shown:
    body = model.body
    assert isinstance(body, Pieces)
    document = {
        "level": body.level,
        "segments": [segment_document(segment, segment) for segment in body.segments],
        "backbone": formula_document(body.backbone),
        "cross_validation": [asdict(error) for error in body.cross_validation],
        "weights": _weights(body),
        "limits": _limits(body.ranges),
    }
    return Shown(document, lines=_fusion_lines(body.fusion))


def _formula(model: Model) -> Shown:
    body = model.body
    assert isinstance(body, Formula)
    document = {"level": body.level, "formula": formula_document(body.fit), "limits": _limits(body.ranges)}
    return Shown(document, lines=formula_lines(body.fit))


def _memory(model: Model) -> Shown:
    body = model.body
    assert isinstance(body, Memory)
    document = {"memory": fitted.memory_document(body.model), "backbone": formula_document(body.backbone), "limits": _limits(body.ranges)}
    return Shown(document, fitted.memory_tables(body.model), fitted.memory_lines(body.model))


def _state_space(model: Model) -> Shown:
    body = model.body
    assert isinstance(body, StateSpace)
    document = {"motion": fitted.motion_document(body.motion), "limits": _limits(body.ranges)}
    return Shown(document, lines=fitted.motion_lines(body.motion))


def _sum(model: Model) -> Shown:
    body = model.body
    assert isinstance(body, Sum)
    parts = [(model, _shown(model)) for part in body.parts for model in part.models]
    document = {"parts": [_part(part) for part in body.parts]}
    lines = tuple(f"{model.name}: {line}" for model, shown in parts for line in shown.lines)
    return Shown(document, tuple(table for _, shown in parts for table in shown.tables), lines)


def _part(part: Part) -> dict[str, Any]:
    fed = {"fed": [_part(one) for one in part.fed]} if part.fed else {}
    return {"sign": part.sign, "renamed": part.inputs, **fed, **_document(part.model, _shown(part.model))}


SHOWN: Mapping[str, Callable[[Model], Shown]] = {
    "pieces": _pieces,
    "formula": _formula,
    "memory": _memory,
    "state_space": _state_space,
    "sum": _sum,
}
"""What kinds show of their own, by their names; others are shown as they are stored."""


def _limits(ranges: tuple[CurveRange, ...]) -> dict[str, Any]:
    return {one.curve: one.limits for one in ranges}


def _weights(pieces: Pieces) -> dict[str, Any]:
    return {
        "transition": pieces.fusion.transition,
        "z_s": pieces.fusion.z_s,
        "extrapolation": pieces.fusion.extrapolation,
        "levels": [curve.level for curve in pieces.curves if curve.level is not None],
        "between_levels": pieces.fusion.levels,
        "aligned": pieces.fusion.aligned,
        "thresholds": {curve.curve: curve.threshold for curve in pieces.curves if curve.threshold is not None},
        "shrink": pieces.fusion.shrink,
        "curves": [_curve_weights(pieces, curve) for curve in pieces.curves],
    }


def _curve_weights(pieces: Pieces, curve: CurveFunction) -> dict[str, Any]:
    """Boundaries of the segments, and start and end of the transition zone at each inner one (M2 eq 10-11)."""
    from mapmore_cli.modelling.pieces.definition import zones

    boundaries = dict(zip(pieces.variables, curve.boundaries, strict=True))
    at = {name: [list(zone) for zone in zip(*zones(ends, pieces.fusion.z_s), strict=True)] for name, ends in boundaries.items()}
    return {"id": curve.curve, "level": curve.level, "boundaries": boundaries, "zones": at}


def _fusion_lines(fusion: Fusion) -> tuple[str, ...]:
    sides = "; ".join(f"{name}: {below} below, {above} above" for name, (below, above) in fusion.extrapolation.items())
    between = fusion.levels + (f", aligned at the threshold along {fusion.aligned}" if fusion.aligned else "")
    carried = f", {fusion.shrink:.0%} of the residual midway" if fusion.shrink < 1 else ""
    return (f"Transition: {fusion.transition}, z_s = {fusion.z_s:g}. Between levels: {between}{carried}. Extrapolation: {sides}.",)


def of_adapted(model: Model, path: str) -> View:
    """Return the scales of a specimen, and the file that was written."""
    fit = model.backbone
    assert fit is not None
    rows = tuple((name, fit.parameters[name], fit.errors[name]) for name in fit.parameters)
    columns = (Column("scale"), Column("value"), Column("standard error"))
    document = {"model": path, "parameters": fit.parameters, "errors": fit.errors, "samples": fit.samples, "notes": model.notes}
    return View(document, (Table("adapted", f"{model.name}, adapted", columns, rows, model.notes),), (f"model: {path}",))
