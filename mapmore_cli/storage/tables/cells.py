"""The one rule of what a cell says, whatever file it comes from.

It is a number in ASCII digits, or there is no value, or, in the column of the time, it is a stamp.
Anything else is refused, with what stands there and what to do about it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Set
from dataclasses import dataclass
from datetime import UTC, date, datetime, time, timedelta
from decimal import Decimal
from numbers import Real
from typing import Any

from mapmore_cli.domain.errors import DataError

MISSING = frozenset({"na", "n/a", "#n/a", "null", "none"})
"""What programs write, besides an empty cell and `nan`, where there is no value; lower case."""

THOUSANDS = (",", ".", "'", "\u2019", " ", "\u00a0", "\u202f")
"""What stands between thousands."""

LONGEST_STAMP = 40
NUMBER, MINUTES, CLOCK = "a number", "a time as `mm:ss.s`", "a time as `hh:mm:ss`"
FORMAT = '`time: {column: t, format: "%m/%d/%Y %I:%M:%S.%f %p"}`'
AS_NUMBERS = "format the cells as numbers in the program that wrote them"
DATES = f"stamps count in the column `time` alone, whose unit is s; {AS_NUMBERS}, or mend the cell"
_NUMBERS = (float, int, Real, Decimal)
_CLOCK = re.compile(
    r"(?:(\d+) days?,? +)?(\d+(?::\d{1,2}){1,2})(?:[.,](\d+)|:(\d{3}))?(?: *([AP])\.?M\.?)?",
    re.ASCII | re.IGNORECASE,
)
_DATED = re.compile(
    r"(?:(\d{4})([-/])(\d{1,2})\2(\d{1,2})|(\d{1,2})\.(\d{1,2})\.(\d{4}))[T ] *"
    r"(\d[\d:.,]*(?: *[AP]\.?M\.?)?)(?: ?(?:(Z)|([+-]\d\d):?(\d\d)?))?",
    re.ASCII | re.IGNORECASE,
)
_LIKE_A_DATE = re.compile(r"\d{1,4}([-/.])\d{1,2}\1\d{1,4}\b.*|.*\d:\d.*|.*\d *[ap]\.?m\.?", re.I)
_WITH_UNIT = re.compile(r"[+-]?(?!0x)\d[\d.,]*(?:e[+-]?\d+)? *[^\W\d_%]*[^\w\s.,+-]?[^\W\d_]*", re.I)
_EPOCH, _FIRST = datetime(1970, 1, 1, tzinfo=UTC), datetime(1900, 1, 1, tzinfo=UTC)


class OddCell(ValueError):
    """What is wrong with a cell, and the remedy; `known` where it is no word for a missing value, as a stamp is none."""

    def __init__(self, cell: Any, said: str, remedy: str, known: bool = True, is_stamp: bool = False) -> None:
        self.cell, self.remedy, self.known, self.is_stamp = str(cell).strip(), remedy, known, is_stamp
        super().__init__(f"'{shortened(self.cell)}' {said}")


class NotANumber(DataError):
    """An odd cell at its place; `column` is that of the request."""

    def __init__(self, odd: OddCell, where: str, column: Any = None, hint: str | None = None) -> None:
        super().__init__(f"{where}: {odd}", hint or odd.remedy)
        self.odd, self.column = odd, column


def number_of(cell: Any, decimal: str = ".", thousands: str | None = None) -> float | None:
    """Return the number in a cell, NaN where it is empty; None for anything else.

    Infinity is read, as `nan` is: the spec says what becomes of values that are none.
    """
    if isinstance(cell, str):
        text = cell.strip()
        if thousands is not None and thousands in text:
            whole, group, point = r"[+-]?\d{1,3}", re.escape(thousands), re.escape(decimal)
            if not re.fullmatch(rf"{whole}(?:{group}\d{{3}})+(?:{point}\d*)?(?:[eE][+-]?\d+)?", text):
                return None
            text = text.replace(thousands, "")
        if decimal != ".":
            if "." in text:
                return None
            text = text.replace(decimal, ".")
        if "_" in text or not text.isascii():  # Python reads 1_5 as 15, and the digits of every script
            return None
        try:
            return float(text) if text else math.nan
        except ValueError:
            return None
    if cell is None:
        return math.nan
    if isinstance(cell, _NUMBERS) and not isinstance(cell, bool):
        try:
            return float(cell)
        except (OverflowError, ValueError):
            return None
    return math.nan if isinstance(cell, datetime) and cell != cell else None  # pandas' NaT


@dataclass
class CellReader:
    """Reads the cells of one column, one by one.

    - `missing`: texts that stand where there is no value.
    - `decimal`, `thousands`: what stands between the digits of a number.
    - `clock`: whether the column is that of the time; `format`: how `strptime` reads its stamps.
    - `marks`: what the spec can name as `decimal` and `thousands` of this file; else nothing.
    - `usual`: the remedy where nothing better is known.
    - `column`: what the request calls the column.
    - `form`: of the stamps that were read so far; all have one.
    """

    missing: Set[str] = frozenset()
    decimal: str = "."
    thousands: str | None = None
    clock: bool = False
    format: str | None = None
    marks: str = ""
    usual: str = "mend the cell, or list it in `missing: {tokens: [...]}`; column names belong in the header"
    column: str | int | None = None
    form: str = ""

    def __call__(self, cell: Any) -> float:
        """Return the number, or the seconds of the stamp; NaN where there is none. Raises OddCell."""
        if isinstance(cell, bytes):
            cell = cell.decode("utf-8", "replace")
        value = number_of(cell, self.decimal, self.thousands)
        if value is not None and (not self.clock or not math.isfinite(value)):
            return value
        if value is None and isinstance(cell, str) and ((word := cell.strip()).lower() in MISSING or word in self.missing):
            return math.nan
        if not self.clock:
            raise self._odd(cell)
        stamp = (NUMBER, value) if value is not None and self.format is None else stamp_of(cell, self.format)
        if stamp is None:
            raise self._odd(cell)
        form, value = stamp
        if not self.form or (self.form, form) == (MINUTES, CLOCK):  # an hour of minutes has passed
            self.form = form
        if form != self.form:
            remedy = "write all stamps of a column in one form, or leave the others empty"
            raise OddCell(cell, f"is {form}, where {self.form} stands above", remedy)
        return value

    def _odd(self, cell: Any) -> OddCell:
        text = cell.strip() if isinstance(cell, str) else str(cell)
        kind, remedy = self._kind(cell, text)
        said = f"is not a number{kind and f': {kind}'}"
        return OddCell(text, said, remedy or self.usual, bool(kind), stamp_of(cell) is not None)

    def _kind(self, cell: Any, text: str) -> tuple[str, str]:
        """Return what an odd cell holds, and its remedy; nothing where it may be any word."""
        short = len(text) <= LONGEST_STAMP
        if isinstance(cell, bool) or text.lower() in ("true", "false"):
            return "TRUE or FALSE stands here", "write 1 and 0 where it counts as a number"
        if '"' in text:
            return "a quotation mark stands within it", "quote the whole field, or mend or remove the mark"
        if isinstance(cell, date | time | timedelta) or (short and _LIKE_A_DATE.fullmatch(text)):
            dated = isinstance(cell, date) or re.match(r"\d+[-/.]\d+[-/.]", text)
            kind = f"a {'date' if dated else 'time'} stands here"
            if not self.clock:
                return kind, DATES
            return kind, f"say how the stamps are written, as {FORMAT}"
        if not text.isascii() and any(mark.isdigit() and not mark.isascii() for mark in text):
            return "it has digits of another script", "write it in the digits 0 to 9"
        if ways := self._other_marks(text):
            named = [way for way in ways if way]
            return "other marks stand between its digits", f"say {' or '.join(named)}" if named else AS_NUMBERS
        if short and _WITH_UNIT.fullmatch(text) and not text[-1].isdigit():
            return "a unit stands behind it", "take the unit off, and name it in `columns`, as `unit: kPa`"
        return "", ""

    def _other_marks(self, text: str) -> list[str]:
        """Return what the spec can say so that it is a number; an empty text where the spec cannot."""
        ways = []
        for decimal in ".,":
            for thousands in (None, *THOUSANDS):
                if decimal == thousands or number_of(text, decimal, thousands) is None:
                    continue
                if thousands is not None and thousands not in text:
                    continue
                keys = {"decimal": decimal, "thousands": thousands or ""}
                known = all(mark in f".{self.marks}" for mark in keys.values()) and bool(self.marks)
                own = {"decimal": self.decimal, "thousands": self.thousands or ""}
                changed = [f'`{key}: "{mark}"`' for key, mark in keys.items() if mark != own[key] and mark]
                ways.append(" and ".join(changed) if known else "")
        return ways


def holds_number(cell: Any, decimal: str = ".") -> bool:
    """Whether a cell holds a number or a stamp, rather than a word for a missing one."""
    value = number_of(cell, decimal)
    return str(cell).strip() != "" if value is not None else stamp_of(cell) is not None


def stamp_of(cell: Any, layout: str | None = None) -> tuple[str, float] | None:
    """Return form and seconds of a stamp: since 1970 of a date, else since midnight or the start.

    Dates are as in ISO 8601, `2026/03/01` or `01.03.2026`, with a time behind them. Without a zone
    they count as UTC, since only differences matter. What reads one way here and another way there,
    as `3/1/2026` or `12:30`, is None without the `layout`, as `strptime` takes it.
    """
    match cell:
        case datetime():
            return "a date", (cell if cell.tzinfo is not None else cell.replace(tzinfo=UTC)).timestamp()
        case date():
            return stamp_of(datetime(cell.year, cell.month, cell.day))
        case time():
            since = timedelta(hours=cell.hour, minutes=cell.minute, seconds=cell.second)
            return CLOCK, (since + timedelta(microseconds=cell.microsecond)).total_seconds()
        case timedelta():
            return CLOCK, cell.total_seconds()
        case str() if len(cell) <= LONGEST_STAMP:
            text = cell.strip()
            return _dated(text) or _clock(text) if layout is None else _as_told(text, layout)
    return None


def has_date(layout: str) -> bool:
    """Whether stamps that are written so have a year."""
    return re.search("%[YyGcx]", layout.replace("%%", "")) is not None


def _as_told(text: str, layout: str) -> tuple[str, float] | None:
    if any(mark.isdigit() and not mark.isascii() for mark in text):  # which strptime takes
        return None
    try:
        stamp = datetime.strptime(text, layout)
    except ValueError:
        return None
    aware = stamp if stamp.tzinfo is not None else stamp.replace(tzinfo=UTC)
    return "a stamp", (aware - (_EPOCH if has_date(layout) else _FIRST)) / timedelta(seconds=1)


def _dated(text: str) -> tuple[str, float] | None:
    found = _DATED.fullmatch(text)
    try:
        if found is None:
            stamp = datetime.fromisoformat(text) if ":" in text else None
            return stamp and stamp_of(stamp)
        year, mark, month, day, *dotted, clock, utc, hours, minutes = found.groups()
        first = datetime(*map(int, (year, month, day) if year else dotted[::-1]), tzinfo=UTC)
    except ValueError:
        return None
    clock = f"{clock}:00" if re.fullmatch(r"\d\d:\d\d", clock) else clock
    ahead = 3600 * int(hours or 0) + int(f"{(hours or '+')[0]}{60 * int(minutes or 0)}")
    seconds = _clock(clock, int(first.timestamp()) - ahead, 24)
    form = f"a date with `{mark or '.'}` in it{' and a zone' if utc or hours else ''}"
    return seconds and (form, seconds[1])


def _clock(text: str, since: int = 0, most: float = math.inf) -> tuple[str, float] | None:
    """Return a time of day or an elapsed one, of less than `most` hours, in seconds."""
    found = _CLOCK.fullmatch(text)
    if found is None:
        return None
    days, clock, fraction, thousandths, half = found.groups()
    *hours, minute, second = map(int, clock.split(":"))
    form = CLOCK if hours else MINUTES
    if not hours and (fraction is None or thousandths or days or half or most < math.inf):
        return None
    hour = hours[0] if hours else 0
    if half:
        if not 1 <= hour <= 12:
            return None
        hour, form = hour % 12 + 12 * (half.lower() == "p"), f"{form} with AM and PM"
    if second > 59 or (hours and minute > 59) or hour >= most:
        return None
    whole, digits = since + 86400 * int(days or 0) + 3600 * hour + 60 * minute + second, fraction or thousandths or "0"
    return form, float(f"{whole}.{digits}") if whole >= 0 else whole + float(f"0.{digits}")


def shortened(cell: str, limit: int = 40) -> str:
    """Return a cell's text as a message may show it."""
    shown = cell.encode("unicode_escape").decode("ascii") if not cell.isprintable() else cell
    return shown if len(shown) <= limit else shown[: limit - 3] + "..."
