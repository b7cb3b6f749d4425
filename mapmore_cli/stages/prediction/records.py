"""Records of a CSV table, with their text as it stands."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables.lines import open_quote, quote_left_open


@dataclass(frozen=True)
class Row:
    """A record of the table: its text without the line end, the line end, its fields, and the line that it ends on."""

    text: str
    end: str
    cells: Sequence[str]
    line: int


def records(lines: Iterable[str], label: str) -> Iterator[Row]:
    """Records with their text: a quoted field may go on over several lines."""
    consumed: list[str] = []

    def remembered() -> Iterator[str]:
        for line in lines:
            consumed.append(line)
            yield line

    reader = csv.reader(remembered())
    try:
        for cells in reader:
            if quote_left_open(consumed, cells, ","):
                raise open_quote(label, reader.line_num - len(consumed) + 1)
            text = "".join(consumed)
            consumed.clear()
            bare = text.rstrip("\r\n")
            yield Row(bare, text[len(bare) :], cells, reader.line_num)
    except csv.Error as fault:  # a field that is longer than any number
        raise open_quote(label, reader.line_num - len(consumed) + 1) from fault


def fields_of(row: Row, width: int, label: str) -> Sequence[str] | None:
    """The fields of a record; None for a blank line, which in a table of one column is an empty field."""
    if not row.text.strip():
        return [""] if width == 1 else None
    if len(row.cells) != width:
        raise DataError(f"{label}:row {row.line}: has {len(row.cells)} fields, the header has {width}", "mend or remove the line")
    return row.cells


def values_of(block: Sequence[Row], fields: Sequence[Sequence[str] | None], place: int, name: str, label: str) -> Array:
    """One quantity of a block, (n,); NaN where the field is empty. Raises DataError for a field that is not a number."""
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
