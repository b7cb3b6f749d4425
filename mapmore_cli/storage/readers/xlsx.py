"""Workbooks of all kinds, read with python-calamine; formulas count with the values that were last
computed.
"""

from __future__ import annotations

import json
import posixpath
import re
import subprocess
import sys
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from mapmore_cli.domain.arrays import row_numbers
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage import workbooks
from mapmore_cli.storage.tables import (
    BOMB_RATIO,
    BOMB_SIZE,
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
from mapmore_cli.storage.tables.cells import CellReader, NotANumber, holds_number
from mapmore_cli.storage.tables.lines import head_of
from mapmore_cli.storage.tables.rows import Row, table_of_rows


@dataclass(frozen=True)
class DateCell:
    """A cell with a date or a time, which is no text."""

    stamp: str

    def __str__(self) -> str:
        return self.stamp


@dataclass(frozen=True)
class SheetCells:
    """A sheet: its rows, all as wide as the widest, and its merged cells as [[top, left], [bottom,
    right]], from 0.
    """

    title: str
    is_visible: bool
    rows: list[list[Any]]
    merged: list[list[tuple[int, int]]]

    def filled_rows(self, skip_rows: int) -> list[Row]:
        """Return the rows below `skip_rows` that have a cell, with their numbers from 1."""
        return [
            (number, row)
            for number, row in enumerate(self.rows, start=1)
            if number > skip_rows and any(map(_is_filled, row))
        ]


def read_xlsx(path: Path, request: TableRequest) -> list[RawTable]:
    """Read the wanted columns of one sheet of a workbook, or of every sheet that the request's glob
    names.

    Empty rows are skipped (they count as header lines and as skipped rows); an empty cell is NaN.

    Raises
    ------
    DataError
        No workbook, or a damaged one; a missing sheet or column; a cell that is not a number;
        python-calamine not installed.
    """
    with reading(request.label, "workbook"):
        sheets, doubts = _chosen_sheets(_sheets_in(path, request.label), request)
        first, *others = [_table_of_sheet(path, sheet, request) for sheet in sheets]
    return [replace(first, doubts=doubts), *others]


def peek_xlsx(path: Path, most: int) -> Iterable[Top]:
    """Return the first rows of every visible sheet that has some, the first one's first; a later
    sheet has to be named.
    """
    with reading(path.name, "workbook"):
        sheets = _visible_sheets(_sheets_in(path, path.name, most))
    return [
        Top(sheet.rows, _is_no_text, {"sheet": sheet.title} if number else {}, sheet=sheet.title)
        for number, sheet in enumerate(sheets)
        if sheet.rows or not number
    ]


def _is_filled(cell: Any) -> bool:
    return bool(cell.strip()) if isinstance(cell, str) else cell is not None


def _is_no_text(cell: Any) -> bool:
    return not isinstance(cell, str) and holds_number(cell)


def _sheets_in(path: Path, label: str, most: int = 0) -> list[SheetCells]:
    """Return the sheets of a workbook, of each so many rows (all where 0); ValueError for a damaged
    one.

    A process of its own reads them: see `storage/workbooks.py`.
    """
    optional_library("python_calamine", "python-calamine", label)
    size, head = path.stat().st_size, head_of(path)
    if head and b"\0" not in head:
        raise DataError(
            f"{label}: is a text under the name of a workbook", "give its name the suffix .txt"
        )
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            for member in archive.infolist():
                refuse_bombs(f"{label}: {member.filename}", member.file_size, member.compress_size)
    room = 10 * BOMB_SIZE + BOMB_RATIO * size
    command = [sys.executable, "-P", workbooks.__file__, str(path), str(most), str(room)]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False)
    if done.returncode:
        told = done.stderr.decode(errors="replace").splitlines() if done.returncode > 0 else ()
        raise ValueError(told[-1] if told else "it asks for more memory than its size explains")
    sheets = json.loads(done.stdout, object_hook=lambda cell: DateCell(**cell))
    return [SheetCells(*parts) for parts in sheets]


def _visible_sheets(sheets: list[SheetCells]) -> list[SheetCells]:
    """Return the sheets that are not hidden; all where every one is."""
    return [sheet for sheet in sheets if sheet.is_visible] or sheets


def _chosen_sheets(
    sheets: list[SheetCells], request: TableRequest
) -> tuple[list[SheetCells], tuple[str, ...]]:
    """Return the sheets to read, and doubts about the choice.

    Hidden sheets are read where they are named. Of several, those that are empty are left out.
    """
    visible, label = _visible_sheets(sheets), request.label
    if not visible:
        raise DataError(f"{label}: has no sheet with cells", "save the table into a sheet")
    if named := [sheet for sheet in sheets if sheet.title == request.sheet]:
        return named, ()
    filled = [sheet for sheet in visible if sheet.filled_rows(request.skip_rows)]
    if request.sheet is None:
        others = [sheet.title for sheet in filled if sheet is not visible[0]]
        told = (
            f"{label}: the sheet '{visible[0].title}' is read, and not "
            f"{', '.join(others[:4])}; say which by `sheet`"
        )
        return visible[:1], (told,) if others else ()
    for among in (filled, visible):
        if named := [sheet for sheet in among if fnmatchcase(sheet.title, request.sheet)]:
            return named, ()
    raise DataError(
        f"{label}: there is no sheet '{request.sheet}'",
        known_names(request.sheet, [sheet.title for sheet in sheets], "The workbook has"),
    )


def _table_of_sheet(path: Path, sheet: SheetCells, request: TableRequest) -> RawTable:
    rows, label = sheet.filled_rows(request.skip_rows), f"{request.label}:{sheet.title}"
    if not rows:
        raise DataError(f"{label}: the sheet is empty")
    top, first = rows[0]
    names = [str(cell).strip() for cell in first] if request.header else None
    places = locate_columns(request, names, len(first))
    below = top + request.header
    body = [(number, row) for number, row in rows if number >= below]
    table = table_of_rows(body, places, names, request, label)
    if not body or any(np.isnan(column).any() for column in table.columns.values()):
        _refuse_merged(sheet, table, places)
        wanted = {_column_letters(place): column for column, place in places.items()}
        for number, letters, cell in _unread_cells(path, sheet.title):
            if number >= below and letters in wanted:
                where = f"{label}:row {number}, column {wanted[letters]}"
                _refuse_unread(where, cell, request.cells(wanted[letters]))
    if not body:
        raise DataError(f"{label}: the sheet has a header but no data")
    is_named = request.sheet in (None, sheet.title)
    return table if is_named else replace(table, element=sheet.title)


def _refuse_merged(sheet: SheetCells, table: RawTable, places: Mapping[SourceColumn, int]) -> None:
    """Raise DataError where a value is missing since it stands in the first of merged cells."""
    for (top, left), (bottom, right) in sheet.merged:
        for column, place in places.items():
            rows = row_numbers(table.rows)
            inside = (rows > top) & (rows <= bottom + 1)
            empty = rows[inside & np.isnan(table.columns[column])]
            if left <= place <= right and empty.size:
                cells = f"{_column_letters(left)}{top + 1}:{_column_letters(right)}{bottom + 1}"
                where = f"{table.label}:row {empty[0]}, column {column}"
                raise DataError(
                    f"{where}: is one of the merged cells {cells}",
                    "unmerge them, and write the value into each row",
                )


def _column_letters(place: int) -> str:
    """Return the letters by which a workbook names a column: B of 1, AA of 26."""
    return (_column_letters(place // 26 - 1) if place > 25 else "") + chr(ord("A") + place % 26)


def _unread_cells(path: Path, title: str) -> Iterator[tuple[int, str, str | None]]:
    """Yield row, letters of the column, and text of the cells of an .xlsx file that calamine leaves
    empty: a formula's error, or None for a formula that was never computed.
    """
    if not zipfile.is_zipfile(path):
        return
    with zipfile.ZipFile(path) as archive:
        if "xl/workbook.xml" not in archive.namelist():  # .ods and .xlsb
            return
        book = ElementTree.fromstring(archive.read("xl/workbook.xml"))
        links = ElementTree.fromstring(archive.read("xl/_rels/workbook.xml.rels"))
        entry = next(one for one in book.iterfind(".//{*}sheet") if one.get("name") == title)
        key = next(value for name, value in entry.items() if name.endswith("}id"))
        part = next(str(link.get("Target")) for link in links if link.get("Id") == key)
        with archive.open(posixpath.join("xl", part).lstrip("/")) as stream:
            for _, node in ElementTree.iterparse(stream):
                space, _, tag = node.tag.rpartition("}")
                if tag == "row":
                    node.clear()
                elif tag == "c":
                    kind, value = node.get("t"), node.findtext(f"{space}}}v")
                    # the value of a formula may be an empty text
                    is_open = not value and node.find(f"{space}}}f") is not None
                    if kind == "e" or (is_open and (kind != "str" or value is None)):
                        _, letters, number = re.split(r"([A-Z]+)", node.get("r", ""))
                        yield int(number), letters, value or None


def _refuse_unread(where: str, cell: str | None, read: CellReader) -> None:
    """Raise DataError for a cell of `_unread_cells`; an error may stand for a missing value."""
    if cell is None:
        raise DataError(
            f"{where}: is a formula that was never computed",
            "open the workbook in Excel or LibreOffice and save it",
        )
    try:
        read(cell)
    except NotANumber as odd:
        remedy = "a formula failed there: mend it, or list it in `missing: {tokens: [...]}`"
        raise odd.at(where, remedy) from None


READER = Reader(
    "xlsx",
    read_xlsx,
    suffixes=(".xlsx", ".xlsm", ".xlsb", ".xls", ".ods"),
    keys=("header", "skip_rows", "sheet"),
    peek=peek_xlsx,
)
