"""Delimited text, plain or gzipped, in the dialects that loggers write."""

from __future__ import annotations

import codecs
import csv
import gzip
import math
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain, islice
from pathlib import Path
from typing import TextIO

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.readers.numbers import number_of, shortened
from mapmore_cli.storage.readers.table import RawTable, SourceColumn, TableRequest, locate_columns

GZIP_MAGIC = b"\x1f\x8b"
CHUNK = 50_000  # records held as text at one time: numbers take an eighth of the memory
DELIMITERS = {"tab": "\t"}
WHITESPACE = "whitespace"
MARKS = ((";", "a semicolon"), ("\t", "a tab"))

Numbered = tuple[int, list[str]]
"""Line number in the file, and the fields of the record that ends there."""


def read_csv(path: Path, request: TableRequest) -> list[RawTable]:
    """Read the wanted columns of a text file.

    Gzip is recognised by content, not by name; lines end in LF, CR LF or CR. Blank lines are skipped (they count as header lines and
    as skipped rows); an empty field is NaN. Fields beyond the last column may only be blank.

    Raises
    ------
    DataError
        Empty, damaged or binary file; a missing column; a record with too few or too many fields; a field that is not a number.
    """
    label = request.label
    try:
        with _open_text(path, request.encoding) as text:
            return [_parse(_records(text, request), request)]
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise DataError(f"{label}: the file is damaged: {error}", "It may have been cut off while copying; get it again.") from error
    except UnicodeError as error:
        byte = f" (byte 0x{error.object[error.start]:02x})" if isinstance(error, UnicodeDecodeError) else f" ({error})"
        raise DataError(
            f"{label}: not a text file in {request.encoding.upper()}{byte}",
            "Say how it is encoded, as `encoding: latin-1` or `encoding: utf-16`, or save the table in UTF-8.",
        ) from error
    except csv.Error as error:
        raise DataError(f"{label}: not a readable CSV file: {error}", "Look for a quotation mark that is never closed.") from error
    except OSError as error:
        raise DataError(f"{label}: cannot be read: {error.strerror or error}") from error


def _open_text(path: Path, encoding: str) -> TextIO:
    with path.open("rb") as file:
        zipped = file.read(2) == GZIP_MAGIC
    # utf-8-sig swallows a byte order mark; newline="" leaves CR, LF and CRLF to the csv module
    encoding = "utf-8-sig" if codecs.lookup(encoding).name == "utf-8" else encoding
    return gzip.open(path, "rt", encoding=encoding, newline="") if zipped else path.open(encoding=encoding, newline="")


def _records(text: TextIO, request: TableRequest) -> Iterator[Numbered]:
    """Yield every line after the skipped ones as fields, blank ones as none."""
    lines = islice(text, request.skip_rows, None)
    if request.delimiter == WHITESPACE:
        yield from ((row, line.split()) for row, line in enumerate(lines, start=request.skip_rows + 1))
        return
    reader = csv.reader(lines, delimiter=DELIMITERS.get(request.delimiter, request.delimiter))
    for record in reader:
        yield request.skip_rows + reader.line_num, record if len(record) > 1 or (record and record[0].strip()) else []


def _parse(records: Iterator[Numbered], request: TableRequest) -> RawTable:
    label = request.label
    first = next(_filled(records), None)
    if first is None:
        raise DataError(f"{label}: the file is empty")
    width = len(first[1])
    names = [name.strip() for name in first[1]] if request.header else None
    places = locate_columns(request, names, width, _separator_hint(first[1]) or _header_hint(first[1], request))
    titles = {column: column if names is None else names[place] for column, place in places.items()}
    blocks: dict[SourceColumn, list[Array]] = {column: [] for column in places}
    rows: list[Array] = []
    data = _filled(islice(records, request.header - 1, None) if request.header else chain([first], records))
    while chunk := list(islice(data, CHUNK)):
        chunk = [_of_width(row, record, width, request) for row, record in chunk]
        rows.append(np.array([row for row, _ in chunk], dtype=np.int64))
        for column, place in places.items():
            blocks[column].append(_numbers(chunk, place, titles[column], request))
    if not rows:
        raise DataError(f"{label}: the file has a header but no data")
    return RawTable({column: np.concatenate(parts) for column, parts in blocks.items()}, np.concatenate(rows), label)


def _filled(records: Iterable[Numbered]) -> Iterator[Numbered]:
    return (numbered for numbered in records if numbered[1])


def _of_width(row: int, record: list[str], width: int, request: TableRequest) -> Numbered:
    """Return the record with `width` fields: blank ones at its end do not count, and those that a short one lacks may be missing."""
    if len(record) == width:
        return row, record
    if len(record) > width and not any(map(str.strip, record[width:])):
        return row, record[:width]
    if len(record) < width and request.incomplete:
        return row, [""] * width  # a closing remark, or half a record: none of its fields can be trusted
    few = "few" if len(record) < width else "many"
    remedy = "Mend or remove the line; a last line that is too short means that the file was cut off."
    raise DataError(
        f"{request.label}:row {row}: too {few} fields: {len(record)}, where the first line has {width}",
        _separator_hint(record) or (f"{remedy} `missing: drop` leaves it out." if few == "few" else remedy),
    )


def _numbers(chunk: Sequence[Numbered], place: int, title: SourceColumn, request: TableRequest) -> Array:
    values = np.empty(len(chunk))
    parse: Callable[[str], float] = number_of if request.decimal == "." else _with_decimal_comma
    for i, (row, record) in enumerate(chunk):
        try:
            values[i] = parse(record[place])
        except ValueError:
            raise DataError(
                f"{request.label}:row {row}, column {title}: '{shortened(record[place].strip())}' is not a number",
                _separator_hint(record)
                or _decimal_hint(record[place])
                or "Mend the cell; an empty one is a missing value, see `missing`. Names belong in a header line.",
            ) from None
    return values


def _with_decimal_comma(cell: str) -> float:
    """Read `1,5`; a point is refused, as nobody can tell the thousands of 1.500 from a decimal point."""
    if "." in cell:
        raise ValueError
    return number_of(cell.replace(",", ".")) if cell.strip() else math.nan


def _separator_hint(record: Sequence[str]) -> str | None:
    """Return a remedy where the fields look as if something else separated them."""
    for mark, name in MARKS:
        if any(mark in cell for cell in record):
            word = next((word for word, character in DELIMITERS.items() if character == mark), f'"{mark}"')
            return f'The delimiter looks like {name}: say `delimiter: {word}`, and `decimal: ","` where the numbers have commas.'
    return None


def _decimal_hint(cell: str) -> str | None:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return None
    return 'Say `decimal: ","`.' if "," in cell else 'Say `decimal: "."`.' if "." in cell else None


def _header_hint(first: Sequence[str], request: TableRequest) -> str | None:
    """Return a remedy where a header is expected but the first line holds numbers."""
    try:
        looks_like_data = request.header and not math.isnan(sum(map(float, first)))
    except ValueError:
        return None
    return "The first line holds numbers: give 0-based indices and say `header: false`." if looks_like_data else None
