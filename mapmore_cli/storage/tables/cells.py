"""Read the cells of files of all formats by the same rules. A cell is a number in ASCII digits, a
missing value, or, in the column of the time, a time stamp. For anything else, an error shows the
text of the cell and a remedy.
"""

from __future__ import annotations

import math
import re
from collections.abc import Set
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from decimal import Decimal
from numbers import Real
from typing import Self

from mapmore_cli.domain.errors import DataError

MISSING = frozenset({"na", "n/a", "#n/a", "null", "none"})
"""Words for a missing value, besides an empty cell and `nan`, in lower case."""

THOUSANDS = ",.'\u2019 \u00a0\u202f"
"""Characters that may separate thousands."""

LONGEST_STAMP = 40
NUMBER, MINUTES, CLOCK, ISO = (
    "a number",
    "a time as `mm:ss.s`",
    "a time as `hh:mm:ss`",
    "a date as `2026-03-01`",
)
FORMAT = '`time: {column: t, format: "%m/%d/%Y %I:%M:%S.%f %p"}`'
DATES = (
    "time stamps are read in the column `time` only; format the cells as numbers in the "
    "program that wrote them, or correct the cell"
)

_TIME = (
    # a time with AM or PM must have an hour from 1 to 12
    r"(?!(?!0?[1-9]:|1[0-2]:).*m)(?P<h>\d+):(?P<m>[0-5]?\d)"
    r"(?::(?P<s>[0-5]?\d)(?:(?:[.,]|:(?=\d{3}\b))(?P<f>\d+))?)?(?: *(?P<half>[ap])\.?m\.?)?"
)
_DATED = (
    rf"(?P<date>[\d./-]+)[T ] *(?=(?:[01]?\d|2[0-3]):){_TIME} *(?:Z|(?P<zone>[+-]\d\d:?(?:\d\d)?))?"
)
_FORMS = {
    MINUTES: (r"(?P<m>\d+):(?P<s>[0-5]?\d)[.,](?P<f>\d+)", ""),
    CLOCK: (rf"(?:(?P<d>\d+) days?,? +)?(?=.*:.*:){_TIME}", ""),
    ISO: (_DATED, "%Y-%m-%d%z"),
    "a date as `2026/03/01`": (_DATED, "%Y/%m/%d%z"),
    "a date as `01.03.2026`": (_DATED, "%d.%m.%Y%z"),
}
FOREIGN = r"(?![0-9])\d"
OF_MICROSOFT = re.compile(
    r"(?P<sign>[+-]?)(?:\d\.#(?:(?P<infinite>INF|J)|IND|QNAN|SNAN)\d*|nan\((?:ind|snan)\))", re.I
)
"""How Microsoft's C library writes infinity and NaN, for example `-1.#IND`."""

_OF_FORTRAN = re.compile(r"[+-]?(?:\d+\.\d*|\.\d+)[dD][+-]\d+", re.ASCII)
"""A number in double precision as Fortran writes it, for example `1.0D+03`."""
_NARROW = re.compile(r"(?<=\d)[\u00a0\u202f](?=\d{3}(?!\d))")
"""A blank that never ends a line, before three digits of a number: it separates thousands."""

_SECONDS = {"d": 86400, "h": 3600, "m": 60, "s": 1}

_KINDS = (
    (
        r"#\w[\w/]*[!?]?|err:\d+",
        "a formula failed there",
        "correct it, or list it in `missing: {tokens: [...]}`",
    ),
    (r"true|false", "it is TRUE or FALSE", "write 1 and 0 if it is meant as a number"),
    (
        r'.*".*',
        "it contains a quotation mark",
        "quote the whole field, or correct or remove the mark",
    ),
    (rf".*{FOREIGN}.*", "its digits are of another script", "write it with the digits 0 to 9"),
    (r"\d{1,4}([-/.])\d{1,2}\1\d{1,4}\b.*", "it is a date", ""),
    (r".*\d:\d.*|\d+ *[ap]\.?m\.?", "it is a time", ""),
    (
        rf"[+-]?\d*(?:[{THOUSANDS}]\d+)+(?:e[+-]?\d+)?",
        "it has another decimal point than the one that is set, or separators of thousands",
        'give the right ones, for example `decimal: ","`, `decimal: "."` or `thousands: ","`; or '
        "format the cells as numbers in the program that wrote them",
    ),
    (
        r"[+-]?(?!0x)\d[\d.,]*(?:e[+-]?\d+)? *(?:[^\W\d_]+|[^\w\s.,+-][^\W\d_]*)",
        "it is followed by a unit",
        "remove the unit from the cells, and name it in `columns`, for example `unit: kPa`",
    ),
)
"""Patterns of cells that are neither numbers nor words for missing values, each with the reason and
a remedy.
"""


@dataclass(frozen=True)
class Lacking:
    """A cell that should hold a number but has no value, for example a formula that was never
    computed. `said` is the reason, `remedy` is the remedy for the message, and `text` is shown in
    place of the cell.
    """

    said: str
    remedy: str
    text: str = ""

    def __str__(self) -> str:
        return self.text


class NotANumber(DataError):
    """Error for a cell that is neither a number nor a word for a missing value. `known` is True if
    it is known what the cell is instead, for example the error of a formula.
    """

    def __init__(self, cell: str, problem: str, remedy: str, known: bool = True) -> None:
        super().__init__(f"'{shortened(cell)}' {problem}" if cell else problem, remedy)
        self.cell, self.known = cell, known

    def at(self, where: str, remedy: str | None = None) -> Self:
        """Add the place in the file to the message, and return the error. `remedy` replaces the
        usual remedy if it is not None.
        """
        self.message, self.remedy = f"{where}: {self.message}", remedy or self.remedy
        return self


def number_of(cell: object, decimal: str = ".", thousands: str | None = None) -> float | None:
    """Return the number in a cell. Return NaN for an empty cell, and None if the cell is no number.

    Infinity and NaN in a cell are returned unchanged; the spec says how such values are treated.
    """
    if isinstance(cell, str):
        cell = cell.strip()
        if not cell.isascii():
            cell = _NARROW.sub("", cell)
        if thousands is not None:
            groups = (
                rf"[+-]?\d{{1,3}}(?:{re.escape(thousands)}\d{{3}})+(?:{re.escape(decimal)}\d*)?"
            )
            cell = cell.replace(thousands, "") if re.fullmatch(groups, cell) else cell
        if decimal != ".":
            cell = cell.replace(".", "x").replace(decimal, ".")
        if not cell:
            return math.nan
        # refused here, because `float` would read 1_5 as 15, and would accept the digits of every
        # script
        if "_" in cell or not cell.isascii():
            return None
    elif isinstance(cell, bool) or not isinstance(cell, Real | Decimal):
        return math.nan if cell is None or cell != cell else None
    try:
        return float(cell)
    except (ValueError, OverflowError):
        if _OF_FORTRAN.fullmatch(str(cell)):
            return float(str(cell).lower().replace("d", "e"))
        written = OF_MICROSOFT.fullmatch(str(cell))
        if written is None:
            return None
        return float(f"{written['sign']}inf") if written["infinite"] else math.nan


@dataclass
class CellReader:
    """Reader of the cells of one column.

    - `missing`: texts that mean a missing value.
    - `decimal`, `thousands`: decimal mark and thousands separator of numbers.
    - `clock`: True for the column of the time.
    - `format`: format of the time stamps, as for `strptime`.
    - `second`: length of one second in the unit of the column.
    - `usual`: default remedy in messages.
    - `form`: form of the stamps read so far; all stamps of a column must have the same form.
    - `texts`: for a column of texts, the number that represents each text read so far.
    """

    missing: Set[str] = frozenset()
    decimal: str = "."
    thousands: str | None = None
    clock: bool = False
    format: str | None = None
    second: float = 1.0
    usual: str = (
        "correct the cell, or list it in `missing: {tokens: [...]}`; column names belong in "
        "the header"
    )
    form: str = ""
    texts: dict[str, float] | None = None

    @property
    def reads_more_than_numbers(self) -> bool:
        """Return True if cells of the column can be something other than plain numbers: texts or
        time stamps.
        """
        is_stamped = self.clock and bool(self.format or self.form not in ("", NUMBER))
        return self.texts is not None or is_stamped

    def __call__(self, cell: object) -> float:
        """Return the number in the cell, or the number that stands for its time stamp or its text;
        NaN for a missing value. Raises NotANumber for any other cell.
        """
        if isinstance(cell, Lacking):
            if self.texts is not None and not cell.text:
                # the first of several merged cells holds their text; the others are missing values
                return math.nan
            raise NotANumber("", cell.said, cell.remedy)
        cell = cell.decode("utf-8", "replace") if isinstance(cell, bytes) else cell
        value = number_of(cell, self.decimal, self.thousands)
        if self.texts is not None and value == value:
            text = f"{cell:.15g}" if isinstance(cell, float) else str(cell).strip()
            is_missing = text.lower() in MISSING or text in self.missing
            return math.nan if is_missing else self.texts.setdefault(text, len(self.texts) + 1.0)
        if value is not None and not (self.clock and math.isfinite(value)):
            return value
        text = str(cell).strip()
        if value is None and (text.lower() in MISSING or text in self.missing):
            return math.nan
        stamp = self._stamp(cell, text, value) if self.clock else None
        if stamp is None:
            known = (
                one[1:] for one in _KINDS if re.fullmatch(one[0], text[:LONGEST_STAMP], re.I | re.S)
            )
            kind, remedy = next(known, ("", self.usual))
            stamps = f"give the form of the stamps, for example {FORMAT}" if self.clock else DATES
            raise NotANumber(
                text, f"is not a number{kind and f': {kind}'}", remedy or stamps, bool(kind)
            )
        form, seconds = stamp
        # the form may change once: some clocks show `mm:ss` during the first hour, and `hh:mm:ss`
        # afterwards
        if not self.form or (self.form, form) == (MINUTES, CLOCK):
            self.form = form
        if form != self.form:
            remedy = "a column holds numbers only, or stamps of one form only: correct the cell"
            raise NotANumber(text, f"is {form}, but the cells above are {self.form}", remedy)
        return seconds

    def _stamp(self, cell: object, text: str, value: float | None) -> tuple[str, float] | None:
        """Return the form of a cell in the time column, and the time as a number; None if the cell
        is no time.
        """
        if self.format is None and value is not None:
            return NUMBER, value
        if self.format is None or not isinstance(cell, str):
            form_and_time = stamp_of(text)
            return form_and_time and (form_and_time[0], form_and_time[1] * self.second)
        try:
            stamp = datetime.strptime("" if re.search(FOREIGN, text) else text, self.format)
        except (ValueError, re.error):
            return None
        first = datetime(1970 if stamp.year > 1900 else 1900, 1, 1, tzinfo=UTC)
        return "a stamp", (
            stamp.replace(tzinfo=stamp.tzinfo or UTC) - first
        ).total_seconds() * self.second


def stamp_of(text: str) -> tuple[str, float] | None:
    """Return the form of a time stamp and the time in s; None if the text is no time stamp.

    A stamp with a date gives the time since 1970. A stamp without a date gives the time since
    midnight, or since the start of the recording. Dates are written as in ISO 8601, as `2026/03/01`
    or as `01.03.2026`, and a time follows. If there is no time zone, UTC is assumed, because only
    differences of times matter. Return None also for a date without a time, and for a stamp that is
    read differently in different countries, such as `3/1/2026` or `12:30`.
    """
    with suppress(ValueError):
        # a stamp in the form of ISO 8601 is parsed in a faster way
        if text[4:5] == "-" and ":" in text:
            stamp = datetime.fromisoformat(text)
            zone = " with a zone" if stamp.utcoffset() else ""
            return f"{ISO}{zone}", stamp.replace(tzinfo=stamp.tzinfo or UTC).timestamp()
    for form, (pattern, layout) in _FORMS.items() if len(text) <= LONGEST_STAMP else ():
        match = re.fullmatch(pattern, text, re.A | re.I)
        if match is None:
            continue
        part = dict.fromkeys((*_SECONDS, "f", "half", "zone")) | match.groupdict()
        whole = sum(int(part[name] or 0) * size for name, size in _SECONDS.items())
        try:
            if layout:
                date = datetime.strptime(
                    f"{part['date']}{(part['zone'] or '+').ljust(5, '0')}", layout
                )
                whole += int(date.timestamp())
        except ValueError:
            continue
        if part["half"]:
            whole += 43200 * ((part["half"] in "pP") - (int(part["h"] or 0) == 12))
        marks = (
            f"{' with AM and PM' if part['half'] else ''}{' with a zone' if part['zone'] else ''}"
        )
        return f"{form}{marks}", float(whole + Decimal(f"0.{part['f'] or 0}"))
    return None


def holds_number(cell: object, decimal: str = ".", thousands: str | None = None) -> bool:
    """Return True if a cell holds a number or a time stamp. Return False for other texts and for an
    empty cell.
    """
    text = str(cell).strip()
    number = number_of(cell, decimal, thousands)
    return bool(text) if number is not None else stamp_of(text) is not None


def shortened(cell: str, limit: int = 40) -> str:
    """Return the text of a cell, shortened for a message."""
    shown = cell.encode("unicode_escape").decode("ascii") if not cell.isprintable() else cell
    return shown if len(shown) <= limit else shown[: limit - 3] + "..."
