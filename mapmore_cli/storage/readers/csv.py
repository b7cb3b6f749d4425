"""Delimited text, plain or gzipped, in the dialects that loggers write."""

from __future__ import annotations

import csv
import gzip
import math
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.spool import by_blocks, in_a_row
from mapmore_cli.storage.tables.lines import (
    Lines,
    guess_encoding,
    last_lines,
    lines_of,
    open_lines,
    open_quote,
    quote_left_open,
)
from mapmore_cli.storage.tables.table import RawTable, Reader, TableRequest, Top, locate_columns
from mapmore_cli.storage.tables.text import (
    DELIMITERS,
    WHITESPACE,
    Layout,
    Numbered,
    cut_short,
    seconds_of_stamp,
    separator_hint,
    shortened,
    values_of_lines,
    values_of_records,
)

COMPARED = 50
"""Lines before the last one, with which it is compared."""

CHUNK = 8192
"""Lines held as text at one time; where one of them is out of order, all of them are read record by record."""


def read_csv(path: Path, request: TableRequest) -> list[RawTable]:
    """Read the wanted columns of a text file.

    Gzip is recognised by content, not by name; lines end in LF, CR LF or CR. Blank lines are skipped (they count as header lines and
    as skipped rows); an empty field is NaN. Fields beyond the last column may only be blank.

    Raises
    ------
    DataError
        Empty, damaged or binary file; a missing column; a record with too few or too many fields; a field that is not a number.
    """
    with _damage_told(request.label):
        return _read(path, request)


@contextmanager
def _damage_told(label: str) -> Iterator[None]:
    """Turn what unpacking says of a damaged file into a DataError."""
    try:
        yield
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise DataError(f"{label}: the file is damaged: {error}", "It may have been cut off while copying; get it again.") from error


def _read(path: Path, request: TableRequest) -> list[RawTable]:
    label = request.label
    try:
        with open_lines(path, request.encoding, label) as lines:
            return [_whole(_parse(lines, request), path, request)]
    except gzip.BadGzipFile:  # an OSError, and told as damage
        raise
    except UnicodeError as error:
        byte = f" (byte 0x{error.object[error.start]:02x})" if isinstance(error, UnicodeDecodeError) else f" ({error})"
        raise DataError(
            f"{label}: not a text file in {request.encoding.upper()}{byte}",
            f"say `encoding: {guess_encoding(path)}`, which its bytes look like, or save the table in UTF-8",
        ) from error
    except csv.Error as error:
        raise DataError(f"{label}: not a readable CSV file: {error}", "Look for a quotation mark that is never closed.") from error
    except OSError as error:
        raise DataError(f"{label}: cannot be read: {error.strerror or error}") from error


def _parse(lines: Lines, request: TableRequest) -> RawTable:
    lines.take(request.skip_rows)
    records = _records(lines, request)
    first = next((record for record in records if record[1]), None)
    if first is None:
        raise DataError(f"{request.label}: the file is empty")
    layout = _layout(first[1], request)
    for _ in range(request.header - 1):
        next(records, None)
    leading = [] if request.header else [first]
    parts = _parts(lines, records, leading, layout, request)
    begin = next(parts, None)
    if begin is None:
        raise DataError(f"{request.label}: the file has a header but no data")
    table = in_a_row(chain([begin], parts))
    columns = np.ascontiguousarray(table.T) if table.flags.writeable else table.T  # what was spooled stays where it is
    rows = by_blocks(lambda numbers: numbers.astype(np.int64), columns[0])
    return RawTable(dict(zip(request.columns, columns[1:], strict=True)), rows, request.label)


def _records(lines: Lines, request: TableRequest) -> Iterator[Numbered]:
    """Yield the records that begin with the next line, blank lines as records without fields; no line is taken before it is needed."""
    if request.delimiter == WHITESPACE:
        yield from ((lines.taken, line.split()) for line in lines)
        return
    delimiter = DELIMITERS.get(request.delimiter, request.delimiter)
    taken: list[str] = []
    records = csv.reader(_remembered(lines, taken), delimiter=delimiter)
    while True:
        try:
            record = next(records, None)
        except csv.Error as error:  # a field that is longer than any number
            raise open_quote(request.label, lines.taken - len(taken) + 1) from error
        if record is None:
            return
        if quote_left_open(taken, record, delimiter):
            raise open_quote(request.label, lines.taken - len(taken) + 1)
        taken.clear()
        yield lines.taken, record if len(record) > 1 or (record and record[0].strip()) else []


def _remembered(lines: Iterator[str], taken: list[str]) -> Iterator[str]:
    for line in lines:
        taken.append(line)
        yield line


def _layout(first: Sequence[str], request: TableRequest) -> Layout:
    names = [name.strip() for name in first] if request.header else None
    places = locate_columns(request, names, len(first), separator_hint(first) or _header_hint(first, request))
    return Layout(len(first), tuple(places.values()), tuple(column if names is None else names[at] for column, at in places.items()))


def _parts(
    lines: Lines, records: Iterator[Numbered], leading: Sequence[Numbered], layout: Layout, request: TableRequest
) -> Iterator[Array]:
    """Line numbers and values of the data, (n, 1 + columns), piece by piece; `leading` are records that have been taken already."""
    if leading:
        yield _numbered(leading, layout, request)
    while block := lines.take(CHUNK):
        values, last = values_of_lines(block, layout, request), lines.taken
        if values is not None:
            yield np.column_stack([np.arange(last - len(values) + 1, last + 1), values])
        else:
            lines.put_back(block)
            if found := list(_filled_until(last, lines, records)):
                yield _numbered(found, layout, request)
        request.progress(lines.position)


def _filled_until(end: int, lines: Lines, records: Iterator[Numbered]) -> Iterator[Numbered]:
    """Yield records that are not blank, up to that which holds line `end`."""
    while lines.taken < end and (record := next(records, None)):
        if record[1]:
            yield record


def _whole(table: RawTable, path: Path, request: TableRequest) -> RawTable:
    """Return the table, without a last line that has no end and whose last number is shorter than all before it: 254.126 was cut to 2.

    Raises DataError for such a line where missing values are errors.
    """
    lines = last_lines(path, request.encoding)
    if lines is None or lines[-1].endswith(("\n", "\r")):
        return table
    delimiter = DELIMITERS.get(request.delimiter, request.delimiter)
    *before, last = [line.strip().split(None if delimiter == WHITESPACE else delimiter)[-1].strip() for line in lines if line.strip()]
    if not cut_short(last, before[-COMPARED:], request.decimal):
        return table
    said = f"the last line has no end, and its last number, {shortened(last)}, has fewer digits than those before it"
    if not request.incomplete:
        remedy = "Get the whole file again. `missing: drop` leaves the line out; a line end behind it says that it is whole."
        raise DataError(f"{request.label}:row {table.rows[-1]}: {said}: the file was cut off", remedy)
    columns = {name: column[:-1] for name, column in table.columns.items()}
    return replace(table, columns=columns, rows=table.rows[:-1], doubts=(f"{request.label}: {said}: it is left out",))


def _numbered(records: Sequence[Numbered], layout: Layout, request: TableRequest) -> Array:
    return np.column_stack([[row for row, _ in records], values_of_records(records, layout, request)])


def _header_hint(first: Sequence[str], request: TableRequest) -> str | None:
    """Return a remedy where a header is expected but the first line holds numbers."""
    try:
        looks_like_data = request.header and not math.isnan(sum(map(float, first)))
    except ValueError:
        return None
    return "The first line holds numbers: give 0-based indices and say `header: false`." if looks_like_data else None


def peek_csv(path: Path, most: int) -> Iterable[Top]:
    """Return the first lines of a text file, cut in every way that is usual; those with decimal points first."""
    with _damage_told(path.name):
        encoding = guess_encoding(path)
        lines = [line.rstrip("\r\n") for line in _first_lines(path, encoding, most)]
    told = {} if encoding == "utf-8" else {"encoding": encoding}
    if any("\0" in line for line in lines):
        raise DataError(f"{path.name}: is no text", "save the table as CSV")
    return [
        Top(_cut(lines, character), is_number, {**told, **delimiter, **decimal})
        for character, delimiter in _DIALECTS
        for is_number, decimal in _NUMBERS
        if (character, is_number) != (",", _with_comma)
    ]


def _first_lines(path: Path, encoding: str, most: int) -> list[str]:
    """Return the first lines; what is no UTF-8 is read as the encoding that it looks like."""
    if encoding == "utf-8":
        return list(islice(lines_of(path), most))
    try:
        with open_lines(path, encoding, path.name) as lines:
            return [part for line in lines.take(most) for part in line.splitlines(keepends=True)]
    except (EOFError, UnicodeError, OSError) as fault:
        raise DataError(f"{path.name}: cannot be read as {encoding} ({fault})", "save the table as CSV in UTF-8") from fault


def _cut(lines: Sequence[str], delimiter: str | None) -> list[list[str]]:
    """Lines cut at the delimiter, at any run of blanks where it is None; blank lines have no fields."""
    try:
        return [line.split() for line in lines] if delimiter is None else list(csv.reader(lines, delimiter=delimiter))
    except csv.Error:  # quotes that never close
        return []


def _with_point(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return _is_stamp(cell)
    return "_" not in cell  # Python reads 1_5 as 15


def _is_stamp(cell: str) -> bool:
    """Whether it is a date with a time, or a time of day, which is read as seconds."""
    try:
        seconds_of_stamp(cell.strip())
    except ValueError:
        return False
    return True


def _with_comma(cell: str) -> bool:
    return ("." not in cell and _with_point(cell.replace(",", "."))) or _is_stamp(cell.strip().replace(",", "."))


_DIALECTS: tuple[tuple[str | None, dict[str, Any]], ...] = (
    (",", {}),
    (";", {"delimiter": ";"}),
    ("\t", {"delimiter": "tab"}),
    ("|", {"delimiter": "|"}),
    (None, {"delimiter": "whitespace"}),
)
_NUMBERS: tuple[tuple[Callable[[Any], bool], dict[str, Any]], ...] = ((_with_point, {}), (_with_comma, {"decimal": ","}))
"""Dialects in the order of preference where several fit."""

READER = Reader(
    "csv",
    read_csv,
    suffixes=(".csv", ".txt", ".tsv", ".dat"),
    keys=("header", "skip_rows", "delimiter", "decimal", "encoding"),
    peek=peek_csv,
)
