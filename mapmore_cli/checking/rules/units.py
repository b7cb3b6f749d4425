"""Check units, header lines, and labels that cannot be typeset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import PurePath
from typing import Any

from mapmore_cli.checking.names import read_label
from mapmore_cli.checking.rules import Issue, Issues, Subject
from mapmore_cli.storage.readers import READERS
from mapmore_cli.storage.tables import Top
from mapmore_cli.storage.tables.cells import shortened
from mapmore_cli.study.sections.data import Data
from mapmore_cli.study.sections.logs import FileEntry, SourceColumn
from mapmore_cli.study.units import can_convert, convert, default_unit, is_same, unit_of


def strain_in_per_cent(subject: Subject) -> Issues:
    """Find strains above 1, which would mean that the muscle contracts by more than its length.
    They are probably in per cent.
    """
    if not subject.has("strain"):
        return
    largest = convert(subject.span("strain")[1], subject.units["strain"], "1")
    if largest > 1:
        yield Issue(
            "error",
            "strain-in-per-cent",
            subject.source("strain"),
            f"strain reaches {largest:.3g}, which is {100 * largest:.4g} % of the length; "
            "it is probably in per cent, but is read as a fraction",
            'write `unit: "%"`; if it is an elongation, use another name, or `scale: -1`',
        )


def unit_in_the_name(subject: Subject) -> Issues:
    """Find columns whose name contains another unit than the spec: a column `P_psi` is probably not
    in kPa. A title with per cent is allowed beside `unit: 1`, because a spreadsheet may hold
    fractions and show them in per cent.
    """
    for name, column in subject.spec.data.columns.items():
        label = read_label(column.column) if isinstance(column.column, str) else None
        if (
            label is not None
            and label.quantity == name
            and (column.unit, label.unit) != ("1", "%")
            and (declared := _contradicted(subject, name, column, label.unit))
        ):
            yield Issue(
                "warning",
                "unit-in-name",
                subject.source(name),
                f"column '{column.column}' is read in {declared}, but its name contains the "
                f"unit {label.unit}",
                f'write `unit: "{label.unit}"`, or rename the column',
            )


def unit_line(subject: Subject) -> Issues:
    """Find header lines whose units contradict the spec, for example kN below the name of a column
    that is read in N.
    """
    issues = (issue for source in _sources(subject) for issue in _units_below(subject, source))
    yield from dict.fromkeys(issues)


def _sources(subject: Subject) -> list[str]:
    """Return the files of the recordings, at most `LOOKED_AT` of them."""
    return [*dict.fromkeys(recording.source for recording in subject.recordings)][:LOOKED_AT]


def _columns_of(data: Data, source: str) -> dict[str, SourceColumn]:
    """Return the columns of a file, with the names and units that are given for this file only."""
    entries = (entry for entry in data.files if isinstance(entry, FileEntry))
    columns_of_entries = (entry.columns for entry in entries if PurePath(source).match(entry.path))
    return {
        **data.columns,
        **{name: column for columns in columns_of_entries for name, column in columns.items()},
    }


def _header(subject: Subject, source: str) -> Top | None:
    """Return the header lines of a file. Return None if the spec declares fewer than two header
    lines or selects a table of the file, if the format has no header lines, or if the first lines
    cannot be read with the settings of the spec.
    """
    data = subject.spec.data
    peek = READERS[data.reader].peek
    tables = [data.table, *(entry.table for entry in data.files if isinstance(entry, FileEntry))]
    if peek is None or int(data.header) < 2 or {*tables} != {None}:
        # if the spec selects a table of the file, the first lines may belong to another table
        return None
    for top in peek(subject.folder / source, data.skip_rows + int(data.header)):
        if all(
            getattr(data, key) == value
            for key, value in top.settings.items()
            if key in type(data).model_fields
        ):
            return replace(top, rows=top.rows[data.skip_rows :])
    return None


LOOKED_AT = 20  # largest number of files whose header is checked


def header_of_numbers(subject: Subject) -> Issues:
    """Find header lines with a number in every column: they are probably samples that are lost,
    because they are read as header lines. A line that only numbers the columns (`1`, `2`, `3`) is
    allowed.
    """
    for source in _sources(subject):
        top = _header(subject, source)
        rows = [] if top is None else [row for row in top.rows[1:] if _is_sample(row, top)]
        if rows:
            count, lines = len(rows), int(subject.spec.data.header)
            yield Issue(
                "warning",
                "header-of-numbers",
                subject.where("data", "header"),
                f"{source}: {count} of the {lines} header lines contain numbers, which are "
                "not read as samples",
                f"write `header: {lines - count}`, or the number of lines before the first sample",
            )
            return


def _is_sample(row: Sequence[Any], top: Top) -> bool:
    cells = [cell for cell in row if str(cell).strip() and cell is not None]
    if not cells or not all(map(top.is_number, cells)):
        return False
    words = [str(cell).strip() for cell in cells]
    counts = [[str(first + place) for place in range(len(words))] for first in (0, 1)]
    return len(words) == 1 or words not in counts


def _units_below(subject: Subject, source: str) -> Issues:
    if (top := _header(subject, source)) is None:
        return
    names, *below = [[str(cell).strip() for cell in row] for row in top.rows] or [[]]
    for name, column in _columns_of(subject.spec.data, source).items():
        place = (
            column.column
            if isinstance(column.column, int)
            else names.index(column.column)
            if column.column in names
            else None
        )
        texts = [row[place] for row in below if place is not None and place < len(row)]
        units = (unit_of(text, column.unit or subject.units[name]) for text in texts)
        unit = next((unit for unit in units if unit is not None), None)
        if declared := _contradicted(subject, name, column, unit):
            yield Issue(
                "warning",
                "unit-line",
                subject.source(name),
                f"column '{column.column}' is read in {declared}, but the line below its "
                f"name gives the unit {unit}",
                f'write `unit: "{unit}"`, or set `scale` if that line is wrong',
            )


def _contradicted(subject: Subject, name: str, column: SourceColumn, unit_told: str | None) -> str:
    """Return the unit in which the spec reads a column, if the unit in the file (`unit_told`)
    contradicts it. Return an empty text if there is no contradiction, or if the column has a
    `scale`.
    """
    declared = column.unit or default_unit(name, subject.spec.units)
    if unit_told is None or column.scale != 1.0:
        return ""
    # `bar` in a file may mean absolute pressure.
    # A text that looks like a unit of another dimension is probably not meant as a unit.
    agrees = any(is_same(unit, declared) for unit in (unit_told, f"{unit_told} abs"))
    return "" if agrees or not can_convert(unit_told, declared) else declared


def formulas_in_labels(subject: Subject) -> Issues:
    """Find labels with a formula that cannot be typeset."""
    for quantity, label in subject.spec.report.style.labels.items():
        if "$" not in label:
            continue
        from mapmore_cli.reporting.figures.style import wrong_formula

        if fault := wrong_formula(label):
            place = subject.where("report", "style", "labels", quantity)
            message, remedy = (
                (
                    f"report.style.labels.{quantity}: {shortened(label)!r} cannot be typeset "
                    f"({fault})"
                ),
                "correct the formula between the dollar signs, or remove the dollar signs",
            )
            yield Issue("error", "label", place, message, remedy)
