"""Check the tables that readers return, in one place for all readers (the gate). If a file is
incomplete, an error is raised, or the incomplete rows are left out with a warning.

Two other checks stand elsewhere: duplicate names are refused when a name is searched
(`locate_columns`, `Member.named`), and cells without a number when a cell is read
(`cells.CellReader`).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from functools import partial
from itertools import takewhile
from pathlib import Path

from mapmore_cli.domain.arrays import Rows
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import (
    Cut,
    OpenEnd,
    RawTable,
    Reader,
    TableRequest,
    Top,
    reading,
)
from mapmore_cli.storage.tables.beginnings import refuse_other_format
from mapmore_cli.storage.tables.cells import shortened

# smallest number of rows that must have equal numbers of decimals before a last row with fewer
# decimals is regarded as incomplete
FEWEST_ROWS = 10

DAMAGE = (OSError, EOFError, ValueError)
"""Errors that reading a damaged file raises; any other error is a fault of the reader and is passed
on.
"""


def gated(reader: Reader, readers: Collection[Reader]) -> Reader:
    """Return the reader with two checks added. Before the first rows of a file are read, the format
    of the file is checked. After `read`, the tables are checked for incomplete rows. If a file
    cannot be read, the error names the reader among `readers` that can read it.
    """
    read = partial(_judged_tables, reader, readers)
    peek = reader.peek or partial(_first_rows, read)
    return replace(reader, read=read, peek=partial(_judged_rows, reader, readers, peek))


def _judged_rows(
    reader: Reader,
    readers: Collection[Reader],
    peek: Callable[[Path, int], Iterable[Top]],
    path: Path,
    most: int,
) -> Iterable[Top]:
    refuse_other_format(reader, readers, path, path.name)
    return peek(path, most)


def _judged_tables(
    reader: Reader, readers: Collection[Reader], path: Path, request: TableRequest
) -> list[RawTable]:
    try:
        with reading(request.label, f"file for the reader `{reader.name}`", DAMAGE):
            return [
                _without_cut_rows(_with_padding_told(table), request)
                for table in reader.read(path, request)
            ]
    except DataError:
        refuse_other_format(reader, readers, path, request.label)
        raise


def _first_rows(
    read: Callable[[Path, TableRequest], list[RawTable]], path: Path, most: int
) -> Iterable[Top]:
    """Return the first `most` rows of all columns of a file. They are read by `read` with a request
    without columns, which means all columns.
    """
    for table in read(path, TableRequest(path.name, ())):
        rows = zip(*(values[:most].tolist() for values in table.columns.values()), strict=True)
        return [Top([list(table.columns), *rows], lambda cell: isinstance(cell, float))]
    return []


def _with_padding_told(table: RawTable) -> RawTable:
    """Return the table. If fill characters follow the text in its file, a warning about them is
    added.
    """
    if not table.padding:
        return table
    doubt = (
        f"{table.label}: ends with {table.padding} characters of padding (NUL or Ctrl-Z), which "
        "are left out; a logger that reserves space in advance leaves them when it loses power"
    )
    return replace(table, doubts=(*table.doubts, doubt))


def _without_cut_rows(table: RawTable, request: TableRequest) -> RawTable:
    """Return the table without the incomplete rows at its end, with a warning.

    Raises DataError for an incomplete file if missing values are errors.
    """
    cut, end = table.breaks_off, table.open_end
    if cut is None and end is not None and not table.is_empty_at(-1):
        cut = _cut_in(end, table.rows)
    if cut is None:
        return table
    where = table.at(-1) if cut.rows else table.label
    cut.refuse(where, request)
    size = table.size - cut.rows
    return replace(
        table,
        columns={name: column[:size] for name, column in table.columns.items()},
        rows=table.rows[:size],
        doubts=(*table.doubts, f"{where}: {cut.said}: {cut.done}"),
    )


def _cut_in(end: OpenEnd, rows: Rows) -> Cut | None:
    """Return evidence that the last line of a text is incomplete. `end` holds the last lines of a
    text that has no line break at its end. There are three kinds of evidence:

    - The line has fewer cells than every line before it.
    - Its last cell has fewer decimals than the cells above it in the same column, which all have
      the same number of decimals: for example 2 below cells such as 254.126.
    - Its last cell ends with the decimal point, and no cell above it does.

    Return None without evidence, or if the line is not among the `rows` of the table.
    """
    # number of samples in the last line; a line of a map holds several
    samples = len([*takewhile(lambda row: row == end.row, reversed(rows))])
    if not samples:
        return None
    lines = end.rows[-int(end.row - rows[0] + 1) :]
    *before, last = [line for line in lines if any(map(str.strip, line))] or [[""]]
    column = [row[len(last) - 1] for row in before if len(row) >= len(last)]
    number = last[-1].strip()
    digits = {len(cell.strip().partition(end.decimal)[2]) for cell in column}

    def is_pointed(cell: str) -> bool:
        return cell.strip().endswith(end.decimal)

    if len(last) < min(map(_filled, before), default=0):
        why = f"only {len(last)} fields, fewer than the lines before it"
    elif len(column) >= FEWEST_ROWS and (
        len(number.partition(end.decimal)[2]) < min(digits) == max(digits)
        or (number.endswith(end.decimal) and not any(map(is_pointed, column)))
    ):
        cell = shortened(number) or "which is empty"
        why = f"fewer digits in its last cell, {cell}, than the lines before it"
    else:
        return None
    return Cut(
        f"the last line has no line break at its end, and {why}: it was cut off",
        (
            "Get the whole file again. `missing: drop` leaves the line out. If the line is "
            "complete, end it with a line break."
        ),
        "it is left out",
        rows=samples,
    )


def _filled(cells: Sequence[str]) -> int:
    """Return the number of cells up to the last one that is not blank."""
    return max((place for place, cell in enumerate(cells, 1) if cell.strip()), default=0)
