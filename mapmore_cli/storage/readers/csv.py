"""Delimited text, plain or gzipped, in the dialects that loggers write."""

from __future__ import annotations

import csv
import math
import re
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, islice, product, repeat
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.spool import by_blocks, in_a_row
from mapmore_cli.storage.tables import (
    RawTable,
    Reader,
    SourceColumn,
    TableRequest,
    Top,
    locate_columns,
    reading,
)
from mapmore_cli.storage.tables.cells import (
    NUMBER,
    CellReader,
    NotANumber,
    holds_number,
    number_of,
    shortened,
)
from mapmore_cli.storage.tables.lines import (
    UNREADABLE,
    guess_encoding,
    is_zipped,
    open_lines,
    records_of,
)

WHITESPACE = "whitespace"
DELIMITERS = {"tab": "\t"}
MARKS = ((";", "a semicolon"), ("\t", "a tab"))

LAST, COMPARED, FEWEST_BEFORE = 200, 50, 10
"""Last lines of a file that are looked at, those before the last one with which it is compared, and
how many of these must be numbers.
"""

CHUNK = 8192
"""Lines held as text at one time; where one of them is out of order, all of them are read record by
record.
"""

Numbered = tuple[int, list[str]]
"""Line number in the file, and the fields of the record that ends there."""


@dataclass(frozen=True)
class Layout:
    """What is known after the header: the number of fields in a record, and of the wanted columns
    their places and titles.

    `readers` read their cells; what they know of the stamps of a column goes from block to block.
    """

    width: int
    places: tuple[int, ...]
    titles: tuple[SourceColumn, ...]
    readers: tuple[CellReader, ...] = ()


def read_csv(path: Path, request: TableRequest) -> list[RawTable]:
    """Read the wanted columns of a text file.

    Gzip is recognised by content, not by name; lines end in LF, CR LF or CR. Blank lines are
    skipped (they count as header lines and as skipped rows); an empty field is NaN. Fields beyond
    the last column may only be blank.

    Raises
    ------
    DataError
        Empty, damaged or binary file; a missing column; a record with too few or too many fields; a
        field that is not a number.
    """
    with reading(request.label, "gzip file", UNREADABLE):
        try:
            with open_lines(path, request.encoding, request.label) as (lines, raw):
                return [_parse(lines, raw, request)]
        except UnicodeError as error:
            byte = (
                f" (byte 0x{error.object[error.start]:02x})"
                if isinstance(error, UnicodeDecodeError)
                else f" ({error})"
            )
            raise DataError(
                f"{request.label}: not a text file in {request.encoding.upper()}{byte}",
                f"say `encoding: {guess_encoding(path)}`, which its bytes look like, or save "
                "the table in UTF-8",
            ) from error


def _parse(lines: Iterator[str], raw: BinaryIO, request: TableRequest) -> RawTable:
    deque(islice(lines, request.skip_rows), maxlen=0)
    records = _records(lines, request, request.skip_rows)
    first = next((record for record in records if record[1]), None)
    if first is None:
        raise DataError(f"{request.label}: the file is empty")
    layout = _layout(first[1], request)
    *_, (row, _) = [first, *islice(records, max(request.header - 1, 0))]
    leading = [] if request.header else [values_of_records([first], layout, request)]
    last: deque[str] = deque(maxlen=LAST)
    blocks = chain(
        leading, _blocks(lines, row, layout, request, lambda: request.progress(raw.tell()), last)
    )
    begin = next(blocks, None)
    if begin is None:
        raise DataError(f"{request.label}: the file has a header but no data")
    table = in_a_row(chain([begin], blocks))
    columns = (
        np.ascontiguousarray(table.T) if table.flags.writeable else table.T
    )  # what was spooled stays where it is
    rows = by_blocks(lambda numbers: numbers.astype(np.int64), columns[0])
    found = RawTable(dict(zip(request.columns, columns[1:], strict=True)), rows, request.label)
    return found if is_zipped(raw) else _whole(found, last, request)


def _blocks(
    lines: Iterator[str],
    row: int,
    layout: Layout,
    request: TableRequest,
    told: Callable[[], None],
    last: deque[str],
) -> Iterator[Array]:
    """Yield numbers and values of the lines after `row`, (n, 1 + columns), block by block; `last`
    gets the last lines.
    """
    while block := list(islice(lines, CHUNK)):
        last.extend(block)
        end, values = row + len(block), values_of_lines(block, layout, request)
        if values is not None:
            for read, column in zip(layout.readers, values.T, strict=True):
                if read.clock and np.isfinite(column).any():
                    read.form = NUMBER
            yield np.column_stack([np.arange(row + 1, end + 1), values])
            row = end
        else:
            found: list[Numbered] = []
            for number, cells in _records(chain(block, lines), request, row):
                found += [(number, cells)] if cells else []
                if (row := number) >= end:
                    break
            if found:
                yield values_of_records(found, layout, request)
        told()


def _records(lines: Iterator[str], request: TableRequest, row: int) -> Iterator[Numbered]:
    """Yield the records of lines, of which `row` came before; blank lines are records without
    fields. No line is taken before its time.
    """
    delimiter = DELIMITERS.get(request.delimiter, request.delimiter)
    if delimiter == WHITESPACE:
        yield from ((number, line.split()) for number, line in enumerate(lines, start=row + 1))
        return
    for _, record, number in records_of(lines, delimiter, request.label, row):
        yield number, record if len(record) > 1 or (record and record[0].strip()) else []


def _layout(first: Sequence[str], request: TableRequest) -> Layout:
    names = [name.strip() for name in first] if request.header else None
    hint = separator_hint(first)
    if hint is None and names is not None and all(map(holds_number, names)):
        hint = "The first line holds numbers: give 0-based indices and say `header: false`."
    places = locate_columns(request, names, len(first), hint)
    titles = tuple(column if names is None else names[at] for column, at in places.items())
    return Layout(len(first), tuple(places.values()), titles, tuple(map(request.cells, places)))


def values_of_lines(lines: Sequence[str], layout: Layout, request: TableRequest) -> Array | None:
    """Return the wanted columns, (n, columns), where every line is one record of full width with
    only plain numbers in them; else None.

    NumPy's parser takes a twentieth of the time of `values_of_records`, and every number that it
    accepts is the same number there.
    """
    delimiter = DELIMITERS.get(request.delimiter, request.delimiter)
    if any(
        read.clock and (read.format or read.form not in ("", NUMBER)) for read in layout.readers
    ):
        return None
    if request.thousands is not None and request.thousands in "".join(lines):
        return None
    if request.decimal != ".":
        if any("." in line for line in lines):
            return None
        lines = [line.replace(request.decimal, ".") for line in lines]
    if delimiter == WHITESPACE:
        values = _loaded(lines)
        return (
            values[:, layout.places]
            if values is not None and values.shape[1] == layout.width
            else None
        )
    if set(map(str.count, lines, repeat(delimiter))) != {layout.width - 1}:
        return None
    if '"' in "".join(lines):
        mark = re.escape(delimiter)
        whole = re.compile(rf'(?<![^{mark}])"([^"{mark}\r\n]*)"(?=[{mark}\r\n]|$)')
        lines = [whole.sub(r"\1", line) for line in lines]
        if '"' in "".join(lines):
            return None
    return _loaded(lines, delimiter=delimiter, usecols=layout.places)


def _loaded(lines: Sequence[str], **dialect: Any) -> Array | None:
    """One row for every line; None where NumPy finds something else."""
    try:
        with warnings.catch_warnings(action="ignore"):  # of lines that hold nothing
            values = np.loadtxt(lines, comments=None, ndmin=2, **dialect)
    except (ValueError, TypeError):
        return None
    return values if len(values) == len(lines) else None


def values_of_records(records: Sequence[Numbered], layout: Layout, request: TableRequest) -> Array:
    """Return line numbers and wanted columns of records without blank ones, (n, 1 + columns); an
    empty field is NaN.

    Raises DataError for a record with too few or too many fields; a field that is not a number;
    with row and column.
    """
    wanted = list(zip(layout.places, layout.titles, layout.readers, strict=True))
    values: list[float] = []
    for row, record in records:
        cells = _of_width(row, record, layout.width, request)
        values.append(row)
        for place, title, read in wanted:
            try:
                values.append(read(cells[place]))
            except NotANumber as odd:
                raise odd.at(
                    f"{request.label}:row {row}, column {title}", separator_hint(cells)
                ) from None
    return np.array(values, dtype=float).reshape(len(records), 1 + len(wanted))


def _of_width(row: int, record: list[str], width: int, request: TableRequest) -> list[str]:
    """Return the record with `width` fields: blank ones at its end do not count, and those that a
    short one lacks may be missing.
    """
    if len(record) == width:
        return record
    if len(record) > width and not any(map(str.strip, record[width:])):
        return record[:width]
    if request.incomplete:
        return (
            [""] * width
        )  # a closing remark, half a record, or two run into one: none of its fields can be trusted
    few = "few" if len(record) < width else "many"
    remedy = (
        "Mend or remove the line; a last line that is too short means that the file was cut "
        "off. `missing: drop` leaves it out."
    )
    what = (
        f"{request.label}:row {row}: too {few} fields: {len(record)}, where the first line "
        f"has {width}"
    )
    raise DataError(what, separator_hint(record) or remedy)


def separator_hint(record: Sequence[str]) -> str | None:
    """Return a remedy where the fields look as if something else separated them."""
    for mark, name in MARKS:
        if any(mark in cell for cell in record):
            word = "tab" if mark == "\t" else f'"{mark}"'
            return (
                f"The delimiter looks like {name}: say `delimiter: {word}`, and `decimal: "
                '","` where the numbers have commas.'
            )
    return None


def _whole(table: RawTable, lines: Sequence[str], request: TableRequest) -> RawTable:
    """Return the table, without a last line that has no end and whose last number is shorter than
    all before it: 254.126 was cut to 2.

    Raises DataError for such a line where missing values are errors.
    """
    if not lines or lines[-1].endswith(("\n", "\r")):
        return table
    delimiter = (
        None
        if request.delimiter == WHITESPACE
        else DELIMITERS.get(request.delimiter, request.delimiter)
    )
    *before, last = [line.strip().split(delimiter)[-1].strip() for line in lines if line.strip()]
    if not _is_cut_short(last, before[-COMPARED:], request.decimal):
        return table
    said = (
        f"the last line has no end, and its last number, {shortened(last)}, has fewer digits "
        "than those before it"
    )
    if not request.incomplete:
        remedy = (
            "Get the whole file again. `missing: drop` leaves the line out; a line end behind "
            "it says that it is whole."
        )
        raise DataError(
            f"{request.label}:row {table.rows[-1]}: {said}: the file was cut off", remedy
        )
    columns = {name: column[:-1] for name, column in table.columns.items()}
    return replace(
        table,
        columns=columns,
        rows=table.rows[:-1],
        doubts=(f"{request.label}: {said}: it is left out",),
    )


def _is_cut_short(last: str, before: Sequence[str], decimal: str) -> bool:
    """Whether a number looks cut off beside ten or more numbers `before` it: it has fewer digits
    behind the mark than all of them.

    It has to have three fewer, or none, where theirs vary: of 51 numbers as `repr` writes them, the
    last one may be the shortest. A whole number among whole ones is shorter than all, and less than
    half of the smallest: 98 may follow 101, 25 hardly follows 254.
    """

    def size(cell: str) -> float:
        value = number_of(cell, decimal)
        return math.nan if value is None else abs(value)

    values = {cell: size(cell) for cell in before if math.isfinite(size(cell))}
    if sum(cell in values for cell in before) < FEWEST_BEFORE:
        return False
    digits = {len(cell.partition(decimal)[2]) for cell in values}
    if min(digits):
        return len(last.partition(decimal)[2]) < max(1, min(digits) - 2 * (len(digits) > 1))
    return (
        decimal not in last
        and len(last) < min(map(len, values))
        and size(last) < min(values.values()) / 2
    )


def peek_csv(path: Path, most: int) -> Iterable[Top]:
    """Return the first lines of a text file, cut in every way that is usual; those with decimal
    points first.
    """
    with reading(path.name, "gzip file", UNREADABLE):
        encoding = guess_encoding(path)
        with open_lines(path, encoding, path.name, errors="replace") as (taken, _):
            lines = [line.rstrip("\r\n") for line in islice(taken, most)]
    if any("\0" in line for line in lines):
        raise DataError(f"{path.name}: is no text", "save the table as CSV")
    told = {} if encoding == "utf-8" else {"encoding": encoding}
    return [
        Top(_cut(lines, character), reads, {**told, **delimiter, **decimal})
        for (character, delimiter), (reads, decimal) in product(_DIALECTS, _NUMBERS)
        if not (decimal and character == ",")
    ]


def _cut(lines: Sequence[str], delimiter: str | None) -> list[list[str]]:
    """Lines cut at the delimiter, at any run of blanks where it is None; blank lines have no
    fields.
    """
    try:
        return (
            [line.split() for line in lines]
            if delimiter is None
            else list(csv.reader(lines, delimiter=delimiter))
        )
    except csv.Error:  # quotes that never close
        return []


_DIALECTS: tuple[tuple[str | None, dict[str, Any]], ...] = (
    (",", {}),
    (";", {"delimiter": ";"}),
    ("\t", {"delimiter": "tab"}),
    ("|", {"delimiter": "|"}),
    (None, {"delimiter": "whitespace"}),
)
_NUMBERS: tuple[tuple[Callable[[Any], bool], dict[str, Any]], ...] = (
    (partial(holds_number, decimal="."), {}),
    (partial(holds_number, decimal=","), {"decimal": ","}),
)
"""Dialects in the order of preference where several fit."""

READER = Reader(
    "csv",
    read_csv,
    suffixes=(".csv", ".txt", ".tsv", ".dat"),
    keys=("header", "skip_rows", "delimiter", "decimal", "thousands", "encoding"),
    peek=peek_csv,
)
