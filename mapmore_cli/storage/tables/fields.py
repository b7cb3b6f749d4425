"""Convert lines of text with fields into columns of numbers. Ordinary lines are converted all at
once with PyArrow; other lines are converted one record after the other.
"""

from __future__ import annotations

import re
from codecs import BOM_UTF8
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import TableRequest
from mapmore_cli.storage.tables.rows import Wanted, values_of_rows

MARKS = {";": "a semicolon", "\t": "a tab"}

Numbered = tuple[int, list[str]]
"""The number of a record's last line in the file, and the fields of the record."""


@dataclass(frozen=True)
class TextLayout:
    """Layout of a text table, which follows from its header and from the request.

    - `request`: how the file is read.
    - `delimiter`: character between fields; None if one or more blanks or tabs separate them.
    - `width`: number of fields in a record.
    - `wanted`: the wanted columns, each with its reader. The reader remembers the form of time
      stamps from one block of lines to the next.
    """

    request: TableRequest
    delimiter: str | None
    width: int
    wanted: Sequence[Wanted]


def values_of_text(text: bytes, layout: TextLayout) -> list[Array]:
    """Read the wanted columns, (n,) each, of UTF-8 text with PyArrow. This is possible if every
    line is one record with all fields, and the wanted fields are plain numbers or empty. Otherwise,
    the result is an empty list, and `values_of_records` must be used.

    PyArrow takes a thirtieth of the time of `values_of_records`, and returns exactly the same
    doubles. But it reads blank lines as records and `nan(ind)` as a number. Therefore, PyArrow is
    not used for a text with one of the following: lines without a number, words that PyArrow reads
    as NaN, comments, or NUL characters (even if they are in unused columns).
    """
    request, mark = layout.request, (layout.delimiter or "\t").encode()
    if (
        b"\0" in text
        or request.decimal == layout.delimiter  # in quoted numbers
        or (request.comment is not None and request.comment.encode() in text)
        or any(read.reads_more_than_numbers for _, _, read in layout.wanted)
        or any(sign.encode() in text for sign in request.marks_of_thousands)
        or text.startswith(BOM_UTF8)  # PyArrow skips it
    ):
        return []
    if layout.delimiter is None:
        if b'"' in text:  # if blanks separate the fields, quotation marks have no special meaning
            return []
        text = re.sub(rb"(?<![^\r\n])\t|\t(?![^\r\n])", b"", re.sub(rb"[ \t]+", mark, text))
    if b'"' in text:
        cell = rb'(?<![^%b\r\n])"([^"%b\r\n]*)"(?![^%b\r\n])' % ((re.escape(mark),) * 3)
        text = re.sub(cell, rb"\1", text)
        if b'"' in text:
            return []
    columns = _parsed_columns(text, mark.decode(), layout)
    values = list(map(_numbers_in, columns))
    absent = [np.isnan(column) for column in values]
    empty = sum(column.null_count for column in columns)
    if np.count_nonzero(absent) != empty or (empty and np.logical_and.reduce(absent).any()):
        return []
    return values


def _numbers_in(column: Any) -> Array:
    """Return the numbers of a PyArrow column, NaN for a null. The method `to_numpy` of the column
    would import pandas, if it is installed, and this takes longer than reading a small file.
    """
    (chunk,) = column.chunks
    valid, data = chunk.buffers()
    values = np.frombuffer(data, count=len(chunk))
    if valid is None:
        return values
    bits = np.frombuffer(valid, np.uint8)
    return np.where(np.unpackbits(bits, count=len(chunk), bitorder="little"), values, np.nan)


def _parsed_columns(text: bytes, delimiter: str, layout: TextLayout) -> list[Any]:
    """Return the wanted columns as PyArrow parses them; an empty list if it refuses the text."""
    import pyarrow
    from pyarrow import csv as arrow

    wanted = [str(place) for _, place, _ in layout.wanted]
    try:
        table = arrow.read_csv(
            pyarrow.BufferReader(text),
            arrow.ReadOptions(
                use_threads=False,
                block_size=len(text) + 1,
                column_names=list(map(str, range(layout.width))),
            ),
            arrow.ParseOptions(delimiter=delimiter, quote_char=False, ignore_empty_lines=False),
            arrow.ConvertOptions(
                column_types=dict.fromkeys(wanted, pyarrow.float64()),
                include_columns=wanted,
                null_values=[""],
                decimal_point=layout.request.decimal,
            ),
        )
    except pyarrow.ArrowInvalid:
        return []
    return list(table.columns)


def values_of_records(records: Sequence[Numbered], layout: TextLayout) -> list[Any]:
    """Return the line numbers and the wanted columns of records, (n,) each. None of the records is
    blank. An empty field is NaN.

    Raises DataError with row and column for a record with too few or too many fields, and for a
    field that is not a number.
    """
    rows = ((row, _of_width(row, record, layout)) for row, record in records)
    label = layout.request.label
    numbers, columns = values_of_rows(rows, layout.wanted, label, line_hint)
    return [numbers, *columns]


def _of_width(row: int, record: list[str], layout: TextLayout) -> list[str]:
    """Return a record with exactly `layout.width` fields. Blank fields after the last column are
    removed. A record with too few fields, too many fields or NUL bytes is replaced by empty fields
    if incomplete records are treated as missing values; otherwise DataError is raised.
    """
    width, request = layout.width, layout.request
    has_nul = any("\0" in cell for cell in record)
    if len(record) >= width and not has_nul and not any(map(str.strip, record[width:])):
        return record[:width]
    if request.incomplete:
        # none of its fields is used, because the record may be a remark, or may have been cut off
        return [""] * width
    if has_nul:
        raise with_nul(request.label, row)
    few = "many" if record[width:] else "few"
    raise DataError(
        f"{request.label}:row {row}: too {few} fields: {len(record)}, but the first line "
        f"has {width}",
        line_hint(record)
        or (
            "Correct or remove the line; a last line that is too short means that the file was "
            "cut off. `missing: drop` leaves it out."
        ),
    )


def with_nul(label: str, row: int) -> DataError:
    """Return the error for a line with NUL bytes."""
    return DataError(
        f"{label}:row {row}: the line contains NUL bytes, so that its contents are lost",
        "Get the file again, or correct or remove the line. `missing: drop` leaves it out.",
    )


def line_hint(record: Sequence[str]) -> str | None:
    """Return a remedy for a line that looks like a comment, or whose fields seem to have another
    separator.
    """
    mark = re.match(r"#|%|//|!|\*|;(?!\s*[-+.\d])", record[0].strip() if record else "")
    if mark is None:
        return separator_hint(record)
    return (
        f'The line looks like a comment: write `comment: "{mark[0]}"`, which leaves out such lines.'
    )


def separator_hint(record: Sequence[str]) -> str | None:
    """Return a remedy if the fields seem to have another separator."""
    for mark, name in MARKS.items():
        if any(mark in cell for cell in record):
            word = "tab" if mark == "\t" else f'"{mark}"'
            return (
                f"The delimiter looks like {name}: write `delimiter: {word}`, and also "
                '`decimal: ","` if the numbers have commas.'
            )
    return None
