"""The first lines of a file: how it is laid out, before anything is known of what it holds."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.readers import READERS
from mapmore_cli.storage.text_streams import lines_of

LINES = 200
SUFFIXES = {".csv": "csv", ".txt": "csv", ".tsv": "csv", ".dat": "csv", ".xlsx": "xlsx"}
ADDRESSED = (".mat", ".h5", ".hdf5", ".tdms")
MOST_HEADER_LINES = 9

Row = Sequence[Any]
_NUMBER = re.compile(r"\s*[-+]?(?:(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?|nan|inf)\s*", re.IGNORECASE)


def _with_point(cell: str) -> bool:
    return _NUMBER.fullmatch(cell) is not None


def _with_comma(cell: str) -> bool:
    return "." not in cell and _NUMBER.fullmatch(cell.replace(",", ".")) is not None


_DELIMITERS: tuple[tuple[str | None, dict[str, Any]], ...] = (
    (",", {}),
    (";", {"delimiter": ";"}),
    ("\t", {"delimiter": "tab"}),
    (None, {"delimiter": "whitespace"}),
)
_NUMBERS: tuple[tuple[Callable[[Any], bool], dict[str, Any]], ...] = ((_with_point, {}), (_with_comma, {"decimal": ","}))
"""Dialects in the order of preference where several fit."""


@dataclass(frozen=True)
class Preview:
    """How a file is read: by which `reader` with which `settings` of `data`, and the `titles` of its columns where it has a header."""

    reader: str
    width: int
    titles: tuple[str, ...] | None
    settings: dict[str, Any] = field(default_factory=dict)

    @property
    def columns(self) -> tuple[str | int, ...]:
        """How the spec names the columns: by their titles where each has one of its own, else by their indices."""
        named = self.titles is not None and all(self.titles) and len(set(self.titles)) == self.width
        return self.titles if named and self.titles is not None else tuple(range(self.width))


def suffix_of(path: Path) -> str:
    """The suffix that tells the format, in lower case: `.csv` of `a.csv.gz`."""
    return Path(path.name.casefold().removesuffix(".gz")).suffix


def preview(path: Path) -> Preview:
    """Look at the beginning of a file; DataError where it holds no table of numbers that `init` can lay out."""
    suffix = suffix_of(path)
    if suffix in ADDRESSED:
        raise DataError(f"{path.name}: its arrays have to be named", "write `columns` by hand, as `pressure: {column: run.P, unit: kPa}`")
    reader = SUFFIXES.get(suffix)
    if reader is None or reader not in READERS:
        raise DataError(f"{path.name}: no reader takes {suffix or 'files without a suffix'}", "save the table as CSV")
    return _of_sheet(path) if reader == "xlsx" else _of_text(path)


def _of_text(path: Path) -> Preview:
    lines = [line.rstrip("\r\n") for line in islice(lines_of(path), LINES)]
    if any("\0" in line for line in lines):
        raise DataError(f"{path.name}: is no text", "save the table as CSV")
    found = [
        _layout(_fields(lines, character), number, "csv", {**delimiter, **decimal})
        for character, delimiter in _DELIMITERS
        for number, decimal in _NUMBERS
        if (character, number) != (",", _with_comma)
    ]
    layouts = [layout for layout in found if layout is not None]
    if not layouts:
        raise DataError(f"{path.name}: no table of numbers was found in its first {len(lines)} lines", "save the table as CSV")
    return max(layouts, key=lambda layout: layout[0])[1]


def _fields(lines: Sequence[str], delimiter: str | None) -> list[list[str]]:
    """Lines cut at the delimiter, at any run of blanks where it is None; blank lines have no fields."""
    try:
        return [line.split() for line in lines] if delimiter is None else list(csv.reader(lines, delimiter=delimiter))
    except csv.Error:  # quotes that never close
        return []


def _of_sheet(path: Path) -> Preview:
    from mapmore_cli.storage.readers.faults import optional_library, reading

    openpyxl = optional_library("openpyxl", "openpyxl", path.name)
    with reading(path.name, "workbook (.xlsx)"), path.open("rb") as file:
        sheet = openpyxl.load_workbook(file, read_only=True, data_only=True).worksheets[0]
        sheet.reset_dimensions()
        rows = [list(row) for row in islice(sheet.iter_rows(values_only=True), LINES)]
    found = _layout(rows, lambda cell: not isinstance(cell, str), "xlsx", {})
    if found is None:
        raise DataError(f"{path.name}: no table of numbers was found in the first {len(rows)} rows of its first sheet", "save it as CSV")
    return found[1]


def _layout(rows: Sequence[Row], is_number: Callable[[Any], bool], reader: str, settings: dict[str, Any]) -> tuple[int, Preview] | None:
    """The table that the last rows belong to, with the number of rows that do; None where they are no numbers in two columns or more.

    Cells may be empty. Rows right before it with as many cells are the header, what stands before these is skipped. The very last row may
    be cut off.
    """
    whole = rows[:-1] if len(rows) > 1 else rows
    width = len(whole[-1]) if whole else 0
    blank = [not any(_filled(row)) for row in whole]
    data = [is_blank or (len(row) == width and all(map(is_number, _filled(row)))) for row, is_blank in zip(whole, blank, strict=True)]
    first = next((i for i in range(len(whole), 0, -1) if not data[i - 1]), 0)
    while first < len(whole) and blank[first]:
        first += 1
    top = next((i for i in range(first, 0, -1) if blank[i - 1] or len(whole[i - 1]) != width), 0)
    header = first - top
    if width < 2 or first == len(whole) or header > MOST_HEADER_LINES:
        return None
    titles = tuple("" if cell is None else str(cell).strip().strip('"') for cell in whole[top]) if header else None
    shape = {**({} if header == 1 else {"header": header or False}), **({"skip_rows": top} if top else {})}
    return len(whole) - first, Preview(reader, width, titles, {**settings, **shape})


def _filled(row: Row) -> list[Any]:
    return [cell for cell in row if cell is not None and str(cell).strip()]
