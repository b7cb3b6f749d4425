"""What the report says in numbers about the data and the scores."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.recording import Dataset
from mapmore_cli.modelling.validation.metrics import Band, bands
from mapmore_cli.modelling.validation.repeatability import floors
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.memory_tables import (
    error_parts_table,
    identified_table,
    sections_table,
    sizes_table,
    starts_table,
    states_table,
    substitutes_table,
    waveforms_table,
)
from mapmore_cli.reporting.model_tables import coefficients_table, equations_table, folds_table, formulas_table, segments_table, terms_table
from mapmore_cli.reporting.score_tables import curve_scores_table, score_table, search_table
from mapmore_cli.reporting.table import Cell, Column, Columns, Table


def all_tables(inputs: ReportInputs) -> tuple[Table, ...]:
    """Every table of the report, in the order of the page."""
    scores, units, unit = inputs.validation.scores, inputs.validation.units, inputs.target.unit
    memory, pieces = inputs.fit.memory, inputs.model.pieces
    own = score_table(scores, units, inputs.published, inputs.failed)
    found = [
        replace(own, notes=(*own.notes, *([inputs.start] if inputs.start is not None else []))),
        recordings_table(inputs.dataset),
        levels_table(inputs.dataset, None if inputs.over_time or inputs.has_memory else inputs.in_curve.name),
        curve_scores_table(scores, units),
        error_parts_table(inputs),
        starts_table(inputs),
        bands_table(bands(inputs.dataset, inputs.validation.predictions), unit),
        segments_table(inputs),
        terms_table(inputs.fit),
        coefficients_table(inputs),
        equations_table(inputs.equations, inputs.other_equations),
        formulas_table(inputs),
    ]
    found += [] if inputs.search is None else [search_table(inputs.search)]
    found.append(folds_table(pieces.cross_validation if pieces else (), unit))
    found += [sections_table(inputs.motions, unit), waveforms_table(inputs)] if inputs.motions else []
    found += inputs.published_tables
    if memory is not None:
        found += [states_table(memory.model.states), substitutes_table(memory), sizes_table(memory), identified_table(memory)]
    return tuple(found)


def bands_table(found: Sequence[Band], unit: str) -> Table:
    """Return a row for each band, a column for each model."""
    models = list(found[0].rmse) if found else []
    columns: Columns = (f"from [{unit}]", f"to [{unit}]", "samples", *(Column(model, unit, ".3g") for model in models))
    rows = ((band.low, band.high, band.samples, *(band.rmse[model] for model in models)) for band in found)
    note = "RMSE of the samples whose absolute value lies in the band, of held-out data where there are any."
    return Table.of("bands", "RMSE by the size of what was measured", columns, rows, note)


def recordings_table(dataset: Dataset) -> Table:
    """Rows read, kept and dropped by reason, of every file."""
    reasons = tuple(dict.fromkeys(reason for recording in dataset.recordings for reason in recording.dropped))
    columns: Columns = ("recording", "file", "read", "kept", *(Column(f"dropped: {reason}") for reason in reasons))
    rows: list[tuple[Cell, ...]] = [
        (one.id, one.source, one.rows_read, one.rows_kept, *(one.dropped.get(reason, 0) for reason in reasons))
        for one in dataset.recordings
    ]
    uneven = [r.id for r in dataset.recordings if r.rows_read != r.rows_kept + sum(r.dropped.values())]
    notes = (f"Resampled, so that kept and dropped rows do not add up to those read: {', '.join(uneven)}.",) if uneven else ()
    return Table.of("recordings", "Rows of every recording", columns, rows, *notes)


SINGLE_VALUED_NOTE = (
    "Single-valued: how far the best monotone curve over {along} lies from the samples of that level, in per cent of the largest {target}. "
    "No static model does better there: a loop has two values at one place, and samples have noise."
)


def levels_table(dataset: Dataset, along: str | None = None) -> Table:
    """Return the curves found, with the samples that train and that validate.

    `along` is the quantity over which a static model has one value: where curves are not single-valued, it says by how much.
    """
    columns = ["curve", f"level [{dataset.unit(dataset.level)}] .6g" if dataset.level else "level", "train", "validate", "recordings"]
    rows: list[tuple[Cell, ...]] = []
    for curve in dataset.curves:
        held_out = int(np.count_nonzero(curve.held_out))
        rows.append((curve.id, curve.level, curve.size - held_out, held_out, ", ".join(curve.recordings)))
    notes: tuple[str, ...] = ()
    if lowest := _single_valued(dataset, along):
        columns.append("single-valued [%] .2g")
        rows = [(*row, 100 * floor) for row, floor in zip(rows, lowest, strict=True)]
        notes = (SINGLE_VALUED_NOTE.format(along=along, target=dataset.target),)
    title = f"Samples of every curve{f', levels of {dataset.level}' if dataset.level else ''}"
    return Table.of("levels", title, columns, rows, *notes)


def _single_valued(dataset: Dataset, along: str | None) -> list[float]:
    """Of each level, the error of its best single-valued curve as a part of the largest target; nothing where none is worth a word."""
    if along is None or dataset.level is None or along == dataset.level:
        return []
    return floors(*([curve.columns[name] for curve in dataset.curves] for name in (along, dataset.target)))
