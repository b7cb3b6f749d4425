"""Comma-separated text, plain or gzipped, with or without a header line."""

from __future__ import annotations

import csv
import gzip
import math
import zlib
from collections.abc import Iterator, Sequence
from itertools import chain, islice
from pathlib import Path
from typing import TextIO

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.readers.table import RawTable, SourceColumn, TableRequest, locate_columns

GZIP_MAGIC = b"\x1f\x8b"
CHUNK = 50_000  # records held as text at one time: numbers take an eighth of the memory

Numbered = tuple[int, list[str]]
"""Line number in the file, and the fields of the record that ends there."""


def read_csv(path: Path, request: TableRequest) -> RawTable:
    """Read the wanted columns of a CSV file.

    Gzip is recognised by content, not by name. Blank lines are skipped; an empty field is NaN.

    Raises
    ------
    DataError
        Empty, damaged or binary file; a missing column; a record with too few or too many fields; a field that is not a number.
    """
    label = request.label
    try:
        with _open_text(path) as text:
            return _parse(_records(text), request)
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise DataError(f"{label}: the file is damaged: {error}", "It may have been cut off while copying; get it again.") from error
    except UnicodeDecodeError as error:
        raise DataError(
            f"{label}: not a text file in UTF-8 (byte 0x{error.object[error.start]:02x})", "Save the table as CSV in UTF-8."
        ) from error
    except csv.Error as error:
        raise DataError(f"{label}: not a readable CSV file: {error}", "Look for a quotation mark that is never closed.") from error
    except OSError as error:
        raise DataError(f"{label}: cannot be read: {error.strerror or error}") from error


def _open_text(path: Path) -> TextIO:
    with path.open("rb") as file:
        zipped = file.read(2) == GZIP_MAGIC
    # utf-8-sig swallows a byte order mark; newline="" leaves CR, LF and CRLF to the csv module
    return gzip.open(path, "rt", encoding="utf-8-sig", newline="") if zipped else path.open(encoding="utf-8-sig", newline="")


def _records(text: TextIO) -> Iterator[Numbered]:
    reader = csv.reader(text)
    for record in reader:
        if len(record) > 1 or (record and record[0].strip()):
            yield reader.line_num, record


def _parse(records: Iterator[Numbered], request: TableRequest) -> RawTable:
    label = request.label
    first = next(records, None)
    if first is None:
        raise DataError(f"{label}: the file is empty")
    width = len(first[1])
    names = [name.strip() for name in first[1]] if request.header else None
    places = locate_columns(request, names, width, _separator_hint(first[1]) or _header_hint(first[1], request))
    titles = {column: column if names is None else names[place] for column, place in places.items()}
    blocks: dict[SourceColumn, list[Array]] = {column: [] for column in places}
    rows: list[int] = []
    data = records if request.header else chain([first], records)
    while chunk := list(islice(data, CHUNK)):
        _check_widths(chunk, width, label)
        rows.extend(row for row, _ in chunk)
        for column, place in places.items():
            blocks[column].append(_numbers(chunk, place, titles[column], label))
    if not rows:
        raise DataError(f"{label}: the file has a header but no data")
    return RawTable({column: np.concatenate(parts) for column, parts in blocks.items()}, np.array(rows, dtype=np.int64))


def _check_widths(chunk: Sequence[Numbered], width: int, label: str) -> None:
    for row, record in chunk:
        if len(record) != width:
            few = "few" if len(record) < width else "many"
            raise DataError(
                f"{label}:row {row}: too {few} fields: {len(record)}, where the first line has {width}",
                _separator_hint(record) or "Mend or remove the line; a last line that is too short means that the file was cut off.",
            )


def _numbers(chunk: Sequence[Numbered], place: int, title: SourceColumn, label: str) -> Array:
    values = np.empty(len(chunk))
    for i, (row, record) in enumerate(chunk):
        try:
            values[i] = _number(record[place])
        except ValueError:
            cell = record[place].strip()
            raise DataError(
                f"{label}:row {row}, column {title}: '{_shortened(cell)}' is not a number",
                _separator_hint(record) or "Mend the cell; an empty one is a missing value, see `missing`. Names belong in a header line.",
            ) from None
    return values


def _number(cell: str) -> float:
    if "_" in cell:  # Python reads 1_5 as 15
        raise ValueError
    return float(cell) if cell and not cell.isspace() else math.nan


def _separator_hint(record: Sequence[str]) -> str | None:
    """Return a remedy where the fields look as if something other than a comma separated them."""
    for mark, name in ((";", "a semicolon"), ("\t", "a tab")):
        if any(mark in cell for cell in record):
            return f"The delimiter looks like {name}: save the table with commas between the fields and points in the numbers."
    return None


def _header_hint(first: Sequence[str], request: TableRequest) -> str | None:
    """Return a remedy where a header is expected but the first line holds numbers."""
    try:
        looks_like_data = request.header and not math.isnan(sum(map(float, first)))
    except ValueError:
        return None
    return "The first line holds numbers: give 0-based indices and say `header: false`." if looks_like_data else None


def _shortened(cell: str, limit: int = 40) -> str:
    shown = cell.encode("unicode_escape").decode("ascii") if not cell.isprintable() else cell
    return shown if len(shown) <= limit else shown[: limit - 3] + "..."
