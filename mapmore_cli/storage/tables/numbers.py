"""Numbers and time stamps as people and programs write them into cells."""

from __future__ import annotations

import math
from collections.abc import Sequence, Set
from datetime import UTC, datetime, timedelta

from mapmore_cli.domain.errors import DataError

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

    Raises
    ------
    ValueError
        Anything else.
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

    Raises
    ------
    ValueError
        Text that is no such stamp.
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

    A whole number among whole ones is shorter than all, and less than half of the smallest: 98 may follow 101, 25 hardly follows 254.
    """
    values = {cell: value for cell in before if math.isfinite(value := _or_nan(cell.replace(decimal, ".")))}
    if sum(cell in values for cell in before) < FEWEST_BEFORE:
        return False
    digits = min(len(cell.partition(decimal)[2]) for cell in values)
    if digits:
        return len(last.partition(decimal)[2]) < digits
    return decimal not in last and len(last) < min(map(len, values)) and abs(_or_nan(last)) < min(map(abs, values.values())) / 2


def _or_nan(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan
