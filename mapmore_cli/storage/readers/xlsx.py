"""Workbooks (.xlsx), read row by row with openpyxl; formulas count with the values that were last
computed.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from fnmatch import fnmatchcase
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import (
    RawTable,
    Reader,
    SourceColumn,
    TableRequest,
    Top,
    known_names,
    locate_columns,
    optional_library,
    reading,
    refuse_bombs,
)
from mapmore_cli.storage.tables.cells import NotANumber, holds_number

MOST_ROWS = 1_048_576  # of a sheet, as Excel has it
MOST_SHEETS = 1000
ERRORS = ("#DIV/0!", "#NAME?", "#NULL!", "#NUM!", "#REF!", "#VALUE!")

Row = tuple[int, tuple[Any, ...]]
"""Number in the sheet, from 1, and the cells."""


def read_xlsx(path: Path, request: TableRequest) -> list[RawTable]:
    """Read the wanted columns of one sheet of a workbook, or of every sheet that the request's glob
    names.

    Empty rows are skipped (they count as header lines and as skipped rows); an empty cell is NaN.

    Raises
    ------
    DataError
        No workbook, or a damaged one; a missing sheet or column; a cell that is not a number;
        openpyxl not installed.
    """
    with _opened_book(path, request.label) as book:
        sheets, doubts = _sheets(book, request)
        tables = [_parse_sheet(sheet, request, title) for title, sheet in sheets]
        return [replace(tables[0], doubts=doubts), *tables[1:]]


def peek_xlsx(path: Path, most: int) -> Iterable[Top]:
    """Return the first rows of every sheet that has some, the first one's first; a later sheet has
    to be named.
    """
    tops = []
    with _opened_book(path, path.name) as book:
        for number, sheet in enumerate(_visible(book)):
            sheet.reset_dimensions()
            rows = [list(row) for row in islice(sheet.iter_rows(values_only=True), most)]
            if rows or not number:
                settings = {"sheet": sheet.title} if number else {}
                tops.append(Top(_even(rows), _is_no_text, settings, sheet=sheet.title))
    return tops


def _is_no_text(cell: Any) -> bool:
    return not isinstance(cell, str) and holds_number(cell)


@contextmanager
def _opened_book(path: Path, label: str) -> Iterator[Any]:
    openpyxl = optional_library("openpyxl", "openpyxl", label)
    with reading(label, "workbook (.xlsx)"), path.open("rb") as file:
        _refuse_bombs(path, label)
        yield openpyxl.load_workbook(file, read_only=True, data_only=True, keep_links=False)


def _even(rows: list[list[Any]]) -> list[list[Any]]:
    """Return the rows, those with numbers as long as the longest of these: a row ends at its last
    cell that is filled.
    """
    numbers = [row for row in rows if any(isinstance(cell, int | float) for cell in row)]
    width = max(map(len, numbers), default=0)
    for row in numbers:
        row += [None] * (width - len(row))
    return rows


def _refuse_bombs(path: Path, label: str) -> None:
    """Refuse a file of which a few bytes unpack to gigabytes."""
    with zipfile.ZipFile(path) as archive:
        sheets = sum(name.startswith("xl/worksheets/") for name in archive.namelist())
        if sheets > MOST_SHEETS:
            raise DataError(
                f"{label}: has {sheets} sheets, more than {MOST_SHEETS}",
                "split the workbook, or save the tables as CSV",
            )
        for member in archive.infolist():
            refuse_bombs(f"{label}: {member.filename}", member.file_size, member.compress_size)


def _visible(book: Any) -> list[Any]:
    """Return the sheets that are not hidden; all where every one is."""
    return [sheet for sheet in book.worksheets if sheet.sheet_state == "visible"] or book.worksheets


def _sheets(
    book: Any, request: TableRequest
) -> tuple[list[tuple[str | None, Any]], tuple[str, ...]]:
    """Return the sheets to read, with their titles where a glob chose them, and doubts about the
    choice.

    Hidden sheets are read where they are named. Of several, those that are empty are left out.
    """
    sheets, visible = {sheet.title: sheet for sheet in book.worksheets}, _visible(book)
    if not visible:
        raise DataError(f"{request.label}: has no sheet with cells", "save the table into a sheet")
    if request.sheet in sheets:
        return [(None, sheets[request.sheet])], ()
    filled = [sheet for sheet in visible if next(_filled_rows(sheet, request), None) is not None]
    if request.sheet is None:
        others = [sheet.title for sheet in filled if sheet is not visible[0]]
        told = (
            f"{request.label}: the sheet '{visible[0].title}' is read, and not "
            f"{', '.join(others[:4])}; say which by `sheet`"
        )
        return [(None, visible[0])], (told,) if others else ()
    for among in (filled, visible):
        if named := [one for one in among if fnmatchcase(one.title, request.sheet)]:
            return [(sheet.title, sheet) for sheet in named], ()
    raise DataError(
        f"{request.label}: there is no sheet '{request.sheet}'",
        known_names(request.sheet, list(sheets), "The workbook has"),
    )


def _filled_rows(sheet: Any, request: TableRequest) -> Iterator[Row]:
    """Yield the rows of a sheet that have a cell; DataError for one that lies where no sheet has
    rows: all between would be passed over one by one.
    """
    # what other programs write there is often wrong, and would cut the sheet
    sheet.reset_dimensions()
    for number, row in enumerate(sheet.iter_rows(values_only=True), start=1):
        if number > MOST_ROWS:
            raise DataError(
                f"{request.label}:{sheet.title}: has a row beyond {MOST_ROWS}, the last that "
                "a sheet can have",
                "save the table as CSV",
            )
        cells = (cell.strip() if isinstance(cell, str) else cell for cell in row)
        if number > request.skip_rows and any(cell not in (None, "") for cell in cells):
            yield number, row


def _parse_sheet(sheet: Any, request: TableRequest, title: str | None) -> RawTable:
    rows, label = _filled_rows(sheet, request), f"{request.label}:{sheet.title}"
    first = next(rows, None)
    if first is None:
        raise DataError(f"{label}: the sheet is empty")
    names = ["" if cell is None else str(cell).strip() for cell in first[1]]
    places = locate_columns(request, names if request.header else None, len(names))
    readers = {column: request.cells(column) for column in places}
    above = first[0] + request.header - 1
    numbers: list[int] = []
    values: list[list[float]] = []
    for number, row in chain([first], rows):
        if number <= above:
            continue
        numbers.append(number)
        values.append([])
        for column, place in places.items():
            cell = row[place] if place < len(row) else None
            try:
                values[-1].append(readers[column](cell))
            except NotANumber as odd:
                if cell in ERRORS:
                    odd.remedy = (
                        "a formula failed there: mend it, or list it in `missing: {tokens: [...]}`"
                    )
                name = names[place] if request.header else column
                raise odd.at(f"{label}:row {number}, column {name}") from None
    columns = np.array(values).reshape(len(numbers), len(places)).T
    table = RawTable(
        dict(zip(places, columns, strict=True)), np.array(numbers, np.int64), label, element=title
    )
    if not numbers or np.isnan(columns).any():
        _refuse_what_only_seems_empty(sheet, table, places, above)
    if not numbers:
        raise DataError(f"{label}: the sheet has a header but no data")
    return table


def _refuse_what_only_seems_empty(
    sheet: Any, table: RawTable, places: Mapping[SourceColumn, int], above: int
) -> None:
    """Raise DataError where a value is missing since it was never computed, or stands in the first
    of merged cells.

    `above` is the last row of the header.
    """
    parsing, cells = (
        optional_library(f"openpyxl.{part}", "openpyxl", table.label)
        for part in ("xml.functions", "utils.cell")
    )
    with sheet._get_source() as source:
        for _, part in parsing.iterparse(source):
            tag = part.tag.rpartition("}")[2]
            inner = {one.tag.rpartition("}")[2]: one.text for one in part}
            if tag == "row":
                part.clear()
            # the value of a formula may be an empty text
            has_value = inner.get("v") or ("v" in inner and part.get("t") == "str")
            is_formula = tag == "c" and "f" in inner and not has_value
            reference = part.get("ref" if tag == "mergeCell" else "r")
            if reference is None or not (is_formula or tag == "mergeCell"):
                continue
            left, top, right, bottom = cells.range_boundaries(reference)
            inside = slice(*np.searchsorted(table.rows, (top, bottom + 1)))
            for column in (name for name, place in places.items() if left <= place + 1 <= right):
                rows = table.rows[inside][np.isnan(table.columns[column][inside])].tolist()
                what = f"is one of the merged cells {reference}"
                remedy = "unmerge them, and write the value into each row"
                if is_formula:
                    rows = [top] if top > above else []
                    what = "is a formula that was never computed"
                    remedy = "open the workbook in Excel or LibreOffice and save it"
                for row in rows:
                    raise DataError(f"{table.label}:row {row}, column {column}: {what}", remedy)


READER = Reader(
    "xlsx", read_xlsx, suffixes=(".xlsx",), keys=("header", "skip_rows", "sheet"), peek=peek_xlsx
)
