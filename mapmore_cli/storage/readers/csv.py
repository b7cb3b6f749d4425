"""Read delimited text, plain or compressed, in the dialects that loggers write."""

from __future__ import annotations

import csv
import re
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from io import BufferedReader
from itertools import chain, islice, product
from pathlib import Path
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import stacked
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import (
    GET_SAMPLES,
    OpenEnd,
    RawTable,
    Reader,
    TableRequest,
    Top,
    locate_columns,
    reading,
)
from mapmore_cli.storage.tables.below import Below, chosen_table, tables_below
from mapmore_cli.storage.tables.cells import NUMBER, holds_number
from mapmore_cli.storage.tables.fields import (
    Numbered,
    TextLayout,
    separator_hint,
    values_of_records,
    values_of_text,
    with_nul,
)
from mapmore_cli.storage.tables.lines import (
    UNREADABLE,
    Lines,
    csv_records,
    guess_encoding,
    open_lines,
)
from mapmore_cli.storage.tables.rows import Row, wanted_of
from mapmore_cli.storage.tables.thousands import may_be_grouped, refuse_grouped

WHITESPACE = "whitespace"
DELIMITERS = {"tab": "\t"}
# number of rows in which tables that stand side by side are searched
FIRST_ROWS = 200

_WORDS = re.compile(r"[\s\"'\ufeff]*([^\W\d_]|[#\[({])")
"""Pattern of the beginning of a line of words."""
_GROUPED = re.compile(r"(?<=\d)(?:[ '’](?=\d{3}(?!\d))|[.,](?=\d{3}[.,]\d))")
_QUOTED_COMMA = re.compile(r'"[+-]?\d+,\d+"')


def read_csv(path: Path, request: TableRequest) -> list[RawTable]:
    """Read the wanted columns of a text file.

    Compression (gzip, bzip2, xz) is recognised by content, not by name. Lines end with LF, CR LF or
    CR. Blank lines are skipped, but the numbers `header` and `skip_rows` include them. An empty
    field is NaN. Fields after the last column must be blank.

    Raises
    ------
    DataError
        Empty, damaged or binary file; a missing column; a record with too few or too many fields; a
        field that is not a number.
    """
    with reading(request.label, "text file", UNREADABLE):
        try:
            with open_lines(path, request.encoding, request.label) as (lines, raw):
                table = _parse(lines, raw, request)
                table = replace(table, padding=lines.padding, open_end=_open_end(lines, request))
            _refuse_thousands(path, table, request)
            return [table]
        except UnicodeError as error:
            byte = (
                f" (byte 0x{error.object[error.start]:02x})"
                if isinstance(error, UnicodeDecodeError)
                else f" ({error})"
            )
            raise DataError(
                f"{request.label}: not a text file in {request.encoding.upper()}{byte}",
                (
                    f"write `encoding: {guess_encoding(path)}`, which fits its bytes, or save the "
                    "table in UTF-8"
                ),
            ) from error


def _parse(lines: Lines, raw: BufferedReader, request: TableRequest) -> RawTable:
    if request.table is not None:
        layout, rows_of_table = _rows_of(lines, request)
        filled = [(number, [*cells]) for number, cells in rows_of_table]
        every_row, *values_of_table = values_of_records(filled, layout)
        columns_of_table = dict(zip(request.columns, values_of_table, strict=True))
        return RawTable(columns_of_table, every_row, request.label)
    layout, leading, _ = _begin(lines, request)
    before = [values_of_records(leading, layout)] if leading else []
    numbers: list[Any] = []

    def values() -> Iterator[list[Any]]:
        for rows, *block in chain(before, _blocks_of(lines, layout, raw)):
            numbers.append(rows)
            yield block

    columns = stacked(values())
    if not numbers:
        raise DataError(f"{request.label}: the file has a header but no data", GET_SAMPLES)
    every = range(numbers[0][0], numbers[-1][-1] + 1)
    rows = every if len(every) == len(columns[0]) else np.concatenate(numbers)
    return RawTable(dict(zip(request.columns, columns, strict=True)), rows, request.label)


def _records_of(lines: Lines, request: TableRequest) -> tuple[Iterator[Numbered], str | None]:
    """Return the records after the first `skip_rows` lines, and the delimiter between their fields.
    The delimiter is None if one or more blanks or tabs separate the fields.
    """
    deque(islice(lines, request.skip_rows), maxlen=0)
    delimiter = _delimiter_of(request)
    return _records(lines, delimiter, request), delimiter


def _delimiter_of(request: TableRequest) -> str | None:
    """Return the character between fields; None if blanks or tabs separate the fields."""
    delimiter = DELIMITERS.get(request.delimiter, request.delimiter)
    return None if delimiter == WHITESPACE else delimiter


def _begin(
    lines: Lines, request: TableRequest
) -> tuple[TextLayout, list[Numbered], Iterator[Numbered]]:
    """Read the header of a table. Return three things: the layout of the table, the records that
    were already read but belong to the data, and an iterator over the records that follow. With a
    header, the second is empty. Without a header, it contains the first record.
    """
    records, split_at = _records_of(lines, request)
    first = next((record for record in records if record[1]), None)
    if first is None:
        raise DataError(f"{request.label}: the file is empty", GET_SAMPLES)
    layout = _layout(first[1], request, split_at)
    deque(islice(records, max(request.header - 1, 0)), maxlen=0)
    return layout, [] if request.header else [first], records


def _refuse_thousands(path: Path, table: RawTable, request: TableRequest) -> None:
    """Raise NotANumber if the points in the numbers of a table separate thousands, although the
    spec takes them for decimal points. The file is read again for this test, but only if the
    numbers in a column leave this possibility open.
    """
    for number, (column, values) in enumerate(table.columns.items()):
        if request.cells(column).thousands is None and may_be_grouped(values):
            with open_lines(path, request.encoding, request.label) as (lines, _):
                layout, rows_of_table = _rows_of(lines, request)
                title, place, _ = layout.wanted[number]
                rows = (row for row in rows_of_table if place < len(row[1]))
                cells = ((row, fields[place]) for row, fields in rows)
                where = f"{request.label}:row {{row}}, column {title}"
                refuse_grouped(cells, request.decimal, where)


def _rows_of(lines: Lines, request: TableRequest) -> tuple[TextLayout, Iterable[Row]]:
    """Return the layout of the wanted table, and its rows below the header."""
    if request.table is None:
        layout, leading, records = _begin(lines, request)
        return layout, chain(leading, records)
    records, delimiter = _records_of(lines, request)
    table = chosen_table((record for record in records if record[1]), request, _numbers_of(request))
    return _layout([*(table.header or table.rows)[0][1]], request, delimiter), table.rows


def _numbers_of(request: TableRequest) -> Callable[[object], bool]:
    """Return the function that says whether a cell holds a number."""
    return partial(holds_number, decimal=request.decimal, thousands=request.thousands)


def below_csv(path: Path, request: TableRequest) -> list[Below]:
    """Return the tables that stand below each other or side by side in a text.

    If the text contains a sign of a further table, it is read completely. Such a sign is a line of
    words after the first numbers, or, if tables have no header lines, a blank line. Any other text
    can only have tables side by side, so that its first rows are sufficient.
    """
    with reading(request.label, "text file", UNREADABLE):
        with open_lines(path, request.encoding, request.label, errors="replace") as (lines, _):
            begun = broken = False
            for line in lines:
                is_words = _WORDS.match(line) is not None
                broken = broken or (begun and (is_words if request.header else not line.strip()))
                begun = begun or not is_words
        with open_lines(path, request.encoding, request.label, errors="replace") as (lines, _):
            records, _ = _records_of(lines, request)
            filled = (record for record in records if record[1])
            some = filled if broken else islice(filled, FIRST_ROWS)
            return tables_below(some, request.header, _numbers_of(request))


def _records(lines: Lines, delimiter: str | None, request: TableRequest) -> Iterator[Numbered]:
    """Yield the records in `lines`, each with the number of its last line. A blank line and a
    comment are records without fields.
    """
    kept = _without_comments(lines, request.comment)
    if delimiter is None:
        yield from ((lines.rows, line.split()) for line in kept)
        return
    for _, record, number in csv_records(kept, delimiter, request.label, lines.rows):
        yield number, record if len(record) > 1 or (record and record[0].strip()) else []


def _without_comments(lines: Iterable[str], mark: str | None) -> Iterable[str]:
    """Replace each line that is a comment by a blank line, so that line numbers do not change. A
    byte-order mark at the beginning of a line is removed: it is there if texts were joined.
    """
    lines = (line.removeprefix("\ufeff") for line in lines)
    if mark is None:
        return lines
    return ("\n" if line.lstrip().startswith(mark) else line for line in lines)


def _layout(first: Sequence[str], request: TableRequest, delimiter: str | None) -> TextLayout:
    names = [name.strip() for name in first] if request.header else None
    hint = separator_hint(first)
    if hint is None and names is not None and all(map(holds_number, names)):
        hint = "The first line contains numbers: give 0-based indices and write `header: false`."
    places = locate_columns(request, names, len(first), hint)
    return TextLayout(request, delimiter, len(first), wanted_of(places, names, request))


def _blocks_of(lines: Lines, layout: TextLayout, raw: BufferedReader) -> Iterator[list[Any]]:
    """Yield the line numbers and values of the remaining lines, (n,) each, block by block."""
    while block := lines.block():
        # blank lines are skipped all at once, because a text may have millions of them
        if not block.strip(b"\r\n "):
            lines.take(block, len(block.splitlines()))
            continue
        values = values_of_text(block, layout)
        if values:
            for (_, _, read), column in zip(layout.wanted, values, strict=True):
                if read.clock and np.isfinite(column).any():
                    read.form = NUMBER
            row, n = lines.rows + 1, len(values[0])
            lines.take(block, n)
            yield [range(row, row + n), *values]
        else:
            end, filled = lines.taken + len(block), list[Numbered]()
            for row, cells in _records(lines, layout.delimiter, layout.request):
                filled += [(row, cells)] if cells else []
                if lines.taken >= end:
                    break
            if filled:
                yield values_of_records(filled, layout)
        layout.request.progress(raw.tell())


def _open_end(lines: Lines, request: TableRequest) -> OpenEnd | None:
    """Return the cells of the last lines of a text if its last line has no line break at the end,
    so that this line may be incomplete; None otherwise.
    """
    if not lines.is_open:
        return None
    last = _without_comments(lines.last_lines(), request.comment)
    return OpenEnd(lines.rows, _cut_lines([*last], _delimiter_of(request)), request.decimal)


def peek_csv(path: Path, most: int) -> Iterable[Top]:
    """Return the first lines of a text file, split into fields in several ways: once for each usual
    pair of delimiter and decimal mark. For each delimiter, the decimal point comes before the
    decimal comma. A comma is both only if there are quoted numbers with commas. The same pairs
    follow with each mark that seems to separate thousands.
    """
    with reading(path.name, "text file", UNREADABLE):
        encoding = guess_encoding(path)
        with open_lines(path, encoding, path.name, errors="replace") as (text, _):
            lines = [line.rstrip("\r\n") for line in islice(text, most)]
    for row, line in enumerate(lines, start=1):
        if "\0" in line:
            raise with_nul(path.name, row)
    tops = []
    is_quoted = any(_QUOTED_COMMA.search(line) for line in lines)
    marks = sorted({mark for line in lines for mark in _GROUPED.findall(line)})
    for thousands, delimiter, decimal in product(
        (None, *marks), (",", ";", "\t", "|", None), (".", ",")
    ):
        settings = {} if encoding == "utf-8" else {"encoding": encoding}
        if delimiter != ",":
            words = {"\t": "tab", None: WHITESPACE}
            settings["delimiter"] = words.get(delimiter) or str(delimiter)
        if decimal != ".":
            settings["decimal"] = decimal
        if thousands is not None:
            settings["thousands"] = thousands
        others = (decimal, delimiter or " ")
        if (delimiter != decimal or is_quoted) and thousands not in others:
            reads = partial(holds_number, decimal=decimal, thousands=thousands)
            tops.append(Top(_cut_lines(lines, delimiter), reads, settings))
    return tops


def _cut_lines(lines: Sequence[str], delimiter: str | None) -> list[list[str]]:
    """Return the fields of each line. The lines are split at the delimiter; if it is None, at
    blanks and tabs. Blank lines have no fields. The result is empty if the lines cannot be split,
    for example because a quotation mark is never closed, and the field that it begins is too long.
    """
    try:
        return (
            [line.split() for line in lines]
            if delimiter is None
            else list(csv.reader(lines, delimiter=delimiter))
        )
    except csv.Error:
        return []


READER = Reader(
    "csv",
    read_csv,
    suffixes=(".csv", ".txt", ".tsv", ".dat", ".log", ".asc", ".prn", ".tab"),
    keys=(
        "header",
        "skip_rows",
        "table",
        "delimiter",
        "decimal",
        "thousands",
        "comment",
        "encoding",
    ),
    peek=peek_csv,
    below=below_csv,
)
