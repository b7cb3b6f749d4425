"""Results of a run as people and scripts see them: its folder, its files, what a stage found; each
as a JSON document and as tables.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mapmore_cli.cli.console import View, picked
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.models import Formula, Memory, Pieces
from mapmore_cli.domain.scores import RUN_PAGE
from mapmore_cli.modelling.kinds import page_of
from mapmore_cli.reporting.memory_tables import (
    identified_table,
    sizes_table,
    states_table,
)
from mapmore_cli.reporting.score_tables import curve_scores_table, score_table
from mapmore_cli.reporting.table import Column, Table
from mapmore_cli.reporting.tables import levels_table, recordings_table, rival_minima, terms_table
from mapmore_cli.storage import artefacts
from mapmore_cli.storage.run_folder import RESULTS
from mapmore_cli.storage.run_record import load_records, score_row, scores_in, stale_stages

if TYPE_CHECKING:
    from mapmore_cli.domain.fits import (
        FormulaFit,
        MemoryFit,
        MemoryModel,
        SegmentedCurve,
        SegmentFit,
        Selection,
    )
    from mapmore_cli.domain.models import CurveRange, Model, SegmentFunction
    from mapmore_cli.domain.recording import Dataset
    from mapmore_cli.domain.results import FitResult, Validation
    from mapmore_cli.domain.scores import Published, ScoreTable

# Folders and files
# --------------------------------------------------------------------------------------------------


def of_file(path: Path, warn: Callable[[str], None], unverified: bool) -> View:
    """Return what a result file or a run folder holds; DataError where it is neither.

    `warn` is told where nothing shows that a file is as it was written; one that is not is only
    read where it may be `unverified`.
    """
    if path.is_dir():
        return _of_run(path)
    if path.suffix == ".json":
        return _of_json(path)
    view = _of_hdf5(path, warn, unverified)
    stage = next((stage for stage, name in RESULTS.items() if name == path.name), "")
    stale = _stale(path.parent).get(stage)
    return view if stale is None else replace(view, lines=(*view.lines, stale))


def of_stage(stage: str, run_dir: Path) -> View:
    """Return what a stage found."""
    if stage in RESULTS:
        return _of_hdf5(run_dir / RESULTS[stage])
    files = tuple(
        str(path) for path in sorted((run_dir / RUN_PAGE).parent.rglob("*")) if path.is_file()
    )
    return View({"files": files}, lines=page_lines(run_dir) or files)


def _of_run(run_dir: Path) -> View:
    """Return what a run is made of: why each stage ran, and the scores."""
    record = run_dir / "run.json"
    if not record.is_file():
        raise DataError(
            f"{run_dir}: is not a run folder (no run.json)",
            "name a folder that `mapmore run` wrote, as runs/NAME",
        )
    run, stale = _of_json(record), _stale(run_dir)
    document = {**run.document, "stale": list(stale)}
    if not (run_dir / RESULTS["validate"]).is_file():
        return replace(run, document=document, lines=tuple(stale.values()))
    scores = of_stage("validate", run_dir)
    return View(
        {**document, **scores.document},
        (*run.tables, *scores.tables[:1]),
        (*stale.values(), *page_lines(run_dir)),
    )


def _stale(run_dir: Path) -> dict[str, str]:
    """Stages of a run whose results are older than what they were made from, each with a line that
    says so.
    """
    found = stale_stages(load_records(run_dir, lambda _message: None))
    return {
        name: f"{name} is out of date: {before} was done again since; run the spec to renew it"
        for name, before in found.items()
    }


def page_lines(run_dir: Path) -> tuple[str, ...]:
    """Where the page is, for people; nothing where the spec asks for none."""
    page = run_dir / RUN_PAGE
    return (f"page: {page}",) if page.is_file() else ()


def _of_hdf5(
    path: Path, warn: Callable[[str], None] = lambda _message: None, unverified: bool = False
) -> View:
    kind = artefacts.kind_of(path)
    record = getattr(artefacts, f"read_{kind}")(path, warn, unverified)
    shown: dict[str, Callable[[Any], View]] = {
        "dataset": of_dataset,
        "segmentation": _of_segmentation,
        "fit": _of_fit,
    }
    shown |= {"model": _of_model, "validation": _of_validation}
    try:
        return shown[kind](record)
    except (ArithmeticError, LookupError, TypeError, ValueError) as fault:
        raise DataError(
            f"{path}: holds values that do not fit each other ({type(fault).__name__}: {fault})",
            "get a fresh copy, or make it anew",
        ) from fault


def _of_json(path: Path) -> View:
    """`scores.json` or `run.json`, as they are; the table has what fits on a screen."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as fault:
        raise DataError(
            f"{path}: cannot be read ({fault})", "give a file that mapmore wrote"
        ) from fault
    if isinstance(document, dict) and _are_stages(document.get("stages")):
        rows = tuple(
            (name, entry.get("seconds"), entry.get("why"))
            for name, entry in document["stages"].items()
        )
        columns = (Column("stage"), Column("took", "s", ".2f"), Column("why it ran"))
        return View(document, (Table("stages", "Stages", columns, rows),))
    try:
        found = scores_in(document)
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError) as fault:
        raise DataError(
            f"{path}: is neither a scores.json nor a run.json", "give a file that mapmore wrote"
        ) from fault
    return View(document, of_scores(found).tables)


def _are_stages(entries: Any) -> bool:
    """Whether something is the stages of a `run.json`, as far as the table of stages takes from
    them.
    """
    return isinstance(entries, dict) and all(
        isinstance(entry, dict)
        and isinstance(entry.get("seconds"), float | int | None)
        and isinstance(entry.get("why"), str | None)
        for entry in entries.values()
    )


# Scores
# --------------------------------------------------------------------------------------------------


def of_scores(table: ScoreTable, published: Published | None = None) -> View:
    """Return the score rows of every curve in the document; the pooled ones in the table, beside
    what a publication reports.
    """
    rows = [score_row(score) for score in table.scores]
    return View(
        {"scores": rows, "units": table.units},
        (score_table(table.scores, table.units, published, table.failed),),
    )


def _of_validation(validation: Validation) -> View:
    """Return the scores pooled and by curve, and the formulas that were fitted as competitors."""
    pooled = of_scores(validation.table)
    formulas = {name: asdict(formula) for name, formula in validation.formulas.items()}
    lines = [f"warning: {warning}" for warning in validation.warnings]
    lines += [
        told
        for name, formula in validation.formulas.items()
        for told in rival_minima(name, formula)
    ]
    tables = (*pooled.tables, curve_scores_table(validation.scores, validation.units))
    return View(
        {**pooled.document, "formulas": formulas, "warnings": validation.warnings},
        tables,
        tuple(lines),
    )


# Data
# --------------------------------------------------------------------------------------------------


def of_dataset(dataset: Dataset) -> View:
    """Rows kept and dropped of every recording; the curves with what trains and what validates."""
    document = {
        **picked(dataset, "target", "level"),
        "units": {name: quantity.unit for name, quantity in dataset.quantities.items()},
        "recordings": [
            picked(one, "id", "source", "rows_read", "rows_kept", "dropped")
            for one in dataset.recordings
        ],
        "curves": [
            {
                **picked(curve, "id", "level"),
                "train": int(curve.training.sum()),
                "validate": int(curve.held_out.sum()),
                "recordings": curve.recordings,
            }
            for curve in dataset.curves
        ],
        "notes": dataset.notes,
    }
    return View(document, (recordings_table(dataset), levels_table(dataset)), dataset.notes)


def _of_segmentation(curves: Sequence[SegmentedCurve]) -> View:
    """Where every segment lies, and how many samples it has."""
    document = {
        "curves": [
            {
                "id": curve.curve,
                "level": curve.level,
                "boundaries": dict(zip(curve.variables, curve.boundaries, strict=True)),
                "limits": curve.limits,
                "segments": [
                    {"id": segment.id, "cell": segment.cell, "n": len(segment.rows)}
                    for segment in curve.segments
                ],
            }
            for curve in curves
        ]
    }
    variables = tuple(dict.fromkeys(name for curve in curves for name in curve.variables))
    columns = (
        Column("segment"),
        Column("samples"),
        *(Column(f"{name} {end}") for name in variables for end in ("from", "to")),
    )
    rows = []
    for curve in curves:
        for segment in curve.segments:
            cuts = zip(curve.variables, segment.cell, curve.boundaries, strict=True)
            ends = {
                name: (float(locations[place - 1]), float(locations[place]))
                for name, place, locations in cuts
            }
            rows.append(
                (
                    segment.id,
                    len(segment.rows),
                    *(end for name in variables for end in ends.get(name, (None, None))),
                )
            )
    return View(document, (Table("segments", "Segments", columns, tuple(rows)),))


# Fits
# --------------------------------------------------------------------------------------------------


def _of_fit(result: FitResult) -> View:
    """Return the segments, or the model with memory, with their terms in the order of selection;
    theta is in scaled coordinates.
    """
    page = page_of(result.body)
    own, own_tables = page.show_fit(result.body) if page else ({}, ())
    document = {
        "segments": [_segment(fit, fit.selection) for fit in result.pieces],
        "memory": _memory_fit(result.memory),
        "backbone": _formula(result.formula),
        "notes": result.notes,
        **own,
    }
    tables = [terms_table(result)] if result.pieces else []
    if (fit := result.memory) is not None:
        tables += [identified_table(fit)] if fit.identified is not None else []
        tables += [sizes_table(fit)] if fit.held_out is not None else []
        tables += _memory_tables(fit.model)
    tables += own_tables
    return View(document, tuple(tables), (*_formula_lines(result.formula), *result.notes))


def _segment(
    named: SegmentFit | SegmentFunction, found: Selection | SegmentFunction
) -> dict[str, Any]:
    """One segment function; theta is in scaled coordinates."""
    head = {**picked(named, "id", "terms"), **picked(found, "theta", "theta_error", "g", "err")}
    return {
        **head,
        "scaling": asdict(named.scaling),
        **picked(found, "samples", "stop", "condition"),
    }


def _formula(formula: FormulaFit | None) -> dict[str, Any] | None:
    return None if formula is None else asdict(formula)


def _formula_lines(formula: FormulaFit | None) -> tuple[str, ...]:
    """Its parameters in a line, and other minima that fit nearly as well."""
    from mapmore_cli.modelling.literature.own import units_of_parameters

    if formula is None:
        return ()
    units = units_of_parameters(formula)
    parameters = ", ".join(
        f"{name} = {value:.6g} {units.get(name, '')}".rstrip()
        for name, value in formula.parameters.items()
    )
    own = f"{formula.name} ({formula.status.replace('_', ' ')}, {formula.method}): {parameters}"
    return (own, *rival_minima(formula.name, formula))


def _memory_fit(fit: MemoryFit | None) -> dict[str, Any] | None:
    """Return the model as it is stored, with how its terms were found."""
    if fit is None:
        return None
    return {
        **asdict(fit.model),
        "ridge": fit.ridge,
        "forward": [fit.candidates[place] for place in fit.forward],
        "held_out": fit.held_out,
        "identified": None if fit.identified is None else asdict(fit.identified),
    }


def _memory_tables(memory: MemoryModel) -> tuple[Table, ...]:
    """Coefficients with standard errors, and the numbers behind the states where there are any."""
    columns = (
        Column("term"),
        Column("coefficient", "", "#.6g"),
        Column("standard error", "", ".3g"),
    )
    rows = tuple(zip(memory.terms, memory.theta.tolist(), memory.theta_error.tolist(), strict=True))
    constant = (("(constant)", memory.constant, None),) if memory.constant else ()
    scaled = (
        "Coefficients of scaled states."
        if memory.states.scaled
        else "Coefficients in physical units."
    )
    title = f"Coefficients of {memory.output}"
    coefficients = Table("coefficients", title, columns, (*constant, *rows), (scaled,))
    states = states_table(memory.states)
    return (coefficients, states) if states.rows else (coefficients,)


def _memory_line(memory: MemoryModel) -> str:
    """How the model is run."""
    from mapmore_cli.modelling.memory.feedback import fed_back_states

    steps = sorted(fed_back_states(memory.states, memory.output).values())
    first = (
        f"the first {steps[-1]} measured samples"
        if steps and steps[-1] > 1
        else "the first measured sample"
    )
    start = f"from {first} of {memory.output}" if steps else f"without measured {memory.output}"
    return f"Runs free {start}, at steps of {memory.states.step:.6g} s."


# Models
# --------------------------------------------------------------------------------------------------


def _of_model(model: Model) -> View:
    """Return the inputs, what the kind has to show, and the equations; weights, limits and
    equations are in physical units.
    """
    from mapmore_cli.modelling.kinds import equations

    found = equations(model)
    inputs = (
        ", ".join(f"{quantity.name} [{quantity.unit}]" for quantity in model.inputs)
        or "its own past"
    )
    title = f"{model.name}: {model.output.name} [{model.output.unit}] from {inputs}"
    table = Table(
        "equations",
        title,
        (Column("piece"), Column("equation")),
        tuple((one.id, one.text) for one in found),
    )
    shown = shown_model(model)
    document = {**document_of(model, shown), "equations": [asdict(one) for one in found]}
    return View(document, (table, *shown.tables), (*shown.lines, *model.notes))


def document_of(model: Model, shown: View) -> dict[str, Any]:
    """Return a model as JSON: what all have in common, and what its kind shows."""
    head = {
        "name": model.name,
        "output": asdict(model.output),
        "inputs": [asdict(quantity) for quantity in model.inputs],
    }
    return {**head, **shown.document, "notes": model.notes}


def shown_model(model: Model) -> View:
    """Return what a kind shows beside the equations; one that has nothing of its own to show is
    shown as it is stored.
    """
    from mapmore_cli.modelling.kinds import kind_of

    document: dict[str, Any]
    tables: tuple[Table, ...] = ()
    lines: tuple[str, ...] = ()
    match model.body:
        case Pieces() as body:
            document = {
                "level": body.level,
                "segments": [_segment(segment, segment) for segment in body.segments],
                "backbone": _formula(body.backbone),
                "cross_validation": [asdict(error) for error in body.cross_validation],
                "weights": _weights(body),
                "limits": limits_document(body.ranges),
            }
            lines = (_fusion_line(body),)
        case Formula() as body:
            document = {
                "level": body.level,
                "formula": _formula(body.fit),
                "limits": limits_document(body.ranges),
            }
            lines = _formula_lines(body.fit)
        case Memory() as body:
            document = {
                "memory": asdict(body.model),
                "backbone": _formula(body.backbone),
                "limits": limits_document(body.ranges),
            }
            tables, lines = _memory_tables(body.model), (_memory_line(body.model),)
        case body:
            page = kind_of(model).page
            document = {} if page else asdict(body)  # type: ignore[call-overload]
            if page is not None:
                document, tables, lines = page.show(model)
    return View({"kind": kind_of(model).name, **document}, tables, lines)


def limits_document(ranges: tuple[CurveRange, ...]) -> dict[str, Any]:
    """Return the training range of every input, by curve."""
    return {one.curve: one.limits for one in ranges}


def _weights(pieces: Pieces) -> dict[str, Any]:
    """How pieces are joined, with the transition zone, start and end, at each inner boundary of
    every curve (M2 eq 10-11).
    """
    from mapmore_cli.modelling.pieces.definition import zones

    curves = []
    for curve in pieces.curves:
        boundaries = dict(zip(pieces.variables, curve.boundaries, strict=True))
        at = {
            name: [list(zone) for zone in zip(*zones(ends, pieces.fusion.z_s), strict=True)]
            for name, ends in boundaries.items()
        }
        curves.append(
            {"id": curve.curve, "level": curve.level, "boundaries": boundaries, "zones": at}
        )
    return {
        **picked(pieces.fusion, "transition", "z_s", "extrapolation"),
        "levels": [curve.level for curve in pieces.curves if curve.level is not None],
        **picked(pieces.fusion, "between_levels=levels", "shrink"),
        "curves": curves,
    }


def _fusion_line(pieces: Pieces) -> str:
    fusion = pieces.fusion
    sides = "; ".join(
        f"{name}: {below} below, {above} above"
        for name, (below, above) in fusion.extrapolation.items()
    )
    carried = f", {fusion.shrink:.0%} of the residual midway" if fusion.shrink < 1 else ""
    return (
        f"Transition: {fusion.transition}, z_s = {fusion.z_s:g}. Between levels: {fusion.levels}"
        f"{carried}. Extrapolation: {sides}."
    )
