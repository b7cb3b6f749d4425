"""Describe a column of some files by its title, its unit and its values.

Values are used only to find facts: that a column never changes, is a clock, or is a copy of another
column.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from shlex import quote

import numpy as np

from mapmore_cli.annexes.drafting.draft import Column, NamedColumn, Raw, range_of
from mapmore_cli.annexes.drafting.layout import FileLayout
from mapmore_cli.annexes.drafting.titles import HALF_WIDTH, name_in, units_in
from mapmore_cli.checking.names import POSITIONS, read_label
from mapmore_cli.domain.arrays import Array
from mapmore_cli.ingestion.clock import MOST_GLITCHES
from mapmore_cli.study.units import CANONICAL, default_unit, unit_of

KINDS = {"pressure": "pressure", "force": "force", "load": "force"} | dict.fromkeys(
    POSITIONS, "position"
)
"""Quantities that a title can identify, and the kind of each."""


@dataclass(frozen=True)
class TitledColumn:
    """A column of some files, with the information in its title and in the files.

    Attributes
    ----------
    column, place
        Its name in the spec, and its index in the files, counted from 0.
    title
        Its title; empty if it has none.
    values
        One array `(n,)` for each file; none for a column of texts.
    texts, numbered, how
        The different texts in its cells; and for each file an array `(n,)` with the number of each
        cell's text, counted from 1. Both are empty for a column of numbers. `how` is the
        value of the key `texts` with which a spec reads the column.
    unread
        Why a column cannot be read whose cells hold a number with a unit, or a formula without a
        value, with the remedy; empty for any other column.
    quantity
        The quantity that its title names; empty for none.
    plain
        True if the title contains nothing but the quantity, and perhaps its unit.
    unit, source
        The unit, and where it is stated; empty if it is unknown.
    """

    column: Column
    place: int
    title: str
    values: Sequence[Array]
    quantity: str
    plain: bool
    unit: str
    source: str
    texts: Sequence[str] = ()
    numbered: Sequence[Array] = ()
    how: bool | str = True
    unread: str = ""

    @property
    def kind(self) -> str:
        """Kind of the quantity: `position`, `pressure`, or `force` for forces and loads; empty for
        any other quantity.
        """
        return KINDS.get(self.quantity, "")

    @property
    def called(self) -> str:
        """Name of the column in messages."""
        return self.title or (
            self.column if isinstance(self.column, str) else f"column {self.column}"
        )

    @property
    def asked_for(self) -> str:
        """Name of the column on a command line: its title in quotes, otherwise its number."""
        return quote(self.title) if self.title else str(self.place)

    @property
    def described(self) -> str:
        """Description of the column: its name and unit, with its range, or with its texts."""
        if self.texts:
            return f"{self.called}  {len(self.texts)} texts, {self.texts[0]} to {self.texts[-1]}"
        return f"{self.called}  {range_of(self.values, self.unit or '1')}"

    @property
    def name(self) -> str:
        """Name of a quantity, made from the title without the unit. If the result is the name of a
        known quantity, the number of the column is appended, because the column may hold another
        quantity.
        """
        name = name_in(self.title)
        return name if name not in ("column", *CANONICAL) else f"{name}_{self.place}"

    @property
    def moves(self) -> bool:
        """Return True if the values of the column are not all equal."""
        return len(self.values) > 0 and float(np.ptp(np.concatenate(self.values))) > 0

    @property
    def kinds(self) -> Array:
        """Distinct values of the column, (m,)."""
        return np.unique(np.concatenate(self.values)) if self.values else np.empty(0)

    @property
    def rises(self) -> bool:
        """Return True if the column increases in every file, except for a few steps back, and
        seldom repeats a value.
        """
        return self.moves and all(
            len(x) > 1
            and np.mean(np.diff(x) < 0) <= MOST_GLITCHES
            and 2 * np.count_nonzero(np.diff(x)) >= len(x) - 1
            for x in self.values
        )

    @property
    def falls(self) -> bool:
        """Return True if the column would increase if the rows were read from the last to the first
        one.
        """
        return replace(self, values=[x[::-1] for x in self.values]).rises

    @property
    def turn(self) -> float:
        """Number at which the column repeatedly restarts from zero, for example 60 for the seconds
        of a clock; 0 if it does not.
        """
        steps = [np.diff(x) for x in self.values]
        falls = [np.flatnonzero(step < 0) for step in steps]
        if not sum(map(len, falls)):
            return 0.0
        usual = 1.5 * float(np.median(np.abs(np.concatenate(steps))) or 1.0)
        before = np.concatenate([x[at] for x, at in zip(self.values, falls, strict=True)])
        after = np.concatenate([x[at + 1] for x, at in zip(self.values, falls, strict=True)])
        if (after < 0).any() or (after > usual).any():
            return 0.0
        turns = (turn for turn in TURNS if (before < turn).all() and (before >= turn - usual).all())
        return next(turns, 0.0)

    @property
    def counts(self) -> bool:
        """Return True if the column increases by one from row to row."""
        return all(len(x) > 1 and (np.diff(x) == 1).all() for x in self.values)

    @property
    def blocks(self) -> int:
        """Number of recordings that the column may distinguish; 0 if it distinguishes none. In
        such a column, all rows of a recording have the same text or the same number, the numbers
        count the recordings, and the rows of a recording follow each other.
        """
        series = self.numbered or self.values
        changes = sum(int(np.count_nonzero(np.diff(x))) for x in series)
        kinds = sum(len(np.unique(x)) for x in series)
        pooled = np.unique(np.concatenate(series)) if series else np.empty(0)
        counts = pooled.size > 0 and pooled[0] in (0, 1) and bool((np.diff(pooled) == 1).all())
        is_named = bool(self.quantity or self.unit)
        is_apart = counts and not is_named and kinds == changes + len(series) > len(series)
        return kinds if is_apart and sum(map(len, series)) >= FEWEST_ROWS * kinds else 0

    @property
    def summaries(self) -> list[str]:
        """Texts of the column that mark rows computed from other rows, for example `mean`."""
        return [text for text in self.texts if text.casefold() in SUMMARIES]

    @property
    def is_time(self) -> bool:
        """Return True if the title or the unit says that the column is the time."""
        by_unit = not self.quantity and bool(unit_of(self.unit, "s"))
        return self.quantity == "time" or by_unit

    @property
    def may_be_clock(self) -> bool:
        """Return True if the column increases like a clock and its title does not say what the
        column holds.
        """
        return not self.title and self.rises and not self.turn

    def as_quantity(self, name: str) -> NamedColumn:
        """Return the column as a quantity, in the unit from the title or the file.

        A known quantity without a unit gets the model's unit, and the draft asks the user to
        confirm it.
        """
        if self.texts:
            return NamedColumn(self.column, "1", "you; texts are numbered", texts=self.how)
        usual = unit_of_clock(self.values) if name == "time" else default_unit(name)
        unit = self.unit or usual
        if unit == "rad" and np.abs(self.kinds).max(initial=0) > MOST_RADIANS:
            why = f"this is more than two turns: is it deg? {range_of(self.values, unit)}"
            return NamedColumn(self.column, unit, why, sure=False)
        if self.unit or unit == "1":
            why = f"{self.source or 'title'}; {range_of(self.values, unit)}"
            return NamedColumn(self.column, unit, why)
        reason = "its title gives no unit" if self.title else "it always increases"
        why = f"{reason}: is it {unit}? {range_of(self.values)}"
        return NamedColumn(self.column, unit, why, sure=False)


TURNS = (24.0, 60.0, 1000.0, 3600.0, 86400.0)
"""Values at which hours, minutes, milliseconds, and seconds of an hour and of a day restart."""

CLOCKS = {"ms": "ms", "us": "us", "ns": "ns", "millis": "ms", "micros": "us"}
"""Titles that mean a clock, and its unit: units of time, except for a single letter or `min`, which
may mean another quantity, and the functions of microcontrollers that read a clock.
"""

SINCE_1970 = (946_684_800.0, 4_102_444_800.0)
"""Seconds from the beginning of 1970 to the years 2000 and 2100. Clocks of computers count from
1970 on, so a time between these limits is a date of this century.
"""

SUMMARIES = {
    *("mean", "average", "avg", "median", "std", "sd", "stdev", "stddev", "min", "max", "sum"),
    *("total", "mittelwert", "mittel", "moyenne", "media", "promedio", "ecart-type"),
}
"""Words in rows below a table that were computed from the rows above, for example `mean`."""

MOST_RADIANS = 4 * np.pi
"""Largest angle, rad, that is accepted without a question."""

FEWEST_ROWS = 5
"""A column may distinguish recordings if these have at least this number of rows on average."""

Texts = tuple[Sequence[str], Sequence[Array], bool | str]
"""The different texts of a column; for each file an array `(n,)` with the number of each cell's
text, counted from 1; and the value of the key `texts` with which a spec reads them.
"""

Table = Mapping[Column, TitledColumn]
"""All columns of some files, in their order."""


def read_titles(layout: FileLayout, raw: Raw, texts: Mapping[Column, Texts] | None = None) -> Table:
    """Return the columns of files with the information in their titles and in the units that the
    files give. `texts` holds the columns of texts.
    """
    lines = zip_longest(layout.columns, layout.titles, layout.units, fillvalue="")
    table = {
        column: _read_title(column, place, title, raw.get(column, ()), unit)
        for place, (column, title, unit) in enumerate(lines)
    }
    for column, (words_of_column, numbers, how) in (texts or {}).items():
        table[column] = replace(table[column], texts=words_of_column, numbered=numbers, how=how)
    return table


def _read_title(
    column: Column, place: int, title: str, values: Sequence[Array], line: str
) -> TitledColumn:
    """Return a column with the quantity and the unit that its title gives. If the unit does not
    suit the quantity, for example volts for a force, the column gets no quantity.
    """
    label = read_label(title.translate(HALF_WIDTH))
    # cells that are displayed in per cent hold fractions, even if `%` stands in the title
    is_ratio = line == "1"
    texts = ["1"] if is_ratio else [*units_in(title), line]
    unit = next((unit_in_text for text in texts if (unit_in_text := unit_of(text))), "")
    quantity, is_plain = "", False
    if label is not None:
        like = CANONICAL.get(label.quantity) if label.quantity != "input" else None
        own_unit = (label.unit if not is_ratio else None) or next(
            (unit_in_text for text in texts if (unit_in_text := unit_of(text, like))), ""
        )
        if own_unit or not unit:
            quantity, is_plain, unit = label.quantity, label.plain, own_unit
    if not (unit or quantity):
        unit = CLOCKS.get(title.strip().casefold(), "")
    source = "" if not unit else "the file's units" if unit_of(line) else "title"
    return TitledColumn(column, place, title, values, quantity, is_plain, unit, source)


def unit_of_clock(values: Sequence[Array]) -> str:
    """Suggest a unit for a clock. If the clock seems to count from 1970 on, the unit is the one in
    which it shows a date of this century. Otherwise, the unit is ms for whole numbers that increase
    by 1 to 100 per step, and s for all other numbers.
    """
    first, last = (min(map(np.min, values)), max(map(np.max, values)))
    for unit, second in {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}.items():
        if SINCE_1970[0] * second <= first and last <= SINCE_1970[1] * second:
            return unit
    steps = np.diff(max(values, key=len))
    step = float(np.median(steps)) if steps.size else 0.0
    is_whole = all((x == np.round(x)).all() for x in values)
    return "ms" if is_whole and 1 <= step <= 100 else "s"
