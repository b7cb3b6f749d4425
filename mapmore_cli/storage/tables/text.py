"""Cells of delimited text as numbers: many lines at once where all of them are in order, record by record where one may not be."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass
from itertools import repeat
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables.numbers import NotANumber, number_of, seconds_of_stamp
from mapmore_cli.storage.tables.table import SourceColumn, TableRequest

DELIMITERS = {"tab": "\t"}
WHITESPACE = "whitespace"
MARKS = ((";", "a semicolon"), ("\t", "a tab"))

Numbered = tuple[int, list[str]]
"""Line number in the file, and the fields of the record that ends there."""


@dataclass(frozen=True)
class Layout:
    """What is known after the header: the number of fields in a record, and of the wanted columns their places and titles."""

    width: int
    places: tuple[int, ...]
    titles: tuple[SourceColumn, ...]


def values_of_lines(lines: Sequence[str], layout: Layout, request: TableRequest) -> Array | None:
    """The wanted columns, (n, columns), where every line is one record of full width with nothing but plain numbers in them; else None.

    NumPy's parser takes a twentieth of the time of `values_of_records`, and every number that it accepts is the same number there.
    """
    delimiter = DELIMITERS.get(request.delimiter, request.delimiter)
    if request.decimal != ".":
        if any("." in line for line in lines):
            return None
        lines = [line.replace(request.decimal, ".") for line in lines]
    if delimiter == WHITESPACE:
        values = _loaded(lines)
        return values[:, layout.places] if values is not None and values.shape[1] == layout.width else None
    if set(map(str.count, lines, repeat(delimiter))) != {layout.width - 1}:
        return None
    after = delimiter.join("0" * layout.width)  # a record of its own, unless a quotation mark is left open before it
    values = _loaded([*lines, after], delimiter=delimiter, usecols=layout.places, quotechar='"')
    return None if values is None else values[:-1]


def _loaded(lines: Sequence[str], **dialect: Any) -> Array | None:
    """One row for every line; None where NumPy finds something else."""
    try:
        with warnings.catch_warnings(action="ignore"):  # of lines that hold nothing
            values = np.loadtxt(lines, comments=None, ndmin=2, **dialect)
    except (ValueError, TypeError):
        return None
    return values if len(values) == len(lines) else None


def values_of_records(records: Sequence[Numbered], layout: Layout, request: TableRequest) -> Array:
    """The wanted columns of records without blank ones, (n, columns); an empty field is NaN.

    Raises
    ------
    DataError
        A record with too few or too many fields; a field that is not a number; with row and column.
    """
    whole = [_of_width(row, record, layout.width, request) for row, record in records]
    values = np.empty((len(whole), len(layout.places)))
    for j, (place, title) in enumerate(zip(layout.places, layout.titles, strict=True)):
        values[:, j] = _numbers(whole, place, title, request)
    return values


def _of_width(row: int, record: list[str], width: int, request: TableRequest) -> Numbered:
    """Return the record with `width` fields: blank ones at its end do not count, and those that a short one lacks may be missing."""
    if len(record) == width:
        return row, record
    if len(record) > width and not any(map(str.strip, record[width:])):
        return row, record[:width]
    if request.incomplete:
        return row, [""] * width  # a closing remark, half a record, or two run into one: none of its fields can be trusted
    few = "few" if len(record) < width else "many"
    remedy = "Mend or remove the line; a last line that is too short means that the file was cut off."
    raise DataError(
        f"{request.label}:row {row}: too {few} fields: {len(record)}, where the first line has {width}",
        separator_hint(record) or f"{remedy} `missing: drop` leaves it out.",
    )


def _numbers(chunk: Sequence[Numbered], place: int, title: SourceColumn, request: TableRequest) -> Array:
    values = np.empty(len(chunk))
    parse: Callable[[str, Set[str]], float] = number_of if request.decimal == "." else _with_decimal_comma
    for i, (row, record) in enumerate(chunk):
        try:
            values[i] = parse(record[place], request.missing)
        except ValueError:
            raise NotANumber(
                record[place].strip(),
                f"{request.label}:row {row}, column {title}",
                separator_hint(record)
                or _decimal_hint(record[place])
                or "mend the cell, or list it in `missing: {tokens: [...]}`; column names belong in the header",
            ) from None
    return values


def _with_decimal_comma(cell: str, missing: Set[str]) -> float:
    """Read `1,5`; a point is refused, as nobody can tell the thousands of 1.500 from a decimal point, but in the date of a stamp."""
    word = cell.strip()
    if not word or word in missing:
        return math.nan
    if "." in word:
        return seconds_of_stamp(word.replace(",", "."))
    return number_of(word.replace(",", "."))


def separator_hint(record: Sequence[str]) -> str | None:
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
