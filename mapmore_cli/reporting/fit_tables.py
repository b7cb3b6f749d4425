"""Make the tables of the report about fits: segments, terms, coefficients and formulas."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mapmore_cli.domain.fits import (
    PIECE,
    FormulaFit,
    MemoryModel,
    Segment,
    SegmentedCurve,
    SegmentFit,
)
from mapmore_cli.domain.models import FoldError, Model, SegmentFunction
from mapmore_cli.domain.results import FitResult, Outlier
from mapmore_cli.modelling.literature.linear import half_width
from mapmore_cli.modelling.literature.own import units_of_parameters
from mapmore_cli.modelling.validation.residuals import SAME
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.table import FROM_TO, Cells, Column, Columns, Table, cells_of


def segments_table(inputs: ReportInputs) -> Table:
    """Return a table of the segments: the range and the scaling of each segment, and the training
    RMSE of its own function before the pieces are joined.
    """
    places = {
        segment.id: segment_ends(curve, segment)
        for curve in inputs.segmentation
        for segment in curve.segments
    }
    variables = inputs.segmentation[0].variables if inputs.segmentation else ()
    ends = [Column(f"{v} {end}", inputs.dataset.unit(v)) for v in variables for end in FROM_TO]
    last = {
        "scaling": "scaling.rule",
        "origin": "scaling.placement",
        "condition .3g": "selection.condition",
    }
    rows = (
        (
            *(fit.id, fit.selection.samples, *places[fit.id]),
            *(training_rmse(fit), *cells_of(fit, last)),
        )
        for fit in inputs.fit.segments
    )
    columns: Columns = ("segment", "samples", *ends, f"RMSE [{inputs.target.unit}]", *last)
    return Table.of("segments", "Segments", columns, rows)


def training_rmse(fit: SegmentFit) -> float:
    """Return the RMSE of a segment's own function before the pieces are joined, in the unit of the
    target.
    """
    mean_square = max(fit.selection.sse, 0.0) / fit.selection.samples
    return math.sqrt(mean_square) * abs(fit.scaling.y_slope)


def segment_ends(curve: SegmentedCurve, segment: Segment) -> list[float]:
    """Return the start and end of a segment along each variable of its curve."""
    cuts = zip(curve.boundaries, segment.cell, strict=True)
    return [float(end) for places, cell in cuts for end in places[cell - 1 : cell + 1]]


def terms_table(fit: FitResult) -> Table:
    """Return a table of the selected terms in the order of their selection. A row has the error
    reduction ratio (ERR) of the term, the sum of the ratios up to this term, the second-best term
    (the runner-up), and the difference between the ratios of both.
    """
    columns = (
        *("segment", "step", "term", "ERR [%] .4f", "sum of ERR [%] .4f", "runner-up"),
        *("its ERR [%] .4f", "margin [%] .4f", "tied", "stop"),
    )
    notes = [
        "ERR: share of the segment's uncentred sum of squares, in scaled coordinates, that a "
        "term explains when it is chosen."
    ]
    if any(np.any(piece.selection.tied > 0) for piece in fit.pieces):
        notes.append(
            "Tied: other candidates whose ERR was the same within 1e-9; the first of them in the "
            "dictionary was chosen."
        )
    rows = (row for piece in fit.pieces for row in _term_rows(piece))
    return Table.of("terms", "Selected terms", columns, rows, *notes)


def _term_rows(segment: SegmentFit) -> Iterator[Cells]:
    chosen = segment.selection
    running = np.cumsum(chosen.err)
    for step, term in enumerate(segment.terms):
        err, second = float(chosen.err[step]), int(chosen.runner_up[step])
        rival, rival_err = None, math.nan
        if second >= 0:
            rival, rival_err = segment.candidates[second], float(chosen.err_all[step, second])
        stop = chosen.stop if step == len(segment.terms) - 1 else None
        ours = (term, 100 * err, 100 * float(running[step]))
        theirs = (rival, 100 * rival_err, 100 * (err - rival_err))
        yield segment.id, step + 1, *ours, *theirs, int(chosen.tied[step]) or None, stop


def coefficient_rows(
    fit: FitResult, model: Model | None
) -> Iterator[tuple[SegmentFit, dict[str, Any]]]:
    """Yield a segment and a row for each of its coefficients; a model with memory is treated as one
    segment. The row is a row of `Selection.table` with one more entry, `width`: half the width of
    the 95 % interval of the coefficient.

    If the `model` was fitted with a known shape (`fit.shape`), its coefficients replace the
    coefficients of the fit.
    """
    kept: dict[str, SegmentFunction | MemoryModel] = {}
    if model is not None and model.shape is not None:
        kept = {segment.id: segment for segment in (model.pieces.segments if model.pieces else ())}
        kept.update((PIECE, memory) for memory in model.memories)
    for piece in fit.pieces:
        chosen = piece.selection
        if function := kept.get(piece.id):
            chosen = replace(chosen, theta=function.theta, theta_error=function.theta_error)
        for term, row in zip(piece.terms, chosen.table(), strict=True):
            width = half_width(row["standard_error"], chosen.freedom)
            yield piece, {**row, "term": term, "width": width}


def coefficients_table(fit: FitResult, unit: str, model: Model | None = None) -> Table:
    """Return a table of the coefficients of every segment with standard errors and 95 % confidence
    intervals, in scaled coordinates and in the unit of the target. A note names the coefficients
    whose interval includes zero. Without scaling, every coefficient has a unit of its own, which
    the table does not show.
    """
    unit = "" if any(piece.scaling.rule == "none" for piece in fit.pieces) else unit
    columns = (
        *("segment", "term", "theta", "standard error .3g", "t .3g", "± 95 % .3g"),
        *("lower", "upper", f"theta × y_slope [{unit}]", f"± 95 % [{unit}] .3g"),
    )
    rows: list[Cells] = []
    unknown: list[str] = []
    for piece, row in coefficient_rows(fit, model):
        theta, width, slope = row["coefficient"], row["width"], piece.scaling.y_slope
        ends = (width, theta - width, theta + width, theta * slope, width * abs(slope))
        rows.append((piece.id, row["term"], theta, row["standard_error"], row["t"], *ends))
        unknown += [f"{row['term']} ({piece.id})"] if width > abs(theta) else []
    notes = list(dict.fromkeys(piece.selection.errors_note for piece in fit.pieces))
    if unknown:
        named = ", ".join(unknown[:MOST_NAMED]) + (", ..." if len(unknown) > MOST_NAMED else "")
        notes.append(f"Not identified (95 % interval beyond zero): {named}.")
    title = "Coefficients with 95 % confidence intervals"
    return Table.of("coefficients", title, columns, rows, *notes)


MOST_NAMED = 12  # largest number of terms that a note names


def outliers_table(outliers: Sequence[Outlier], unit: str) -> Table:
    """Return a table of the training samples that lie far from a robust fit, the farthest first."""
    columns = ("file", "place", "curve", f"measured − predicted [{unit}] .4g", "in scales .3g")
    rows = (
        (outlier.file, outlier.place, outlier.curve, outlier.off, outlier.scales)
        for outlier in outliers
    )
    note = "They have a smaller weight in the fit. None is left out of the data or of the scores."
    return Table.of("outliers", "Samples far from the fit", columns, rows, note)


def formulas_table(inputs: ReportInputs) -> Table:
    """Return a table of the parameters of every fitted formula with their standard errors. A
    formula whose fit failed has one row without numbers.
    """
    own_formula, formulas = inputs.fit.formula, inputs.validation.formulas
    fitted = [(name, "competitor", formula) for name, formula in formulas.items()]
    if own_formula is not None:
        fitted.insert(
            0, (own_formula.name, "backbone" if inputs.has_pieces else "own model", own_formula)
        )
    columns = (
        Column("formula", form="model"),
        *("role", "status", "parameter", "value #.6g", "unit", "standard error .3g"),
        *("95 %, from .4g", "to .4g", "method", "rank", "condition .3g", "samples"),
    )
    rows = [row for name, role, formula in fitted for row in _formula_rows(name, role, formula)]
    notes = list(dict.fromkeys(formula.errors_note for _, _, formula in fitted))
    notes += same_models([(name, formula) for name, _, formula in fitted])
    for name, role, formula in fitted:
        notes += [f"{name} ({role}): {note}" for note in formula.notes]
        notes += rival_minima(name, formula)
    return Table.of("formulas", "Parameters of the fitted formulas", columns, rows, *notes)


def _formula_rows(name: str, role: str, formula: FormulaFit) -> Iterator[Cells]:
    head = (name, role, formula.status.replace("_", " "))
    if formula.failed:
        yield *head, *[None] * 6, formula.method, None, None, formula.samples
        return
    units = units_of_parameters(formula)
    tail = (formula.method, formula.rank, formula.condition, formula.samples)
    for key, value in formula.parameters.items():
        error = formula.errors.get(key, math.nan)
        reach = half_width(error, formula.samples - formula.rank)
        yield *head, key, value, units.get(key), error, value - reach, value + reach, *tail


def same_models(fitted: Sequence[tuple[str, FormulaFit]]) -> tuple[str, ...]:
    """Return a sentence for every pair of formulas with different names that describe the data with
    the same function.

    Two formulas are treated as the same if their fits to the same samples have the same sum of
    squares. For example, `tondu_lopez` with a fitted area is the same function as `chou_hannaford`,
    written with other parameters, if the parameters of `chou_hannaford` describe a braid.
    """
    known = [(name, fit) for name, fit in fitted if not fit.failed and fit.sse > 0.0]
    return tuple(
        f"{first} and {second} are one model here, in other parameters: their sums of squares "
        f"agree within {SAME:g}. Count them once."
        for i, (first, first_fit) in enumerate(known)
        for second, second_fit in known[i + 1 :]
        if first_fit.name != second_fit.name
        and first_fit.samples == second_fit.samples
        and abs(first_fit.sse - second_fit.sse) <= SAME * first_fit.sse
    )


def rival_minima(name: str, formula: FormulaFit) -> Iterator[str]:
    """Yield a sentence for each other local minimum of a formula's error that is nearly as small as
    the chosen minimum, so that the training data hardly distinguish the two.
    """
    for rival in formula.rivals:
        ratio = math.sqrt(rival.sse / formula.sse)
        parameters = ", ".join(f"{key} = {value:.4g}" for key, value in rival.parameters.items())
        yield (f"{name}: another minimum, {parameters}, has {ratio:.3g} times its training error")


def folds_table(choices: Sequence[FoldError], unit: str) -> Table:
    """Return a table of cross-validation errors by which mapmore chose between the formula alone
    (`backbone`) and the formula with segments (`backbone + residual` or `backbone + shrunken
    residual`).
    """
    best = min((choice.rmse for choice in choices), default=math.nan)
    columns = ("choice", f"RMSE of left-out samples [{unit}]", "folds", "least error")
    rows = ((c.choice, c.rmse, c.folds, "yes" if c.rmse == best else "no") for c in choices)
    title = "Is the residual worth its segments? Errors on left-out training data"
    return Table.of("cross_validation", title, columns, rows)
