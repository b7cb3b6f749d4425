"""What the report says in numbers about the data and the scores."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from mapmore_cli.domain.fits import FormulaFit, SegmentFit
from mapmore_cli.domain.models import Equation, FoldError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.results import FitResult
from mapmore_cli.modelling.literature.linear import half_width
from mapmore_cli.modelling.literature.own import units_of_parameters
from mapmore_cli.modelling.validation.metrics import ErrorBand, bands
from mapmore_cli.modelling.validation.repeatability import floors
from mapmore_cli.reporting import memory_tables
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.score_tables import curve_scores_table, score_table, search_table
from mapmore_cli.reporting.table import Cell, Column, Columns, Table


def all_tables(inputs: ReportInputs) -> tuple[Table, ...]:
    """Every table of the report, in the order of the page."""
    scores, units, unit = inputs.validation.scores, inputs.validation.units, inputs.target.unit
    memory, pieces = inputs.fit.memory, inputs.model.pieces
    found = [
        score_table(scores, units, inputs.published, inputs.failed),
        recordings_table(inputs.dataset),
        levels_table(
            inputs.dataset, None if inputs.over_time or inputs.has_memory else inputs.in_curve.name
        ),
        curve_scores_table(scores, units),
        memory_tables.error_parts_table(inputs),
        bands_table(bands(inputs.dataset, inputs.validation.predictions), unit),
        segments_table(inputs),
        terms_table(inputs.fit),
        coefficients_table(inputs),
        equations_table(inputs.equations, inputs.other_equations),
        formulas_table(inputs),
    ]
    found += [] if inputs.search is None else [search_table(inputs.search)]
    found.append(folds_table(pieces.cross_validation if pieces else (), unit))
    found += [table for page in inputs.pages for table in page.tables(inputs)]
    if memory is not None:
        found += [
            memory_tables.states_table(memory.model.states),
            memory_tables.sizes_table(memory),
            memory_tables.identified_table(memory),
        ]
    return tuple(found)


def bands_table(found: Sequence[ErrorBand], unit: str) -> Table:
    """Return a row for each band, a column for each model."""
    models = list(found[0].rmse) if found else []
    columns: Columns = (
        f"from [{unit}]",
        f"to [{unit}]",
        "samples",
        *(Column(model, unit, ".3g") for model in models),
    )
    rows = (
        (band.low, band.high, band.samples, *(band.rmse[model] for model in models))
        for band in found
    )
    note = (
        "RMSE of the samples whose absolute value lies in the band, of held-out data where "
        "there are any."
    )
    return Table.of("bands", "RMSE by the size of what was measured", columns, rows, note)


def recordings_table(dataset: Dataset) -> Table:
    """Rows read, kept and dropped by reason, of every file."""
    reasons = tuple(
        dict.fromkeys(reason for recording in dataset.recordings for reason in recording.dropped)
    )
    columns: Columns = (
        "recording",
        "file",
        "read",
        "kept",
        *(Column(f"dropped: {reason}") for reason in reasons),
    )
    rows: list[tuple[Cell, ...]] = [
        (
            one.id,
            one.source,
            one.rows_read,
            one.rows_kept,
            *(one.dropped.get(reason, 0) for reason in reasons),
        )
        for one in dataset.recordings
    ]
    uneven = [
        r.id for r in dataset.recordings if r.rows_read != r.rows_kept + sum(r.dropped.values())
    ]
    notes = (
        (
            "Resampled, so that kept and dropped rows do not add up to those read: "
            f"{', '.join(uneven)}.",
        )
        if uneven
        else ()
    )
    return Table.of("recordings", "Rows of every recording", columns, rows, *notes)


SINGLE_VALUED_NOTE = (
    "Single-valued: how far the best monotone curve over {along} lies from the samples of "
    "that level, in per cent of the largest {target}. "
    "No static model does better there: a loop has two values at one place, and samples have noise."
)


def levels_table(dataset: Dataset, along: str | None = None) -> Table:
    """Return the curves found, with the samples that train and that validate.

    `along` is the quantity over which a static model has one value: where curves are not
    single-valued, it says by how much.
    """
    columns = [
        "curve",
        f"level [{dataset.unit(dataset.level)}] .6g" if dataset.level else "level",
        "train",
        "validate",
        "recordings",
    ]
    rows: list[tuple[Cell, ...]] = []
    for curve in dataset.curves:
        held_out = int(np.count_nonzero(curve.held_out))
        rows.append(
            (curve.id, curve.level, curve.size - held_out, held_out, ", ".join(curve.recordings))
        )
    notes: tuple[str, ...] = ()
    if lowest := _single_valued(dataset, along):
        columns.append("single-valued [%] .2g")
        rows = [(*row, 100 * floor) for row, floor in zip(rows, lowest, strict=True)]
        notes = (SINGLE_VALUED_NOTE.format(along=along, target=dataset.target),)
    title = f"Samples of every curve{f', levels of {dataset.level}' if dataset.level else ''}"
    return Table.of("levels", title, columns, rows, *notes)


def _single_valued(dataset: Dataset, along: str | None) -> list[float]:
    """Of each level, the error of its best single-valued curve as a part of the largest target;
    nothing where none is worth a word.
    """
    if along is None or dataset.level is None or along == dataset.level:
        return []
    return floors(
        *([curve.columns[name] for curve in dataset.curves] for name in (along, dataset.target))
    )


SAME = 1e-9
"""Relative difference between the sums of squares of two fits that are taken for one model."""
INDEPENDENCE_CAVEAT = (
    "The intervals take the samples to be independent. Neighbouring samples of a smooth curve "
    "are not, so the true intervals are wider."
)


def segments_table(inputs: ReportInputs) -> Table:
    """Where every segment lies, how it was scaled, and how well its own function fits it (training
    RMSE, before fusion).
    """
    places = {
        s.id: [
            float(end)
            for b, c in zip(curve.boundaries, s.cell, strict=True)
            for end in b[c - 1 : c + 1]
        ]
        for curve in inputs.segmentation
        for s in curve.segments
    }
    variables = inputs.segmentation[0].variables if inputs.segmentation else ()
    bounds = (
        Column(f"{v} {end}", inputs.dataset.unit(v)) for v in variables for end in ("from", "to")
    )
    columns: Columns = (
        "segment",
        "samples",
        *bounds,
        f"RMSE [{inputs.target.unit}]",
        "scaling",
        "origin",
        "condition .3g",
    )
    rows: list[tuple[Cell, ...]] = []
    for fit in inputs.fit.segments:
        chosen, scaling = fit.selection, fit.scaling
        rmse = math.sqrt(max(chosen.sse, 0.0) / chosen.samples) * abs(scaling.y_slope)
        rows.append(
            (
                fit.id,
                chosen.samples,
                *places[fit.id],
                rmse,
                scaling.rule,
                scaling.placement,
                chosen.condition,
            )
        )
    return Table.of("segments", "Segments", columns, rows)


def terms_table(fit: FitResult) -> Table:
    """Terms in the order of selection: error reduction ratio, running sum, runner-up and the margin
    over it.
    """
    columns = (
        *(
            "segment",
            "step",
            "term",
            "ERR [%] .4f",
            "sum of ERR [%] .4f",
            "runner-up",
            "its ERR [%] .4f",
        ),
        *("margin [%] .4f", "tied", "stop"),
    )
    notes = [
        "ERR: share of the segment's uncentred sum of squares, in scaled coordinates, that a "
        "term explains when it is chosen."
    ]
    if any(np.any(piece.selection.tied > 0) for piece in fit.pieces):
        notes.append(
            "Tied: other candidates whose ERR was the same within 1e-9; the first of the "
            "dictionary was taken."
        )
    return Table.of(
        "terms",
        "Selected terms",
        columns,
        (row for piece in fit.pieces for row in _term_rows(piece)),
        *notes,
    )


def _term_rows(segment: SegmentFit) -> Iterator[tuple[Cell, ...]]:
    chosen = segment.selection
    running = np.cumsum(chosen.err)
    for step, term in enumerate(segment.terms):
        second = int(chosen.runner_up[step])
        rival, rival_err = (
            (segment.candidates[second], float(chosen.err_all[step, second]))
            if second >= 0
            else (None, math.nan)
        )
        own = float(chosen.err[step])
        stop = chosen.stop if step == len(segment.terms) - 1 else None
        shares = (
            100 * own,
            100 * float(running[step]),
            rival,
            100 * rival_err,
            100 * (own - rival_err),
        )
        yield segment.id, step + 1, term, *shares, int(chosen.tied[step]) or None, stop


def coefficients_table(inputs: ReportInputs) -> Table:
    """Coefficients of every segment with 95 % confidence intervals, in scaled coordinates and in
    the target's unit.
    """
    unit = inputs.target.unit
    columns = (
        "segment",
        "term",
        "theta",
        "± 95 % .3g",
        "lower",
        "upper",
        f"theta × y_slope [{unit}]",
        f"± 95 % [{unit}] .3g",
    )
    rows: list[tuple[Cell, ...]] = []
    for segment in inputs.fit.pieces:
        chosen, slope = segment.selection, segment.scaling.y_slope
        for term, theta, error in zip(
            segment.terms, chosen.theta.tolist(), chosen.theta_error.tolist(), strict=True
        ):
            width = half_width(error, chosen.samples - len(chosen.theta))
            rows.append(
                (
                    segment.id,
                    term,
                    theta,
                    width,
                    theta - width,
                    theta + width,
                    theta * slope,
                    width * abs(slope),
                )
            )
    return Table.of(
        "coefficients",
        "Coefficients with 95 % confidence intervals",
        columns,
        rows,
        INDEPENDENCE_CAVEAT,
    )


def equations_table(
    equations: Sequence[Equation], others: Mapping[str, Sequence[Equation]]
) -> Table:
    """Return the model in physical units, and in `others`, as text and as LaTeX source: a column
    for each.
    """
    texts = (
        Column(name, form="text") for name in ("equation", *(f"with {units}" for units in others))
    )
    sources = (
        Column(name, form="source")
        for name in ("latex", *(f"latex with {units}" for units in others))
    )
    alike = zip(equations, *others.values(), strict=True)
    rows = (
        (same[0].id, *(one.text for one in same), *(one.latex for one in same)) for same in alike
    )
    return Table.of("equations", "Equations in physical units", ("id", *texts, *sources), rows)


def formulas_table(inputs: ReportInputs) -> Table:
    """Parameters ± standard error of every fitted formula; a failed fit has one row, and no
    number.
    """
    own = inputs.fit.formula
    fitted = (
        [(own.name, "backbone" if inputs.has_pieces else "own model", own)]
        if own is not None
        else []
    )
    fitted += [
        (name, "competitor", formula) for name, formula in inputs.validation.formulas.items()
    ]
    columns = (
        *(
            Column("formula", form="model"),
            "role",
            "status",
            "parameter",
            "value #.6g",
            "unit",
            "standard error .3g",
        ),
        *("95 %, from .4g", "to .4g", "method", "rank", "condition .3g", "samples"),
    )
    rows = [row for name, role, formula in fitted for row in _formula_rows(name, role, formula)]
    notes = [INDEPENDENCE_CAVEAT] if rows else []
    notes += same_models([(name, formula) for name, _, formula in fitted])
    notes += [
        f"{name} ({role}): {note}" for name, role, formula in fitted for note in formula.notes
    ]
    notes += [told for name, _, formula in fitted for told in rival_minima(name, formula)]
    return Table.of("formulas", "Parameters of the fitted formulas", columns, rows, *notes)


def _formula_rows(name: str, role: str, formula: FormulaFit) -> Iterator[tuple[Cell, ...]]:
    head = (name, role, formula.status.replace("_", " "))
    if formula.failed:
        yield *head, *[None] * 6, formula.method, None, None, formula.samples
        return
    units = units_of_parameters(formula)
    for key, value in formula.parameters.items():
        reach = half_width(formula.errors.get(key, math.nan), formula.samples - formula.rank)
        number = (key, value, units.get(key), formula.errors.get(key), value - reach, value + reach)
        yield *head, *number, formula.method, formula.rank, formula.condition, formula.samples


def same_models(fitted: Sequence[tuple[str, FormulaFit]]) -> tuple[str, ...]:
    """Return a sentence for every pair of different formulas that are one model here: what one of
    them can say, the other can.

    That is so where the same samples are fitted with the same sum of squares (tondu_lopez with its
    area fitted is chou_hannaford in other parameters wherever that describes a braid).
    """
    known = [(name, fit) for name, fit in fitted if not fit.failed and fit.sse > 0.0]
    return tuple(
        f"{first} and {second} are one model here, in other parameters: their sums of squares "
        f"agree within {SAME:g}. Count them once."
        for i, (first, one) in enumerate(known)
        for second, other in known[i + 1 :]
        if one.name != other.name
        and one.samples == other.samples
        and abs(one.sse - other.sse) <= SAME * one.sse
    )


def rival_minima(name: str, formula: FormulaFit) -> Iterator[str]:
    """Yield other minima of a formula's error that training data hardly tell from the one taken,
    each as a sentence.
    """
    for rival in formula.rivals:
        ratio = math.sqrt(rival.sse / formula.sse)
        parameters = ", ".join(f"{key} = {value:.4g}" for key, value in rival.parameters.items())
        yield (f"{name}: another minimum, {parameters}, has {ratio:.3g} times its training error")


def folds_table(choices: Sequence[FoldError], unit: str) -> Table:
    """Cross-validation errors behind the decision between the formula alone and the formula with
    segments.
    """
    best = min((choice.rmse for choice in choices), default=math.nan)
    columns = ("choice", f"RMSE of left-out samples [{unit}]", "folds", "least error")
    rows = ((c.choice, c.rmse, c.folds, "yes" if c.rmse == best else "no") for c in choices)
    return Table.of(
        "cross_validation",
        "Is the residual worth its segments? Errors on left-out training data",
        columns,
        rows,
    )
