"""Views of what was measured: a dataset, its curves cut up, what `mapmore check` found, and what to measure next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from mapmore_cli.cli.views.fitted import View
from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.domain.results import Candidate, Plan
from mapmore_cli.reporting.table import Cell, Column, Table

if TYPE_CHECKING:
    from mapmore_cli.domain.fits import Segment, SegmentedCurve
    from mapmore_cli.domain.recording import Curve, Dataset
    from mapmore_cli.reporting.table import Cell
    from mapmore_cli.study.inspection.lint import Inspection
    from mapmore_cli.study.inspection.rules import Issue


def of_inspection(inspection: Inspection, unconfirmed: Sequence[str] = ()) -> View:
    """Return the curves if any, then the issues with their remedies, the worst first, and guesses that nobody has confirmed."""
    found = View({}) if inspection.dataset is None else of_dataset(inspection.dataset)
    issues = [asdict(issue) for issue in inspection.issues]
    questions = [f"not confirmed: {question}" for question in unconfirmed]
    lines = _lines(inspection.issues) if inspection.issues or not questions else ()
    document = {**found.document, "issues": issues, "unconfirmed": list(unconfirmed)}
    return View(document, found.tables, (*found.lines, *lines, *questions))


def of_campaign(results: Mapping[str, Inspection | MapmoreError]) -> View:
    """Return the issues of every run, or why it could not be looked at."""
    document: dict[str, Any] = {}
    lines: list[str] = []
    for run, result in results.items():
        if isinstance(result, MapmoreError):
            document[run] = {"error": str(result)}
            lines += [f"{run}:", f"error: {result}"]
        else:
            document[run] = {"issues": [asdict(issue) for issue in result.issues]}
            lines += [f"{run}:", *_lines(result.issues)] if result.issues else [f"{run}: no issues"]
    return View({"runs": document}, (), tuple(lines))


def _lines(issues: Sequence[Issue]) -> tuple[str, ...]:
    if not issues:
        return ("No issues.",)
    blocks = [(f"{issue.severity}: {issue.place}: {issue.message} [{issue.id}]", f"  {issue.remedy}") for issue in issues]
    return tuple(line for block in blocks for line in block)


def of_dataset(dataset: Dataset) -> View:
    """Rows kept and dropped of every recording; the curves with what trains and what validates."""
    from mapmore_cli.reporting.tables import levels_table, recordings_table

    document = {
        "target": dataset.target,
        "level": dataset.level,
        "units": {name: quantity.unit for name, quantity in dataset.quantities.items()},
        "recordings": [
            {"id": r.id, "source": r.source, "rows_read": r.rows_read, "rows_kept": r.rows_kept, "dropped": r.dropped}
            for r in dataset.recordings
        ],
        "curves": [_curve(curve) for curve in dataset.curves],
        "notes": dataset.notes,
    }
    return View(document, (recordings_table(dataset), levels_table(dataset)), dataset.notes)


def _curve(curve: Curve) -> dict[str, Any]:
    held_out = int(curve.held_out.sum())
    return {"id": curve.id, "level": curve.level, "train": curve.size - held_out, "validate": held_out, "recordings": curve.recordings}


def of_segmentation(curves: Sequence[SegmentedCurve]) -> View:
    """Where every segment lies, and how many samples it has."""
    document = {
        "curves": [
            {
                "id": curve.curve,
                "level": curve.level,
                "boundaries": dict(zip(curve.variables, curve.boundaries, strict=True)),
                "limits": curve.limits,
                "segments": [{"id": segment.id, "cell": segment.cell, "n": len(segment.rows)} for segment in curve.segments],
            }
            for curve in curves
        ]
    }
    variables = tuple(dict.fromkeys(name for curve in curves for name in curve.variables))
    columns = (Column("segment"), Column("samples"), *(Column(f"{name} {end}") for name in variables for end in ("from", "to")))
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (segment.id, len(segment.rows), *(end for name in variables for end in _ends(curve, segment).get(name, (None, None))))
        for curve in curves
        for segment in curve.segments
    )
    return View(document, (Table("segments", "Segments", columns, rows),))


def _ends(curve: SegmentedCurve, segment: Segment) -> dict[str, tuple[float, float]]:
    """From where to where a segment goes along each variable that its curve is cut along."""
    cuts = zip(curve.variables, segment.cell, curve.boundaries, strict=True)
    return {name: (float(locations[place - 1]), float(locations[place])) for name, place, locations in cuts}


def of_plan(plan: Plan) -> View:
    """Return a row for every candidate, the best first, and the forecast where one was asked for."""
    document: dict[str, Any] = {
        "name": plan.name,
        "target": plan.target.name,
        "units": {name: quantity.unit for name, quantity in {plan.target.name: plan.target, **plan.quantities}.items()},
        "next": [_document(candidate) for candidate in plan.candidates],
        "widest": plan.widest,
        "until": None,
        "notes": plan.notes,
    }
    lines = []
    if plan.until is not None:
        document["until"] = asdict(plan.until)
        lines.append(_forecast(plan))
    return View(document, (plan_table(plan),), tuple(lines))


def plan_table(plan: Plan) -> Table:
    """Return the candidates in order, with half widths before and after."""
    unit, costs = plan.target.unit, {candidate.cost for candidate in plan.candidates} != {1.0}
    error = "expected error" if plan.candidates[0].kind == "point" else "left-out error"
    columns = [Column("rank"), *(Column(name, quantity.unit, ".4g") for name, quantity in plan.quantities.items()), Column("what")]
    columns += [Column("half width", unit, ".3g"), Column("after", unit, ".3g"), Column(error, unit, ".3g")]
    columns += [Column("cost", "", ".3g")] if costs else []
    rows: list[tuple[Cell, ...]] = []
    for number, one in enumerate(plan.candidates, 1):
        numbers = (one.half_width, one.after, one.error, *([one.cost] if costs else []))
        rows.append((number, *(one.at[name] for name in plan.quantities), one.kind, *numbers))
    return Table("plan", f"What to measure next for {plan.name}, the best first", tuple(columns), tuple(rows), plan.notes)


def _document(candidate: Candidate) -> dict[str, Any]:
    numbers = asdict(candidate)
    return {**numbers.pop("at"), **numbers}


def _forecast(plan: Plan) -> str:
    """Return the forecast in words."""
    assert plan.until is not None
    found, unit = plan.until, plan.target.unit
    wanted = f"a half width of {found.wanted:.3g} {unit} ({100 * found.wanted / plan.largest:.2g} %)"
    if found.more == 0:
        return f"{wanted} is reached: the widest is {found.widest:.3g} {unit}"
    if found.more is None:
        return f"{wanted} is likely out of reach: more measurements bring {found.widest:.3g} to {found.least:.3g} {unit}"
    return f"{wanted}: likely {found.more} more (the widest is {found.widest:.3g} {unit} now)"
