"""Find the names and roles of columns from their titles and units, or from what a person says.

Values are only used for facts: a column that never changes, a clock, a copy of another column.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest

import numpy as np

from mapmore_cli.annexes.drafting.draft import Column, Named, NamedColumn, Raw, range_of
from mapmore_cli.annexes.drafting.preview import Preview
from mapmore_cli.checking.evidence import same_signals
from mapmore_cli.checking.names import POSITIONS, read_label
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.ingestion.clock import MOST_GLITCHES
from mapmore_cli.study.units import CANONICAL, default_unit, unit_of

_KINDS = {"pressure": "pressure", "force": "force", "load": "force"} | dict.fromkeys(
    POSITIONS, "position"
)
"""Names of columns whose titles identify them, and the kind of each quantity."""
_BRACKETS = re.compile(r"[\[(]\s*([^\])]+?)\s*[\])]")
_LETTER = re.compile(r"(?<![^\W_])[A-Za-z](?![^\W_])")
_NUMBERED_PRESSURE = re.compile(r"p(?:ressure)?_?[A-Za-z0-9]", re.IGNORECASE)
_BEHIND = re.compile(r"(?:[_,/]|\bin)\s*([^\s_,/]+)$")
_NO_MEASUREMENT = {
    *("simulated", "simulation", "sim", "model", "modelled", "predicted", "prediction", "fitted"),
    *("estimated", "estimate", "theoretical", "calculated", "residual"),
}
"""Words in titles of computed columns."""


@dataclass(frozen=True)
class TitledColumn:
    """A column of some files, and what its title and the files say about it.

    Attributes
    ----------
    column, place
        Its name in the spec, and its index in the files, counted from 0.
    title
        Its title; empty if it has none.
    values
        One array `(n,)` for each file; none for a column of texts.
    quantity
        The quantity that its title names; empty for none.
    plain
        True if the title contains nothing else.
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

    @property
    def kind(self) -> str:
        """Kind of the column: one word for all positions, and one for forces and loads; empty for
        other quantities.
        """
        return _KINDS.get(self.quantity, "")

    @property
    def called(self) -> str:
        """Name in messages."""
        return self.title or (
            self.column if isinstance(self.column, str) else f"column {self.column}"
        )

    @property
    def described(self) -> str:
        """Name with range, and with unit if it is known."""
        return f"{self.called}  {range_of(self.values, self.unit or '1')}"

    @property
    def name(self) -> str:
        """Name from the title, without the unit."""
        bare = _BRACKETS.sub(lambda match: "" if unit_of(match[1]) else match[0], self.title)
        behind = _BEHIND.search(bare)
        bare = bare[: behind.start()] if behind is not None and unit_of(behind[1]) else bare
        name = re.sub(r"\W+", "_", spelt(bare), flags=re.ASCII).strip("_")[:40]
        name = f"column_{name}" if name[:1].isdigit() else name or "column"
        return name if name not in ("column", *CANONICAL) else f"{name}_{self.place}"

    @property
    def moves(self) -> bool:
        """True if its values are not all equal."""
        return len(self.values) > 0 and float(np.ptp(np.concatenate(self.values))) > 0

    @property
    def kinds(self) -> Array:
        """Its distinct values, (m,)."""
        return np.unique(np.concatenate(self.values)) if self.values else np.empty(0)

    @property
    def rises(self) -> bool:
        """True if it increases in every file, except for a few steps back, and seldom repeats a
        value.
        """
        return self.moves and all(
            len(one) > 1
            and np.mean(np.diff(one) < 0) <= MOST_GLITCHES
            and 2 * np.count_nonzero(np.diff(one)) >= len(one) - 1
            for one in self.values
        )

    @property
    def turn(self) -> float:
        """Number at which it restarts again and again, for example 60 for the seconds of a clock; 0
        if it does not.
        """
        steps = [np.diff(one) for one in self.values]
        falls = [np.flatnonzero(step < 0) for step in steps]
        if not sum(map(len, falls)):
            return 0.0
        usual = 1.5 * float(np.median(np.abs(np.concatenate(steps))) or 1.0)
        before = np.concatenate([x[at] for x, at in zip(self.values, falls, strict=True)])
        after = np.concatenate([x[at + 1] for x, at in zip(self.values, falls, strict=True)])
        regular = (after >= 0).all() and (after <= usual).all()
        turns = (one for one in TURNS if (before < one).all() and (before >= one - usual).all())
        return next(turns, 0.0) if regular else 0.0

    @property
    def counts(self) -> bool:
        """True if it increases by one from row to row."""
        return all(len(one) > 1 and (np.diff(one) == 1).all() for one in self.values)

    @property
    def is_time(self) -> bool:
        """True if the title or the unit says that it is the time."""
        by_unit = not self.quantity and bool(unit_of(self.unit, "s"))
        return self.quantity == "time" or by_unit

    @property
    def may_be_clock(self) -> bool:
        """True if it increases like a clock and its title does not say what it is."""
        return not self.title and self.rises and not self.turn

    def as_quantity(self, name: str) -> NamedColumn:
        """Return the column as a quantity, in the unit from the title or the file.

        A canonical quantity without a unit gets the model's unit, which is marked as a question.
        """
        if self.unit or name not in CANONICAL:
            why = f"{self.source or 'title'}; {range_of(self.values, self.unit or '1')}"
            return NamedColumn(self.column, self.unit or "1", why)
        usual = default_unit(name) if name != "time" else unit_of_clock(self.values)
        if usual == "1":
            return NamedColumn(self.column, usual, f"title; {range_of(self.values)}")
        reason = "its title says no unit" if self.title else "it rises all the time"
        why = f"{reason}: is it {usual}? {range_of(self.values)}"
        return NamedColumn(self.column, usual, why, sure=False)


TURNS = (24.0, 60.0, 1000.0, 3600.0, 86400.0)
"""Values at which hours, minutes, milliseconds, and seconds of an hour and of a day restart."""

Table = Mapping[Column, TitledColumn]
"""All columns of some files, in their order."""


def read_titles(layout: Preview, raw: Raw) -> Table:
    """Return the columns of files, with the information in their titles and in the files."""
    texts = zip_longest(layout.columns, layout.titles, layout.units, fillvalue="")
    return {
        column: _read_title(column, place, title, raw.get(column, ()), unit)
        for place, (column, title, unit) in enumerate(texts)
    }


def _read_title(
    column: Column, place: int, title: str, values: Sequence[Array], line: str
) -> TitledColumn:
    """Return a column. If its unit does not suit the quantity in its title, for example volts for a
    force, the title names no quantity.
    """
    label = read_label(title)
    texts = [*_BRACKETS.findall(title), *_BEHIND.findall(title), line]
    unit = next((one for text in texts if (one := unit_of(text))), "")
    quantity, is_plain = "", False
    if label is not None:
        like = CANONICAL.get(label.quantity) if label.quantity != "input" else None
        own_unit = label.unit or next((one for text in texts if (one := unit_of(text, like))), "")
        if own_unit or not unit:
            quantity, is_plain, unit = label.quantity, label.plain, own_unit
    source = "" if not unit else "the file's units" if unit_of(line) else "title"
    return TitledColumn(column, place, title, values, quantity, is_plain, unit, source)


def find(table: Table, wanted: Column, option: str) -> TitledColumn:
    """Return the column with a place, a title, or a word that only one title has.

    Raises UsageError with a list of the columns if there is none, or if there are several.
    """
    numbers = [one for one in table.values() if one.values]
    rules = [lambda one: one.column == wanted, lambda one: one.place == wanted]
    if isinstance(wanted, str):
        parts = words(wanted)
        rules += [
            lambda one: words(one.title) == parts,
            lambda one: bool(parts) and {*parts} <= {*words(one.title)},
            lambda one: one.name == wanted,
        ]
    near = next(filter(None, ([*filter(rule, numbers)] for rule in rules)), [])
    if len(near) != 1:
        problem = "several columns are" if near else "no column of numbers is"
        several = ", ".join(one.called for one in near or numbers)
        raise UsageError(
            f"{option}: {problem} called {wanted}", f"give one of {several}, or its number"
        )
    return near[0]


def listed(table: Table, but: Iterable[Column] = ()) -> dict[int, TitledColumn]:
    """Return the columns that move, by the numbers in lists with which people refer to them."""
    return {one.place: one for one in table.values() if one.moves and one.column not in {*but}}


def words(text: str) -> list[str]:
    """Return the words and numbers of a text in small letters."""
    return [word.casefold() for word in re.findall(r"[^\W\d_]+|\d+", text)]


def spelt(text: str) -> str:
    """Return a text in the Latin alphabet: accents are removed, and letters are replaced by their
    Unicode names, within words by the first sounds of these (`θ1` becomes `theta1`, `Πίεση` becomes
    `piese`); other signs become their number.
    """
    plain = "".join(
        sign for sign in unicodedata.normalize("NFKD", text) if not unicodedata.combining(sign)
    )
    return re.sub(r"[^\W\d_a-zA-Z]+", _spelt_word, plain)


def _spelt_word(match: re.Match[str]) -> str:
    letters: list[str] = []
    for sign in match[0]:
        said = unicodedata.name(sign, "").rpartition(" LETTER ")[2].removeprefix("FINAL ").lower()
        name = said.partition(" with ")[0]
        if not name.replace(" ", "").isalpha() or sign == "\N{LATIN SMALL LETTER SHARP S}":
            name = "ss" if sign == "\N{LATIN SMALL LETTER SHARP S}" else f"u{ord(sign):x}"
        elif len(match[0]) > 1 and "GREEK" in unicodedata.name(sign):
            name = name[: 2 if name[:2] in ("th", "ph", "ch", "ps") else 1]
        letters.append(name.replace(" ", "_"))
    return "".join(letters)


def unit_of_clock(values: Sequence[Array]) -> str:
    """Return ms for whole numbers that increase by 1 to 100 per step, otherwise s, as a
    suggestion.
    """
    steps = np.diff(max(values, key=len))
    step = float(np.median(steps)) if steps.size else 0.0
    is_whole = all((one == np.round(one)).all() for one in values)
    return "ms" if is_whole and 1 <= step <= 100 else "s"


# By titles
# --------------------------------------------------------------------------------------------------


Known = tuple[Named, dict[Column, str]]
"""The columns by name, the clock first, and the reasons why others are left out."""


def known_by_titles(table: Table) -> Known:
    """Return the columns that move, named by quantity if the title identifies one, otherwise by
    title.

    If several titles identify the same quantity, each keeps its title, except the plainest one. A
    copy of another column, a computed column, and a column that increases like a clock but is not
    the time are left out.
    """
    parts = clock_in_parts(table)
    clock = next(
        (one for one in table.values() if one.is_time and one.rises and not one.turn), None
    )
    used = {*parts} or {one.column for one in [clock] if one is not None}
    rest = [one for one in table.values() if one.column not in used]
    left_out = {one.column: why for one in rest if (why := _why_unused(one, bool(used)))}
    left_out |= _copies([one for one in rest if one.column not in left_out])
    kept = [one for one in rest if one.column not in left_out]
    quantities = _plain_names(kept)
    columns: Named = {} if clock is None else {"time": clock.as_quantity("time")}
    if parts:
        why = "titles: a clock in parts, which are added"
        columns["time"] = NamedColumn(next(iter(parts)), why=why, parts=parts)
    for one in kept:
        name = quantities.get(one.column, one.name)
        name = f"column_{one.place}" if name in {*columns, "time"} else name
        columns[name] = one.as_quantity(name)
    return columns, left_out


def _why_unused(one: TitledColumn, has_clock: bool) -> str:
    """Return the reason why a column is no quantity of the study; empty if it may be one."""
    if not one.values:
        return "holds no numbers"
    if not one.moves:
        return "never changes"
    if one.is_time and (turn := one.turn) and not has_clock:
        return f"begins anew at {turn:g}: where it is the clock, say `unwrap: {turn:g}` at `time`"
    if one.quantity == "time" or (one.is_time and has_clock):
        return "is a second clock" if has_clock else _why_no_clock(one)
    if one.may_be_clock:
        unit = unit_of_clock(one.values)
        return f"rises all the time: where it is the clock, name it, as `time={one.place}:{unit}`"
    if _NO_MEASUREMENT & {*words(one.title)}:
        return "was computed, as its title says"
    return "counts its rows" if not one.quantity and one.counts else ""


def _why_no_clock(one: TitledColumn) -> str:
    repeats = any(2 * np.count_nonzero(np.diff(x)) < len(x) - 1 for x in one.values)
    return "mostly repeats, as no clock does" if repeats else "its clock is set back"


PARTS = {
    "h": ("h hh hr hrs hour hours std stunde stunden heure heures hora horas ora ore", 24),
    "min": ("m mm min mins minute minutes minuten minuto minutos minuti", 60),
    "s": ("s ss sec secs second seconds sek sekunde sekunden segundo segundos secondi", 60),
    "ms": ("ms msec millis milli millisecond milliseconds millisekunden milisegundos", 1000),
    "us": ("us usec micros microsecond microseconds mikrosekunden", 1000),
}
"""Words in titles of the parts of a clock, by unit, and the number at which each part restarts."""


def clock_in_parts(table: Table) -> dict[Column, str]:
    """Return the columns of a clock in parts (for example hours, minutes and seconds) and their
    units; empty unless titles and values agree on that.

    A part holds numbers below the one at which it restarts. Only the finest part may have
    fractions. The first part may be any, and no part may be missing in between.
    """
    parts: dict[str, TitledColumn] = {}
    for one in table.values():
        said = words(one.title)
        if not one.values or not said:
            continue
        for unit, (spellings, turn) in PARTS.items():
            fits = all((x >= 0).all() and (x < turn).all() for x in one.values)
            if said[-1] in spellings.split() and fits:
                parts.setdefault(unit, one)
                break
    units = [unit for unit in PARTS if unit in parts]
    order = [*PARTS]
    while len(units) > 1 and order.index(units[-1]) - order.index(units[0]) >= len(units):
        units.pop()
    coarse = [parts[unit] for unit in units[:-1]]
    is_whole = all((x == np.round(x)).all() for one in coarse for x in one.values)
    if len(units) < 2 or not is_whole or not any(parts[unit].turn for unit in units[1:]):
        return {}
    return {parts[unit].column: unit for unit in units}


def _copies(columns: Sequence[TitledColumn]) -> dict[Column, str]:
    """Return which columns are copies of which: the column whose title and unit say more is
    kept.
    """
    copies: dict[Column, str] = {}
    for family in same_signals([np.concatenate(one.values) for one in columns]):
        members = [columns[place] for place in family]
        best = min(members, key=_silence)
        for one in members:
            if one is not best and one.kind in ("", best.kind):
                copies[one.column] = f"is a copy of {best.called}"
    return copies


def _silence(one: TitledColumn) -> tuple[bool, bool, bool, int]:
    """Return a sort key that is smaller the more a title says; among positions, strain says
    most.
    """
    rank = POSITIONS.index(one.quantity) if one.quantity in POSITIONS else 0
    return not one.quantity, not one.unit, not one.plain, rank


def _plain_names(columns: Sequence[TitledColumn]) -> dict[Column, str]:
    """Return the quantity of each column whose title identifies it, if no other title does so as
    plainly.
    """
    names: dict[Column, str] = {}
    for quantity in _KINDS:
        ranks = {one.column: _plainness(one) if one.quantity == quantity else 0 for one in columns}
        best = [column for column, rank in ranks.items() if rank == max(ranks.values()) > 0]
        if len(best) == 1:
            names[best[0]] = quantity
    if "force" not in names.values():  # testing machines call the force a load
        names = {one: "force" if name == "load" else name for one, name in names.items()}
    return names


def _plainness(one: TitledColumn) -> int:
    """Return 2 for a title that names a quantity and nothing else; 1 for a title that names it
    among other words and has a suitable unit; 0 for others, such as a letter among words, or an `x`
    without a unit.
    """
    if one.plain:
        return 0 if not one.unit and one.quantity in ("displacement", "length") else 2
    bare = read_label(_LETTER.sub("", one.title))
    return int(bool(one.unit) and bare is not None and bare.quantity == one.quantity)


# By a person
# --------------------------------------------------------------------------------------------------


def named_by_person(said: Named, table: Table, option: str, known: Named) -> Named:
    """Return the columns that a person names: by known names, by names that the person gives, or by
    titles.

    A unit that is not given is that of the title, or otherwise the model's.
    """
    columns: Named = {}
    names = {one.column: name for name, one in known.items()}
    for name, one in _each(said, table, option).items():
        is_named = option == "--columns" or not one.refers_to(name)
        wanted = known[name].column if name in known and not is_named else one.column
        titled = find(table, wanted, option)
        if not is_named:
            is_title = name in CANONICAL and name not in known and words(titled.title)[:1] == [name]
            name = name if is_title else names.get(titled.column, titled.name)
        usual = titled.as_quantity(name) if is_named else known.get(name, titled.as_quantity(name))
        chosen = one if is_named or one.unit else usual
        unit = chosen.unit or usual.unit
        sure = usual.sure or bool(one.unit) or option == "--columns"
        why = f"you; {range_of(titled.values, unit)}" if sure else usual.why
        columns[name] = replace(chosen, column=titled.column, unit=unit, sure=sure, why=why)
    return columns


def _each(said: Named, table: Table, option: str) -> Named:
    """Return the columns named by a person, with `s*` (titles) and `7..70` (numbers in the list)
    replaced by every column that they match. The time is never among them.
    """
    each: Named = {}
    titles = {one.column for one in table.values()} | {one.title for one in table.values()}
    for name, one in said.items():
        wanted, members = one.column, list[TitledColumn]()
        numbers = re.fullmatch(r"(\d+)\.\.(\d+)", str(wanted))
        if numbers is not None:
            low, high = sorted(map(int, numbers.groups()))
            members = [x for x in table.values() if x.moves and low <= x.place <= high]
        elif isinstance(wanted, str) and wanted not in titles and {*"*?"} & {*wanted}:
            likeness = re.compile(re.escape(wanted).replace(r"\*", ".*").replace(r"\?", "."), re.I)
            members = [x for x in table.values() if x.moves and likeness.fullmatch(x.called)]
        else:
            each[name] = one
            continue
        members = [x for x in members if not x.is_time]
        if not members or (one.is_called and len(members) > 1):
            several = (
                f"{len(members)} columns that move are" if members else "no column that moves is"
            )
            remedy = ", ".join(x.called for x in members or table.values() if x.values)
            raise UsageError(f"{option}: {several} called {wanted}", f"name one of {remedy}")
        for x in members:
            key = name if one.is_called else str(x.column)
            each[key] = replace(one, column=x.column)
    return each


def target_of(kinds: Mapping[str, str], is_driven: bool) -> str | None:
    """Return the quantity to predict if plain titles leave no choice, otherwise None.

    It is the only force, or else the only position if something else drives, or else the only
    column that neither drives nor is a position. `kinds` holds the results of `kind_to_predict`, by
    name; `is_driven` is True if names of files give an input.
    """
    of: dict[str, list[str]] = {}
    for name, kind in kinds.items():
        of.setdefault(kind, []).append(name)
    forces, positions, others = (of.get(kind, []) for kind in ("force", "position", ""))
    is_driven = is_driven or "drive" in of
    if "unclear" in of or len(others) > 1 or (others and (forces or positions)):
        return None
    if others:
        return others[0] if "drive" in of else None
    if forces:
        return forces[0] if len(forces) == 1 and (is_driven or positions) else None
    return positions[0] if len(positions) == 1 and is_driven else None


def kind_to_predict(name: str, titled: TitledColumn | None) -> str:
    """Return `force`, `position` or `drive` for a column whose title plainly says so; an empty text
    if the title says nothing, and `unclear` if it is ambiguous.

    A column with two values was set. Without a column, the name decides, because a person gave it.
    """
    if titled is None:
        label = read_label(name)
        quantity, is_plain = ("", True) if label is None else (label.quantity, True)
    else:
        quantity, is_plain = titled.quantity, titled.plain or titled.quantity in ("", "input")
        is_plain |= quantity == "pressure" and _NUMBERED_PRESSURE.fullmatch(name) is not None
    if not quantity and titled is not None and len(titled.kinds) == 2:
        return "drive"
    if not is_plain:
        return "unclear"
    return "drive" if quantity in ("pressure", "input") else _KINDS.get(quantity, quantity)


def refuse_choice(table: Table, where: str, path: str) -> UsageError:
    """Return the error for columns of which none is known as the quantity to predict; it lists
    them.
    """
    columns = listed(table)
    clock = next((place for place, one in columns.items() if one.may_be_clock), None)
    *drive, follow = [place for place in columns if place != clock] or [0]
    time = "" if clock is None else f",time={clock}:{unit_of_clock(columns[clock].values)}"
    how = (
        f"mapmore init {path} --target ... --inputs ...  (titles, or numbers of the list)"
        if any(one.title for one in table.values())
        else f"mapmore init {path} --target force={follow}:N --inputs "
        f"pressure={drive[-1] if drive else follow}:bar{time}  (numbers of the list)"
    )
    rows = [
        f"  {place}  {one.described}{'  rises all the time: a clock?' if place == clock else ''}"
        for place, one in columns.items()
    ]
    heading = f"{where}: titles do not say what is to be predicted. Columns that move:"
    return UsageError("\n".join([heading, *rows]), f"complete this: {how}")
