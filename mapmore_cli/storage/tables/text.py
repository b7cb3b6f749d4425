"""Numbers and time stamps as people and programs write them into cells."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from itertools import repeat
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables.table import SourceColumn, TableRequest

MISSING = frozenset({"na", "n/a", "#n/a", "null", "none"})
"""What programs write, besides an empty cell and `nan`, where there is no value; lower case."""


LONGEST_STAMP = 40
FEWEST_BEFORE = 10  # numbers that tell how long those of a column are
_STAMPS = ("%d.%m.%Y %H:%M:%S", "%d.%m.%Y %H:%M:%S.%f", "%Y/%m/%d %H:%M:%S", "%Y/%m/%d %H:%M:%S.%f")
_CLOCKS = ("%H:%M:%S", "%H:%M:%S.%f")


class NotANumber(DataError):
    """A cell that holds neither a number nor what stands for a missing one; `cell` is its text."""

    def __init__(self, cell: str, where: str, remedy: str) -> None:
        super().__init__(f"{where}: '{shortened(cell)}' is not a number", remedy)
        self.cell = cell


def number_of(cell: str, missing: Set[str] = frozenset()) -> float:
    """Return the number in a cell, or the seconds of its time stamp; NaN where the value is missing, as `missing` texts say.

    Raises ValueError for anything else.
    """
    if "_" in cell and cell.strip() not in missing:  # Python reads 1_5 as 15
        raise ValueError(cell)
    try:
        return float(cell)
    except ValueError:
        word = cell.strip()
        if not word or word.lower() in MISSING or word in missing:
            return math.nan
        return seconds_of_stamp(word)


def seconds_of_stamp(text: str) -> float:
    """Return a date with time in seconds since 1970, and a time of day in seconds since midnight.

    Dates are as in ISO 8601, `2026/03/01 12:00:00` or `01.03.2026 12:00:00`. A stamp without a time zone counts as if it were UTC, since
    only differences matter. Months and days between slashes (`3/1/2026`) are refused: they read one way here and another way there.

    Raises ValueError for text that is no such stamp.
    """
    if len(text) > LONGEST_STAMP or ":" not in text:
        raise ValueError(text)
    for form in _CLOCKS:
        try:
            clock = datetime.strptime(text, form).replace(tzinfo=UTC)
        except ValueError:
            continue
        return (clock - datetime.strptime("0", "%H").replace(tzinfo=UTC)) / timedelta(seconds=1)
    try:
        stamp = datetime.fromisoformat(text)
    except ValueError:
        stamp = _dated(text)
    return (stamp if stamp.tzinfo is not None else stamp.replace(tzinfo=UTC)).timestamp()


def _dated(text: str) -> datetime:
    for form in _STAMPS:
        try:
            return datetime.strptime(text, form)
        except ValueError:
            continue
    raise ValueError(text)


def shortened(cell: str, limit: int = 40) -> str:
    """Return a cell's text as a message may show it."""
    shown = cell.encode("unicode_escape").decode("ascii") if not cell.isprintable() else cell
    return shown if len(shown) <= limit else shown[: limit - 3] + "..."


def cut_short(last: str, before: Sequence[str], decimal: str) -> bool:
    """Whether a number looks cut off beside ten or more numbers `before` it: it has fewer digits behind the mark than all of them.

    It has to have three fewer, or none, where theirs vary: of 51 numbers as `repr` writes them, the last one may be the shortest.
    A whole number among whole ones is shorter than all, and less than half of the smallest: 98 may follow 101, 25 hardly follows 254.
    """
    values = {cell: value for cell in before if math.isfinite(value := _or_nan(cell.replace(decimal, ".")))}
    if sum(cell in values for cell in before) < FEWEST_BEFORE:
        return False
    digits = {len(cell.partition(decimal)[2]) for cell in values}
    if min(digits):
        return len(last.partition(decimal)[2]) < max(1, min(digits) - 2 * (len(digits) > 1))
    return decimal not in last and len(last) < min(map(len, values)) and abs(_or_nan(last)) < min(map(abs, values.values())) / 2


def _or_nan(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


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
    """Return the wanted columns, (n, columns), where every line is one record of full width with only plain numbers in them; else None.

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
    """Return the wanted columns of records without blank ones, (n, columns); an empty field is NaN.

    Raises DataError for a record with too few or too many fields; a field that is not a number; with row and column.
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
