"""Read workbooks of all kinds with python-calamine. A cell with a formula has the value that the
spreadsheet program computed last.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from typing import Any

import mapmore_cli
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage import workbooks
from mapmore_cli.storage.tables import (
    BOMB_RATIO,
    BOMB_SIZE,
    Noted,
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
from mapmore_cli.storage.tables.below import Below, chosen_table, tables_below
from mapmore_cli.storage.tables.cells import Lacking, holds_number, number_of
from mapmore_cli.storage.tables.lines import head_of
from mapmore_cli.storage.tables.rows import Row, table_of_rows

LONGEST = 10
"""Processor time in seconds that reading a workbook may take, in addition to one second for each
megabyte.
"""

FILL_SHEET = "Fill the sheet, or name the sheet to read with `sheet`."

TOO_LARGE = 3  # exit code of the process that reads the workbook, if a sheet has too many cells


@dataclass(frozen=True)
class DateCell:
    """A cell with the type date or time. (A text that looks like a date is a `str`.)"""

    stamp: str

    def __str__(self) -> str:
        return self.stamp


class Percentage(float):
    """A number that the workbook shows in per cent. The stored number, for example 0.2, is shown as
    20 %.
    """


IS_RATIO = Noted("1", shown="is shown in per cent: 0.2 stands behind 20 %")
"""Information in a workbook about a column with numbers that are shown in per cent."""


@dataclass(frozen=True)
class SheetCells:
    """A sheet of a workbook. All rows have the same number of cells. `hidden_rows` and
    `hidden_columns` are the indices of hidden rows and columns, counted from 0.
    """

    title: str
    is_visible: bool
    rows: list[list[Any]]
    hidden_rows: list[int]
    hidden_columns: list[int]

    def filled_rows(self, skip_rows: int) -> list[Row]:
        """Return the rows that contain at least one filled cell, without the first `skip_rows` rows
        of the sheet. Each row is returned with its number in the sheet, counted from 1.
        """
        return [
            (number, row)
            for number, row in enumerate(self.rows, start=1)
            if number > skip_rows and any(map(_is_filled, row))
        ]


def read_xlsx(path: Path, request: TableRequest) -> list[RawTable]:
    """Read the wanted columns of one sheet of a workbook, or of every sheet whose title matches the
    glob `request.sheet`.

    Empty rows are skipped, but the numbers `header` and `skip_rows` include them. An empty cell is
    NaN.

    Raises
    ------
    DataError
        No workbook, or a damaged one; a missing sheet or column; a cell that is not a number;
        python-calamine not installed.
    """
    with reading(request.label, "workbook"):
        sheets, doubts = _chosen_sheets(_sheets_in(path, request.label), request)
        first, *others = [_table_of_sheet(sheet, request) for sheet in sheets]
    return [replace(first, doubts=(*doubts, *first.doubts)), *others]


def peek_xlsx(path: Path, most: int) -> Iterable[Top]:
    """Return the first rows of every visible sheet that is not empty, in the order of the sheets.
    For all sheets except the first, the settings contain the title of the sheet, because a spec
    must name it.
    """
    with reading(path.name, "workbook"):
        sheets = _visible_sheets(_sheets_in(path, path.name, most))
    tops = []
    for number, sheet in enumerate(sheets):
        if sheet.rows or not number:
            decimal = _decimal_in_texts(sheet.rows)
            settings = {"sheet": sheet.title} if number else {}
            if decimal == ",":
                settings["decimal"] = decimal
            rule, units = _number_rule(decimal), _ratios_in(sheet)
            tops.append(Top(sheet.rows, rule, settings, sheet=sheet.title, units=units))
    return tops


def _ratios_in(sheet: SheetCells) -> tuple[str, ...]:
    """Return the unit of each column: `1` if a cell in it is shown in per cent, otherwise an empty
    text. If no cell of the sheet is shown in per cent, return an empty tuple.
    """
    columns = zip(*sheet.rows, strict=True)
    shown = [any(isinstance(cell, Percentage) for cell in column) for column in columns]
    return tuple("1" if is_ratio else "" for is_ratio in shown) if any(shown) else ()


def _is_filled(cell: object) -> bool:
    return bool(str(cell).strip() if isinstance(cell, str | Lacking) else cell is not None)


def _decimal_in_texts(rows: Iterable[Sequence[Any]]) -> str | None:
    """Return the decimal mark of the numbers that the sheet stores as texts. At least two such
    texts must have the same mark; otherwise, the result is None, because a single title or remark
    can look like a number.
    """
    texts = [cell for row in rows for cell in row if isinstance(cell, str)]
    counts = {
        mark: sum(mark in text and number_of(text, mark) is not None for text in texts)
        for mark in (".", ",")
    }
    mark = max(counts, key=counts.__getitem__)
    return mark if counts[mark] > 1 else None


def _number_rule(decimal: str | None) -> Callable[[Any], bool]:
    """Return a function that returns True for a cell with a number. If the sheet stores numbers as
    texts, `decimal` is their decimal mark, and the function accepts such texts. If `decimal` is
    None, all texts are titles or remarks, for example `2026`.
    """
    if decimal is None:
        return lambda cell: not isinstance(cell, str) and holds_number(cell)
    return partial(holds_number, decimal=decimal)


def _sheets_in(path: Path, label: str, most: int = 0) -> list[SheetCells]:
    """Return the sheets of a workbook with at most `most` rows each; 0 means all rows. Raises
    ValueError for a damaged workbook.

    The workbook is read by a separate process, which a damaged workbook can crash: see
    `storage/workbooks/__main__.py`.
    """
    optional_library("python_calamine", "python-calamine", label)
    size, head = path.stat().st_size, head_of(path)
    if head and b"\0" not in head:
        raise DataError(
            f"{label}: is a text file with the name of a workbook",
            "rename it so that its name ends in .txt",
        )
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            for member in archive.infolist():
                refuse_bombs(f"{label}: {member.filename}", member.file_size, member.compress_size)
    room, seconds = 10 * BOMB_SIZE + BOMB_RATIO * size, LONGEST + size // 10**6
    here = str(Path(mapmore_cli.__file__).parents[1])
    limits = (str(path), str(most), str(room), str(seconds))
    done = subprocess.run(
        [sys.executable, "-P", "-m", workbooks.__name__, *limits],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        check=False,
        env={
            **os.environ,
            "PYTHONPATH": os.pathsep.join(
                [here, *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
            ),
        },
    )
    if done.returncode == TOO_LARGE:
        raise DataError(
            f"{label}: {done.stdout.decode().strip()}, far more than its {size} bytes can hold",
            "delete the cells far away from the table, and save the workbook again",
        )
    if done.returncode:
        lines = done.stderr.decode(errors="replace").splitlines() if done.returncode > 0 else ()
        most_likely = "reading it takes more memory or processor time than its size explains"
        raise ValueError(lines[-1] if lines else most_likely)
    return [SheetCells(*parts) for parts in json.loads(done.stdout, object_hook=_special_cell)]


def _special_cell(cell: dict[str, Any]) -> DateCell | Lacking | Percentage:
    """Return the object for a cell that the other process has written as a JSON object, because it
    is neither a number nor a text.
    """
    if "percent" in cell:
        return Percentage(cell["percent"])
    if "stamp" in cell:
        return DateCell(cell["stamp"])
    if not cell["lacks"]:
        return Lacking(
            "is a formula that was never computed",
            "open the workbook in Excel or LibreOffice and save it",
            "=",
        )
    remedy = "unmerge them, and write the value into each row"
    return Lacking(f"is one of the merged cells {cell['lacks']}", remedy)


def _visible_sheets(sheets: list[SheetCells]) -> list[SheetCells]:
    """Return the visible sheets; all sheets if all are hidden."""
    return [sheet for sheet in sheets if sheet.is_visible] or sheets


def _chosen_sheets(
    sheets: list[SheetCells], request: TableRequest
) -> tuple[list[SheetCells], tuple[str, ...]]:
    """Return the sheets that the request selects by a title or a glob, and warnings. Without a
    title, the first visible sheet is selected, with a warning if other sheets contain cells.

    A hidden sheet is selected only by its exact title. Among the sheets that match a glob, empty
    ones are left out, unless all are empty.
    """
    visible, label = _visible_sheets(sheets), request.label
    if not visible:
        raise DataError(f"{label}: has no sheet with cells", "save the table into a sheet")
    if named := [sheet for sheet in sheets if sheet.title == request.sheet]:
        return named, ()
    filled = [sheet for sheet in visible if sheet.filled_rows(request.skip_rows)]
    if request.sheet is None:
        others = [sheet.title for sheet in filled if sheet is not visible[0]]
        doubt = (
            f"{label}: the sheet '{visible[0].title}' is read, and not {', '.join(others[:4])}; "
            "name the sheet to read with `sheet`"
        )
        return visible[:1], (doubt,) if others else ()
    for among in (filled, visible):
        if named := [sheet for sheet in among if fnmatchcase(sheet.title, request.sheet)]:
            return named, ()
    raise DataError(
        f"{label}: there is no sheet '{request.sheet}'",
        known_names(request.sheet, [sheet.title for sheet in sheets], "The workbook has"),
    )


def _table_of_sheet(sheet: SheetCells, request: TableRequest) -> RawTable:
    rows, label = sheet.filled_rows(request.skip_rows), f"{request.label}:{sheet.title}"
    if not rows:
        raise DataError(f"{label}: the sheet is empty", FILL_SHEET)
    if request.table is not None:
        rule = _number_rule(_decimal_in_texts(row for _, row in rows))
        selected = chosen_table(rows, request, rule)
        rows = [*selected.header, *selected.rows]
    top, first = rows[0]
    names = [str(cell).strip() for cell in first] if request.header else None
    places = locate_columns(request, names, len(first))
    below = top + request.header
    hidden = {number + 1 for number in sheet.hidden_rows}
    body = [(number, row) for number, row in rows if number >= below]
    unseen = [number for number, _ in body if number in hidden]
    doubts = tuple(_hidden_in_words(sheet, places, unseen, request, label))
    if request.hidden == "drop":
        body = [(number, row) for number, row in body if number not in hidden]
    if not body:
        content = "no row that is shown" if unseen else "a header but no data"
        remedy = "Show its rows, or remove `hidden: drop`." if unseen else FILL_SHEET
        raise DataError(f"{label}: the sheet has {content}", remedy)
    noted = {
        column: IS_RATIO
        for column, place in places.items()
        if any(isinstance(row[place], Percentage) for _, row in body)
    }
    table = table_of_rows(body, places, names, request, label)
    is_named = request.sheet in (None, sheet.title)
    element = None if is_named else sheet.title
    return replace(table, element=element, noted=noted, doubts=doubts)


def _hidden_in_words(
    sheet: SheetCells,
    places: Mapping[SourceColumn, int],
    rows: Sequence[int],
    request: TableRequest,
    label: str,
) -> Iterator[str]:
    """Yield warnings about hidden rows and columns that are read."""
    if rows and request.hidden != "drop":
        yield (
            f"{label}: {len(rows)} hidden row{'s are' if len(rows) > 1 else ' is'} read (first: "
            f"row {rows[0]}); `hidden: drop` leaves out the rows that a filter or a person has "
            "hidden"
        )
    if columns := [column for column, place in places.items() if place in sheet.hidden_columns]:
        yield f"{label}: the column '{columns[0]}' is hidden in the workbook, and is read"


def below_xlsx(path: Path, request: TableRequest) -> list[Below]:
    """Return the tables that stand below each other or side by side in the requested
    sheet.
    """
    with reading(request.label, "workbook"):
        sheets, _ = _chosen_sheets(_sheets_in(path, request.label), request)
    rows = sheets[0].filled_rows(0)
    rule = _number_rule(_decimal_in_texts(row for _, row in rows))
    return tables_below(rows, request.header, rule)


BEGINS = (
    rb"PK\x03\x04.*?(?:xl/(?:workbook|worksheets|sharedStrings|styles|theme)|\.spreadsheet)"
    rb"|\xd0\xcf\x11\xe0.*?(?:W\0o\0r\0k\0b|B)\0o\0o\0k\0"
)
"""First bytes of an archive with the parts of a workbook, or of a file of Excel 97 to 2003."""

READER = Reader(
    "xlsx",
    read_xlsx,
    suffixes=(".xlsx", ".xlsm", ".xlsb", ".xls", ".ods"),
    keys=("header", "skip_rows", "table", "decimal", "thousands", "sheet", "hidden"),
    peek=peek_xlsx,
    below=below_xlsx,
    begins=BEGINS,
)
