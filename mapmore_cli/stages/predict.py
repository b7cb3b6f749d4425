"""Predictions for a table of any length, row for row; every byte of the table is kept as it is."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.model import outside_range, predict
from mapmore_cli.storage.readers.table import TableRequest, locate_columns

CHUNK = 20_000
"""Rows in memory at a time."""

FLAG = "outside_range"


@dataclass(frozen=True)
class Row:
    """A record of the table: its text without the line end, the line end, its fields, and the line that it ends on."""

    text: str
    end: str
    cells: Sequence[str]
    line: int


def predicted_lines(model: Model, lines: Iterable[str], label: str, chunk: int = CHUNK) -> Iterator[str]:
    """Yield the lines of a CSV table with `<output>_predicted` and `outside_range` added to each.

    The header holds canonical names; the numbers are in the model's units. The prediction has 12 significant digits; `outside_range` is
    `true` or `false`. Both are empty where an input is empty or not finite. Blank lines stay as they are. `label` names the table in
    messages; `chunk` has no influence on the result.

    Raises
    ------
    DataError
        Where the table is empty, lacks an input, already has one of the added columns, or has a field that is not a number.
    """
    rows = _rows(lines, label)
    header = next(rows, None)
    if header is None:
        raise DataError(f"{label}: the table is empty", f"its first line has to name {_named(model)}")
    names = [cell.strip() for cell in header.cells]
    inputs = tuple(quantity.name for quantity in model.inputs)
    places = locate_columns(TableRequest(label, inputs, header=True), names, len(names))
    added = (f"{model.output.name}_predicted", FLAG)
    for name in added:
        if name in names:
            raise DataError(f"{label}: already has a column {name}", "rename or remove it")
    yield f"{header.text},{','.join(added)}{header.end}"
    while block := list(islice(rows, chunk)):
        fields = [_fields(row, len(names), label) for row in block]
        columns = {name: _values(block, fields, places[name], name, label) for name in inputs}
        for row, cells, added_cells in zip(block, fields, _added_cells(model, columns), strict=True):
            yield row.text + row.end if cells is None else f"{row.text},{added_cells}{row.end}"


def _named(model: Model) -> str:
    return ", ".join(f"{quantity.name} [{quantity.unit}]" for quantity in model.inputs)


def _rows(lines: Iterable[str], label: str) -> Iterator[Row]:
    """Records with their text: a quoted field may go on over several lines."""
    consumed: list[str] = []

    def remembered() -> Iterator[str]:
        for line in lines:
            consumed.append(line)
            yield line

    reader = csv.reader(remembered())
    try:
        for cells in reader:
            text = "".join(consumed)
            consumed.clear()
            bare = text.rstrip("\r\n")
            yield Row(bare, text[len(bare) :], cells, reader.line_num)
    except csv.Error as fault:
        raise DataError(
            f"{label}:row {reader.line_num}: not readable as CSV ({fault})", "look for a quotation mark that is never closed"
        ) from fault


def _fields(row: Row, width: int, label: str) -> Sequence[str] | None:
    """The fields of a record; None for a blank line, which in a table of one column is an empty field."""
    if not row.text.strip():
        return [""] if width == 1 else None
    if len(row.cells) != width:
        raise DataError(f"{label}:row {row.line}: has {len(row.cells)} fields, the header has {width}", "mend or remove the line")
    return row.cells


def _values(block: Sequence[Row], fields: Sequence[Sequence[str] | None], place: int, name: str, label: str) -> Array:
    """One input of a block, (n,); NaN where the field is empty."""
    values = np.full(len(block), np.nan)
    for i, (row, cells) in enumerate(zip(block, fields, strict=True)):
        if cells is None:
            continue
        try:
            values[i] = _number(cells[place].strip())
        except ValueError:
            what = f"{label}:row {row.line}, column {name}: {cells[place][:40]!r} is not a number"
            raise DataError(what, "mend the cell, or leave it empty") from None
    return values


def _number(cell: str) -> float:
    if "_" in cell:  # Python reads 1_5 as 15
        raise ValueError
    return float(cell) if cell else math.nan


def _added_cells(model: Model, columns: dict[str, Array]) -> list[str]:
    """The two new fields of every row of a block."""
    complete = np.logical_and.reduce([np.isfinite(x) for x in columns.values()])
    added = [","] * complete.size
    if not complete.any():
        return added
    known = {name: x[complete] for name, x in columns.items()}
    with np.errstate(all="ignore"):  # far outside of the range a term may overflow; the flag says so
        y, outside = predict(model, known), outside_range(model, known)
    for i, value, flag in zip(np.flatnonzero(complete), y, outside, strict=True):
        added[i] = f"{'' if math.isnan(value) else format(value, '.12g')},{'true' if flag else 'false'}"
    return added
