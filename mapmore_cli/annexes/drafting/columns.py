"""What a column is called and what it is for: by its title and its unit, or as a person says.

Values give facts alone: a column that never changes, a clock, a copy of another column.
"""

from __future__ import annotations

import re
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
"""What columns are called where their titles say so, and what kind of quantity that is."""
_BRACKETS = re.compile(r"[\[(]\s*([^\])]+?)\s*[\])]")
_LETTER = re.compile(r"(?<![^\W_])[A-Za-z](?![^\W_])")
_NUMBERED_PRESSURE = re.compile(r"p(?:ressure)?_?[A-Za-z0-9]", re.IGNORECASE)
_BEHIND = re.compile(r"(?:[_,/]|\bin)\s*([^\s_,/]+)$")
_NO_MEASUREMENT = {
    *("simulated", "simulation", "sim", "model", "modelled", "predicted", "prediction", "fitted"),
    *("estimated", "estimate", "theoretical", "calculated", "residual"),
}
"""Words of titles of what somebody computed."""


@dataclass(frozen=True)
class TitledColumn:
    """A column of some files, and what its title and the files say of it.

    Attributes
    ----------
    column, place
        How the spec names it, and its place in the files, from 0.
    title
        Empty where it has none.
    values
        One array `(n,)` for each file; none for a column of texts.
    quantity
        The quantity that its title names; empty for none.
    plain
        Whether nothing else stands in the title.
    unit, source
        The unit that is known, and what says it; empty for none.
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
        """One word for all positions, and for forces and loads; empty for other quantities."""
        return _KINDS.get(self.quantity, "")

    @property
    def called(self) -> str:
        """Return how messages call it."""
        return self.title or (
            self.column if isinstance(self.column, str) else f"column {self.column}"
        )

    @property
    def described(self) -> str:
        """Its name with its range, and its unit where that is known."""
        return f"{self.called}  {range_of(self.values, self.unit or '1')}"

    @property
    def name(self) -> str:
        """The name that the title gives, without its unit."""
        bare = _BRACKETS.sub(lambda match: "" if unit_of(match[1]) else match[0], self.title)
        behind = _BEHIND.search(bare)
        bare = bare[: behind.start()] if behind is not None and unit_of(behind[1]) else bare
        name = re.sub(r"\W+", "_", bare, flags=re.ASCII).strip("_")[:40]
        name = name if name[:1].isalpha() else "column"
        return name if name not in ("column", *CANONICAL) else f"{name}_{self.place}"

    @property
    def moves(self) -> bool:
        """Whether its values are not all one."""
        return len(self.values) > 0 and float(np.ptp(np.concatenate(self.values))) > 0

    @property
    def kinds(self) -> Array:
        """The values that it takes, each once (m,)."""
        return np.unique(np.concatenate(self.values)) if self.values else np.empty(0)

    @property
    def rises(self) -> bool:
        """Whether it goes on in every file, but for a few steps back."""
        return self.moves and all(
            len(one) > 1 and np.ptp(one) > 0 and np.mean(np.diff(one) < 0) <= MOST_GLITCHES
            for one in self.values
        )

    @property
    def counts(self) -> bool:
        """Whether it goes up by one from row to row."""
        return all(len(one) > 1 and (np.diff(one) == 1).all() for one in self.values)

    def is_time(self, is_titled: bool) -> bool:
        """Return whether title or unit say that it is the time; without titles, any may be."""
        by_unit = not self.quantity and bool(unit_of(self.unit, "s"))
        return not is_titled or self.quantity == "time" or by_unit

    def as_quantity(self, name: str) -> NamedColumn:
        """Return the column as a quantity, in the unit that the title or the file says.

        A canonical quantity without a unit is in the model's, which is a question.
        """
        if self.unit or name not in CANONICAL:
            why = f"{self.source or 'title'}; {range_of(self.values, self.unit or '1')}"
            return NamedColumn(self.column, self.unit or "1", why)
        usual = default_unit(name) if name != "time" else _unit_of_clock(self.values)
        if usual == "1":
            return NamedColumn(self.column, usual, f"title; {range_of(self.values)}")
        reason = "its title says no unit" if self.title else "it rises all the time"
        why = f"{reason}: is it {usual}? {range_of(self.values)}"
        return NamedColumn(self.column, usual, why, sure=False)


Table = Mapping[Column, TitledColumn]
"""All columns of some files, in their order."""


def read_titles(layout: Preview, raw: Raw) -> Table:
    """Return the columns of files, with what their titles and the files' own units say."""
    texts = zip_longest(layout.columns, layout.titles, layout.units, fillvalue="")
    return {
        column: _read_title(column, place, title, raw.get(column, ()), unit)
        for place, (column, title, unit) in enumerate(texts)
    }


def _read_title(
    column: Column, place: int, title: str, values: Sequence[Array], line: str
) -> TitledColumn:
    """Return a column whose title names no quantity where its unit is one of something else, as
    volts of a force.
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
    """Return the column of a place, a title, or a word that one title alone has.

    Raises UsageError, which lists the columns, for what is none, or several.
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
            f"{option}: {problem} called {wanted}", f"say one of {several}, or its place"
        )
    return near[0]


def listed(table: Table, but: Iterable[Column] = ()) -> dict[int, TitledColumn]:
    """Return the columns that move, by the numbers that lists show and people say."""
    return {one.place: one for one in table.values() if one.moves and one.column not in {*but}}


def words(text: str) -> list[str]:
    """Return the words and numbers of a text in small letters."""
    return [word.casefold() for word in re.findall(r"[^\W\d_]+|\d+", text)]


def _unit_of_clock(values: Sequence[Array]) -> str:
    """Return ms for whole numbers that go on by 1 to 100 a step, else s: a suggestion."""
    steps = np.diff(max(values, key=len))
    step = float(np.median(steps)) if steps.size else 0.0
    is_whole = all((one == np.round(one)).all() for one in values)
    return "ms" if is_whole and 1 <= step <= 100 else "s"


# By titles
# --------------------------------------------------------------------------------------------------


Known = tuple[Named, dict[Column, str]]
"""The columns by their names, the clock first; and why others are left out."""


def known_by_titles(table: Table) -> Known:
    """Return the columns that move, by quantity where titles name one, else by their titles.

    Where several titles name one quantity, each keeps its title, but for the plain one. A copy of
    another column, what was computed by a model, and what goes on like a clock and is not the time
    are left out.
    """
    is_titled = any(one.title for one in table.values())
    clock = next((one for one in table.values() if one.rises and one.is_time(is_titled)), None)
    rest = [one for one in table.values() if one is not clock]
    left_out = {one.column: why for one in rest if (why := _why_unused(one, clock is not None))}
    left_out |= _copies([one for one in rest if one.column not in left_out])
    kept = [one for one in rest if one.column not in left_out]
    quantities = _plain_names(kept)
    columns = {} if clock is None else {"time": clock.as_quantity("time")}
    for one in kept:
        name = quantities.get(one.column, one.name)
        name = f"column_{one.place}" if name in {*columns, "time"} else name
        columns[name] = one.as_quantity(name)
    return columns, left_out


def _why_unused(one: TitledColumn, has_clock: bool) -> str:
    """Return why a column is no quantity of the study; empty where it may be one."""
    if not one.values:
        return "holds no numbers"
    if not one.moves:
        return "never changes"
    if one.quantity == "time":
        return "is a second clock" if has_clock else "its clock is set back"
    if _NO_MEASUREMENT & {*words(one.title)}:
        return "was computed, as its title says"
    return "counts its rows" if not one.quantity and one.counts else ""


def _copies(columns: Sequence[TitledColumn]) -> dict[Column, str]:
    """Return what is a copy of which column: the one whose title and unit say more is kept."""
    copies: dict[Column, str] = {}
    for family in same_signals([np.concatenate(one.values) for one in columns]):
        members = [columns[place] for place in family]
        best = min(members, key=_silence)
        for one in members:
            if one is not best and one.kind in ("", best.kind):
                copies[one.column] = f"is a copy of {best.called}"
    return copies


def _silence(one: TitledColumn) -> tuple[bool, bool, bool, int]:
    """Return a key that is smaller the more a title says; of positions, strain says most."""
    rank = POSITIONS.index(one.quantity) if one.quantity in POSITIONS else 0
    return not one.quantity, not one.unit, not one.plain, rank


def _plain_names(columns: Sequence[TitledColumn]) -> dict[Column, str]:
    """Return the quantity of each column whose title says it, where no other says it as plainly."""
    names: dict[Column, str] = {}
    for quantity in _KINDS:
        ranks = {one.column: _plainness(one) if one.quantity == quantity else 0 for one in columns}
        best = [column for column, rank in ranks.items() if rank == max(ranks.values()) > 0]
        if len(best) == 1:
            names[best[0]] = quantity
    if "force" not in names.values():  # testers call the force a load
        names = {one: "force" if name == "load" else name for one, name in names.items()}
    return names


def _plainness(one: TitledColumn) -> int:
    """Return 2 for a title that names a quantity and nothing else, 1 for one that names it among
    other words and has a unit of it; 0 for others, as a letter among words, or an `x` without unit.
    """
    if one.plain:
        return 0 if not one.unit and one.quantity in ("displacement", "length") else 2
    bare = read_label(_LETTER.sub("", one.title))
    return int(bool(one.unit) and bare is not None and bare.quantity == one.quantity)


# By a person
# --------------------------------------------------------------------------------------------------


def named_by_person(said: Named, table: Table, option: str, known: Named) -> Named:
    """Return the columns that a person names, by the names that they have already, by those that
    the person gives, or by their titles.

    A unit that was not said is that of the title, else the model's.
    """
    columns: Named = {}
    names = {one.column: name for name, one in known.items()}
    for name, one in said.items():
        is_named = option == "--columns" or not one.refers_to(name)
        wanted = known[name].column if name in known and not is_named else one.column
        titled = find(table, wanted, option)
        name = name if is_named else names.get(titled.column, titled.name)
        usual = titled.as_quantity(name) if is_named else known.get(name, titled.as_quantity(name))
        chosen = one if is_named or one.unit else usual
        unit = chosen.unit or usual.unit
        sure = usual.sure or bool(one.unit) or option == "--columns"
        why = f"you; {range_of(titled.values, unit)}" if sure else usual.why
        columns[name] = replace(chosen, column=titled.column, unit=unit, sure=sure, why=why)
    return columns


def target_of(kinds: Mapping[str, str], is_driven: bool) -> str | None:
    """Return what is to be predicted where plain titles leave no choice; None where they do.

    It is the one force, else the one position that something drives, else the one column that
    neither drives nor is a position. `kinds` are those of `kind_to_predict`, by name; `is_driven`
    says that names of files tell what drives.
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
    """Return `force`, `position` or `drive` for a column whose title says this plainly; empty where
    it says nothing, and `unclear` where it says more.

    What takes two values was set. Without a column, the name decides: a person gave it.
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
    """Return the error for columns of which nobody says what is to be predicted: it lists them."""
    *drive, follow = [*listed(table)] or [0]
    how = (
        f"mapmore init {path} --target ... --inputs ...  (titles, or numbers of the list)"
        if any(one.title for one in table.values())
        else f"mapmore init {path} --target force={follow}:N --inputs "
        f"pressure={drive[-1] if drive else follow}:bar  (numbers of the list)"
    )
    rows = [f"  {place}  {one.described}" for place, one in listed(table).items()]
    heading = f"{where}: titles do not say what is to be predicted. Columns that move:"
    return UsageError("\n".join([heading, *rows]), f"complete this: {how}")
