"""Show results as a JSON document and as tables: a whole run, one of its files, or one of its
stages.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from mapmore_cli.cli.console import Document, View, members
from mapmore_cli.domain.errors import DataError, Warn
from mapmore_cli.domain.models import Formula, Memory, Outputs, Pieces
from mapmore_cli.domain.results import OutputsFit
from mapmore_cli.domain.scores import OWN
from mapmore_cli.reporting import memory_tables
from mapmore_cli.reporting.fit_tables import (
    coefficients_table,
    outliers_table,
    rival_minima,
    segment_ends,
    terms_table,
)
from mapmore_cli.reporting.order import RUN_PAGE
from mapmore_cli.reporting.score_tables import (
    curve_scores_table,
    pieces_sentence,
    score_table,
    scored,
    verdict_sentence,
)
from mapmore_cli.reporting.sections import shown_by
from mapmore_cli.reporting.table import FROM_TO, Cells, Table
from mapmore_cli.reporting.tables import (
    levels_table,
    limits_tables,
    pieces_table,
    recordings_table,
    sample_counts,
)
from mapmore_cli.storage import artefacts
from mapmore_cli.storage.run_folder import RESULTS, RunFiles
from mapmore_cli.storage.run_record import load_records, stale_stages
from mapmore_cli.storage.scores import score_row, scores_in

if TYPE_CHECKING:
    from mapmore_cli.domain.fits import FormulaFit, MemoryModel, SegmentedCurve, SegmentFit
    from mapmore_cli.domain.models import Model, SegmentFunction
    from mapmore_cli.domain.recording import Dataset
    from mapmore_cli.domain.results import FitResult, Validation
    from mapmore_cli.domain.scores import Published, ScoreTable

# Folders and files
# --------------------------------------------------------------------------------------------------


def of_file(path: Path, warn: Warn, unverified: bool) -> View:
    """Return the view of a result file or a run folder. Raises DataError for any other file or
    folder.

    `warn` is called if no checksum proves that the file is unchanged. A file whose checksum is
    wrong is read only if `unverified` is True, otherwise DataError is raised.
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
    """Return the view of one stage of a run, which the command of this stage prints."""
    if stage in RESULTS:
        return _of_hdf5(run_dir / RESULTS[stage], warn=lambda _message: None, unverified=False)
    paths = sorted((run_dir / RUN_PAGE).parent.rglob("*"))
    files = tuple(str(path) for path in paths if path.is_file())
    return View({"files": files}, lines=page_lines(run_dir) or files)


def _of_run(run_dir: Path) -> View:
    """Return the view of a run: its stages with the reason why each of them ran, and its scores.
    Raises DataError for a folder without `run.json`.
    """
    record = run_dir / "run.json"
    if not record.is_file():
        raise DataError(
            f"{run_dir}: is not a run folder (no run.json)",
            "name a folder that `mapmore run` wrote, for example runs/NAME",
        )
    run, stale = _of_json(record), _stale(run_dir)
    document, lines = {**run.document, "stale": list(stale)}, tuple(stale.values())
    if not (run_dir / RESULTS["validate"]).is_file():
        return View(document, run.tables, lines)
    scores = of_stage("validate", run_dir)
    return View(
        {**document, **scores.document},
        (*run.tables, *of_scores(RunFiles(run_dir).scores()).tables),
        (*lines, *page_lines(run_dir)),
    )


def _stale(run_dir: Path) -> dict[str, str]:
    """Return a warning for each stage of a run that is out of date, because an earlier stage was
    repeated later. The keys are the names of the stages.
    """
    return {
        name: (
            f"{name} is out of date, because {before} was repeated since; run the spec again to "
            "renew it"
        )
        for name, before in stale_stages(load_records(run_dir)).items()
    }


def verdict_lines(run_dir: Path) -> tuple[str, ...]:
    """Return a sentence for each output that compares the error of the run's own model with the
    errors of its competitors. If the model is a formula (the backbone) with pieces, add a sentence
    that compares it with the formula alone.
    """
    files = RunFiles(run_dir)
    table, data, body = files.scores(), files.dataset(), files.model().body
    outputs = zip(table.each, data.each, strict=True)
    verdicts = [
        verdict_sentence(
            output.scores,
            OWN,
            scored(output, formula),
            output.failed,
            output.alert,
            output.warnings,
        )
        for output, formula in outputs
    ]
    formula = body.backbone if isinstance(body, Pieces) else None
    pieces = "" if formula is None else pieces_sentence(table.scores, OWN, formula.name)
    return tuple(filter(None, (*verdicts, pieces)))


def page_lines(run_dir: Path) -> tuple[str, ...]:
    """Return a line with the path of the page of a run. Return an empty tuple if there is no
    page.
    """
    page = run_dir / RUN_PAGE
    return (f"page: {page}",) if page.is_file() else ()


def _of_hdf5(path: Path, warn: Warn, unverified: bool) -> View:
    kind = artefacts.kind_of(path)
    record = getattr(artefacts, f"read_{kind}")(path, warn, unverified)
    try:
        return VIEWS[kind](record)
    except (ArithmeticError, LookupError, TypeError, ValueError) as fault:
        raise DataError(
            f"{path}: contains inconsistent values ({type(fault).__name__}: {fault})",
            "copy the file again, or repeat the run that made it",
        ) from fault


def _of_json(path: Path) -> View:
    """Return the view of `scores.json` or `run.json`. The JSON document has the complete contents
    of the file; the table shows only the most important columns. Raises DataError for any other
    file.
    """
    remedy = "give a file that mapmore wrote"
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as fault:
        raise DataError(f"{path}: cannot be read ({fault})", remedy) from fault
    try:
        if "stages" not in document:
            return View(document, of_scores(scores_in(document)).tables)
        columns = ("stage", "took [s] .2f", "why it ran")
        rows = [
            (str(name), float(entry.get("seconds", "nan")), str(entry.get("why") or ""))
            for name, entry in document["stages"].items()
        ]
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError) as fault:
        raise DataError(f"{path}: is neither a scores.json nor a run.json", remedy) from fault
    return View(document, (Table.of("stages", "Stages", columns, rows),))


# Scores
# --------------------------------------------------------------------------------------------------


def of_scores(table: ScoreTable, published: Published | None = None) -> View:
    """Return the view of the scores. The JSON document contains the scores of every single curve
    and of all curves together. The tables contain only the scores of all curves together, beside
    the numbers of a publication.
    """
    rows = [score_row(score) for score in table.scores]
    pooled = (
        score_table(output.scores, output.units, published, output.failed) for output in table.each
    )
    return View({"scores": rows, "units": table.units}, tuple(pooled))


def _of_validation(validation: Validation) -> View:
    """Return the view of a validation: the scores of all curves together, the scores of every
    single curve, and the formulas that were fitted as competitors.
    """
    if validation.others:
        views = map(_of_validation, validation.each)
        return View(
            *_of_outputs([next(iter(output.units), "") for output in validation.each], views)
        )
    pooled = of_scores(validation.table)
    lines = [f"warning: {warning}" for warning in validation.warnings]
    for name, formula in validation.formulas.items():
        lines += rival_minima(name, formula)
    more = members(validation, "formulas", "warnings", "outliers")
    tables = (*pooled.tables, curve_scores_table(validation.scores, validation.units))
    if validation.outliers:
        tables = (*tables, outliers_table(validation.outliers, *validation.units.values()))
    return View({**pooled.document, **more}, tables, tuple(lines))


# Data
# --------------------------------------------------------------------------------------------------


def of_dataset(dataset: Dataset) -> View:
    """Return the view of a dataset: the numbers of kept and dropped rows of every recording, and
    the numbers of training and held-out samples of every curve.
    """
    curves = [
        {**members(curve, "id", "level", "recordings"), **sample_counts(curve)}
        for curve in dataset.curves
    ]
    keys = ("id", "source", "rows_read", "rows_kept", "dropped")
    document = {
        **members(dataset, "target", "level", "notes"),
        "units": {name: quantity.unit for name, quantity in dataset.quantities.items()},
        "recordings": [members(recording, *keys) for recording in dataset.recordings],
        "curves": curves,
    }
    return View(document, (recordings_table(dataset), levels_table(dataset)), dataset.notes)


def _of_segmentation(curves: Sequence[SegmentedCurve]) -> View:
    """Return the view of a segmentation: the range and the number of samples of every segment."""
    names = list(dict.fromkeys(name for curve in curves for name in curve.variables))
    columns = ("segment", "samples", *(f"{name} {end}" for name in names for end in FROM_TO))
    documents: list[Document] = []
    rows: list[Cells] = []
    for curve in curves:
        segments = [
            {**members(segment, "id", "cell"), "n": len(segment.rows)} for segment in curve.segments
        ]
        boundaries = dict(zip(curve.variables, curve.boundaries, strict=True))
        head = members(curve, "id=curve", "level", "limits")
        documents.append({**head, "boundaries": boundaries, "segments": segments})
        rows += [
            (segment.id, len(segment.rows), *segment_ends(curve, segment))
            for segment in curve.segments
        ]
    table = Table.of("segments", "Segments", columns, rows)
    return View({"curves": documents}, (table,))


# Fits
# --------------------------------------------------------------------------------------------------


def _of_fit(result: FitResult) -> View:
    """Return the view of a fit: the segments, or the model with memory, with the terms in the order
    of their selection. The coefficients `theta` belong to scaled inputs and outputs.
    """
    if isinstance(result.body, OutputsFit):
        whole, every = _of_outputs(result.body.fits, map(_of_fit, result.each))
        return View({**whole, "notes": result.notes}, every, result.notes)
    memory, tables, page = result.memory, list[Table](), shown_by(result.body)
    document: Document = {
        "segments": [_segment(fit, fit.selection) for fit in result.pieces],
        "memory": None,
        **members(result, "backbone=formula", "notes"),
    }
    if result.pieces:
        tables += [terms_table(result), coefficients_table(result, "target")]
    if memory is not None:
        document["memory"] = {
            **asdict(memory.model),
            **members(memory, "ridge", "held_out", "identified"),
            "forward": [memory.candidates[place] for place in memory.forward],
        }
        of_memory = (
            memory_tables.identified_table(memory),
            memory_tables.sizes_table(memory),
            memory_tables.states_table(memory.model.states),
        )
        tables += [table for table in of_memory if table.rows]
    if page is not None and result.body is not None:
        fit_document, own_tables = page.show_fit(result.body)
        document |= fit_document
        tables += own_tables
    return View(document, tuple(tables), (*_formula_lines(result.formula), *result.notes))


def _of_outputs(names: Iterable[str], views: Iterable[View]) -> tuple[Document, tuple[Table, ...]]:
    """Combine the views of several outputs. Return one JSON document that contains the documents by
    the name of the output, and all tables, whose titles begin with the name of the output.
    """
    by_output = dict(zip(names, views, strict=True))
    tables = (
        replace(table, title=f"{name}: {table.title}")
        for name, view in by_output.items()
        for table in view.tables
    )
    return {"outputs": {name: view.document for name, view in by_output.items()}}, tuple(tables)


def _segment(named: SegmentFit | SegmentFunction, numbers: object) -> Document:
    """Return a segment function as a JSON document. Its coefficients `theta` belong to scaled
    inputs and outputs.
    """
    keys = ("theta", "theta_error", "errors_note", "g", "err", "samples", "stop", "condition")
    return {**members(named, "id", "terms", "scaling"), **members(numbers, *keys)}


def _formula_lines(formula: FormulaFit | None) -> tuple[str, ...]:
    """Return a line with the parameters of a fitted formula, and a line for each other local
    minimum of the error that is nearly as good. Return an empty tuple without a formula.
    """
    from mapmore_cli.modelling.literature.own import units_of_parameters

    if formula is None:
        return ()
    units = units_of_parameters(formula)
    parameters = ", ".join(
        f"{name} = {value:.6g} {units.get(name, '')}".rstrip()
        for name, value in formula.parameters.items()
    )
    line = f"{formula.name} ({formula.status.replace('_', ' ')}, {formula.method}): {parameters}"
    return (line, *rival_minima(formula.name, formula))


def _memory_tables(memory: MemoryModel) -> list[Table]:
    """Return a table of the coefficients of a model with memory, with their standard errors. If the
    states of the model have parameters, also return a table of these parameters.
    """
    columns = ("term", "coefficient #.6g", "standard error .3g")
    numbers = (memory.theta.tolist(), memory.theta_error.tolist())
    rows: list[tuple[str, float, float | None]] = []
    if memory.constant:
        rows.append(("(constant)", memory.constant, None))
    rows += zip(memory.terms, *numbers, strict=True)
    where = "of scaled states" if memory.states.scaled else "in physical units"
    title = f"Coefficients of {memory.output}"
    note = f"Coefficients {where}. {memory.errors_note}"
    states = memory_tables.states_table(memory.states)
    coefficients = Table.of("coefficients", title, columns, rows, note)
    return [coefficients, states] if states.rows else [coefficients]


# Models
# --------------------------------------------------------------------------------------------------


def _of_model(model: Model) -> View:
    """Return the view of a model: its inputs and outputs, its equations, and what depends on its
    kind, for example segments. Weights, limits and equations are in physical units.
    """
    from mapmore_cli.modelling.kinds import equations, rules

    lines = equations(model)
    inputs = ", ".join(quantity.label for quantity in model.inputs) or "its own past"
    outputs = ", ".join(output.label for output in model.outputs)
    title = f"{model.name}: {outputs} from {inputs}"
    view = _view_of(model)
    document = {**view.document, "equations": lines, "rules": rules(model)}
    tables = (pieces_table(lines, title), *limits_tables(model), *view.tables)
    return View(document, tables, (*rules(model), *view.lines, *model.notes))


@runtime_checkable
class Shown(Protocol):
    """Kind of model from a plug-in with its own method for `mapmore show`."""

    def show(self, model: Model, show_other: Callable[[Model], View]) -> View:
        """Return the view that is shown together with the equations of a model. The function
        `show_other` returns the view of another model, for a model that contains others.
        """


def _view_of(model: Model) -> View:
    """Return the view of a model without its equations. The kind of the model decides what is
    shown. A kind from a plug-in without the method `show` is shown as it is stored.
    """
    from mapmore_cli.modelling.kinds import kind_of

    kind, body = kind_of(model), model.body
    document: Document
    tables: Sequence[Table] = ()
    lines: Sequence[str] = ()
    match body:
        case Pieces():
            document = {
                **members(body, "level", "backbone", "cross_validation"),
                "segments": [_segment(segment, segment) for segment in body.segments],
                "weights": _weights_document(body),
            }
        case Formula():
            document, lines = members(body, "level", "formula=fit"), _formula_lines(body.fit)
        case Memory():
            document = members(body, "memory=model", "backbone")
            tables = _memory_tables(body.model)
        case Outputs():
            names = [output.name for output in model.outputs]
            document, tables = _of_outputs(names, map(_view_of, body.parts))
        case _ if isinstance(kind, Shown):
            view = kind.show(model, _view_of)
            document, tables, lines = dict(view.document), view.tables, view.lines
        case _:
            document = asdict(body)  # type: ignore[call-overload]
    if ranges := getattr(body, "ranges", None):
        document["limits"] = {curve_range.curve: curve_range.limits for curve_range in ranges}
    head = {"kind": kind.name, **members(model, "name", "output", "inputs", "notes")}
    return View({**head, **document}, tuple(tables), tuple(lines))


def _weights_document(pieces: Pieces) -> Document:
    """Return the rules by which pieces are joined as a JSON document. For each curve, it contains
    the start and the end of the transition zone at each inner boundary (equations 10 and 11 of
    Veale, Xie and Anderson 2018).
    """
    from mapmore_cli.modelling.pieces.definition import zones_of

    curves = []
    for curve in pieces.curves:
        boundaries = dict(zip(pieces.variables, curve.boundaries, strict=True))
        at = {
            name: [list(zone) for zone in zip(*ends, strict=True)]
            for name, ends in zones_of(curve, pieces).items()
        }
        head = members(curve, "id=curve", "level")
        curves.append({**head, "boundaries": boundaries, "zones": at})
    return {
        **members(
            pieces.fusion, "transition", "z_s", "extrapolation", "between_levels=levels", "shrink"
        ),
        "levels": [curve.level for curve in pieces.curves if curve.level is not None],
        "curves": curves,
    }


VIEWS: dict[str, Callable[[Any], View]] = {
    "dataset": of_dataset,
    "segmentation": _of_segmentation,
    "fit": _of_fit,
    "model": _of_model,
    "validation": _of_validation,
}
"""Function that returns the view of each kind of HDF5 file."""
