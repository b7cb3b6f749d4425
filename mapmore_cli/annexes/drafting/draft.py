"""Represent a spec that is being drafted, and write it as YAML with comments that give the
reasons.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.foreign import printable
from mapmore_cli.study.loader import MODELINE, SCHEMA
from mapmore_cli.study.variables import escaped
from mapmore_cli.study.yaml_dumper import dump

HEAD = (
    "# Started by `mapmore init`. Look first at what is marked CHECK, "
    "then run `mapmore check` on this file."
)
WIDEST = 132
_BLOCKS = {("data",), ("data", "columns")}
_ORDER = ("extends", "schema_version", "name", "muscle", "data", "units", "target")

Column = str | int
"""Name of a column in a spec: its title, its address, or its index."""

Raw = Mapping[Column, Sequence[Array]]
"""Values of every column, one array `(n,)` for each file."""

Conditions = Mapping[str, Sequence[float]]
"""Values of quantities in the names of files, one for each recording."""

Loc = tuple[str | int, ...]
Section = dict[str, Any]
"""A spec or a section of it, as in YAML."""


def address(text: str) -> Column:
    """Return the column that a person writes: the index if the text is a whole number, otherwise
    the text, which is a title or a name.
    """
    return int(text) if text.isdecimal() else text


@dataclass(frozen=True)
class NamedColumn:
    """The column of a quantity, its unit, and the reason for the choice, for example its title.

    The quantity is `value * scale + offset` in `unit`, which is empty if a person named the column
    without a unit. `is_called` is True if a person gave the quantity its name. `parts` holds the
    columns of a clock in parts, and their units. `texts` is True if the cells are texts, which are
    then numbered, and `down` if a text also applies to the empty cells below it.
    """

    column: Column
    unit: str = ""
    why: str = "you"
    sure: bool = True
    scale: float = 1.0
    offset: float = 0.0
    is_called: bool = field(default=False, compare=False)
    parts: dict[Column, str] = field(default_factory=dict)
    texts: bool | str = False

    def refers_to(self, name: str) -> bool:
        """Return True if `name` is the title or the index of the column, and no person gave the
        quantity another name.
        """
        return not self.is_called and self.column in (name, address(name))

    @property
    def places(self) -> set[Column]:
        """The columns of a file that are read for the quantity: one, or several for a clock in
        parts.
        """
        return {*self.parts} or {self.column}

    def as_spec(self) -> Section:
        """Return the entry of `columns` in a spec that describes this column."""
        if self.parts:
            return {"columns": [*self.parts], "format": " ".join(self.parts.values())}
        # with `%` in the title, `check` would expect per cent if the unit 1 were not written
        plain_units = ("",) if "%" in str(self.column) else ("", "1")
        usual = {"unit": plain_units, "scale": (1.0,), "offset": (0.0,), "texts": (False,)}
        entry = {key: getattr(self, key) for key in usual}
        changed = {key: value for key, value in entry.items() if value not in usual[key]}
        return {"column": self.column, **changed}


Named = dict[str, NamedColumn]
"""Columns by the names of their quantities."""


@dataclass(frozen=True)
class Note:
    """Reason for an entry of the draft. If the entry is not `sure`, it is marked with `CHECK`, so
    that the user confirms it.
    """

    why: str
    sure: bool = True

    def __str__(self) -> str:
        # titles may contain control characters and line breaks
        why = " ".join(printable(self.why).split())
        return f"# {'' if self.sure else 'CHECK: '}{why}"


@dataclass(frozen=True)
class Draft:
    """A draft of a spec: its sections in the form of the YAML file, with numbers in the model's
    units, and the reasons for the choices.

    `files` is the number of files with recordings, and `raw` has the values of all columns in some
    of them. If the draft is for one of several outputs of a study, `of` is the name of the study.
    `tips` are further options that a person may give, with the reasons; they are printed, and
    written at the beginning of the file.
    """

    spec: Section
    notes: dict[Loc, Note] = field(default_factory=dict)
    files: int = field(default=0, compare=False)
    raw: Raw = field(default_factory=dict, repr=False, compare=False)
    of: str = ""
    tips: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name of the study."""
        return str(self.spec["name"])

    @property
    def data(self) -> Section:
        """The `data` section."""
        section: Section = self.spec["data"]
        return section

    @property
    def output(self) -> str:
        """Quantity that the model predicts."""
        target = str(self.spec["target"])
        return "force" if target == "static" else target

    @property
    def open(self) -> dict[Loc, Note]:
        """Entries of the draft that are not certain."""
        return {loc: note for loc, note in self.notes.items() if not note.sure}

    @property
    def bad_files(self) -> str:
        """Files that are left out, with the reasons; empty if there are none."""
        note = self.notes.get(("data", "skip_bad_files"))
        return "" if note is None or note.sure else note.why

    def with_data(
        self, key: str, value: object, why: str | None = None, sure: bool = True
    ) -> Draft:
        """Return the draft with a key of `data` added or replaced."""
        return replace(self, spec={**self.spec, "data": {**self.data, key: value}}).noted(
            ("data", key), why, sure
        )

    def with_section(self, key: str, value: object, why: str | None = None) -> Draft:
        """Return the draft with a section added or replaced."""
        return replace(self, spec={**self.spec, key: value}).noted((key,), why)

    def without_data(self, key: str) -> Draft:
        """Return the draft without a key of `data`, and without the notes about this key."""
        data = {name: value for name, value in self.data.items() if name != key}
        notes = {loc: note for loc, note in self.notes.items() if loc[:2] != ("data", key)}
        return replace(self, spec={**self.spec, "data": data}, notes=notes)

    def noted(self, loc: Loc, why: str | None, sure: bool = True) -> Draft:
        """Return the draft with a note about the entry at `loc`. If `why` is None, the draft is
        unchanged.
        """
        return self if why is None else replace(self, notes={**self.notes, loc: Note(why, sure)})

    def text(self) -> str:
        """Return the draft as YAML, with its notes."""
        tips = (line for tip in self.tips for line in _wrapped(Note(tip, sure=False), ""))
        head = "\n".join([f"{MODELINE}{SCHEMA}", HEAD, *tips])
        return yaml_text(self.spec, self.notes, head)


def yaml_text(spec: Mapping[str, Any], notes: Mapping[Loc, Note], head: str) -> str:
    """Return a spec as YAML with notes, below the lines in `head`."""
    ordered = {key: _ten_digits(spec[key]) for key in (*_ORDER, *spec) if key in spec}
    return "\n".join([head, *_yaml_lines(escaped(ordered), (), notes), ""])


def _ten_digits(value: object) -> object:
    """Return a value in which all numbers are rounded to ten significant digits. Whole numbers have
    no decimal point.
    """
    match value:
        case dict():
            return {key: _ten_digits(member) for key, member in value.items()}
        case list():
            return [*map(_ten_digits, value)]
        case float():
            short = float(f"{value:.10g}")
            return int(short) if short.is_integer() else short
    return value


def _yaml_lines(section: Mapping[str, Any], loc: Loc, notes: Mapping[Loc, Note]) -> Iterator[str]:
    """Yield the lines of a section. In `data` and its columns, each key can have a note."""
    margin = "  " * len(loc)
    for key, value in section.items():
        here = (*loc, key)
        is_block = here in _BLOCKS and value
        first, *rest = [f"{key}:"] if is_block else dump({key: value}).splitlines()
        yield from _noted(margin + first, notes.get(here))
        yield from _yaml_lines(value, here, notes) if is_block else (margin + line for line in rest)


def _noted(line: str, note: Note | None) -> list[str]:
    """Return a line with its note. The note follows the line, or stands above it if both are too
    long for one line.
    """
    if note is None:
        return [line]
    if len(line) + len(str(note)) + 2 <= WIDEST:
        return [f"{line}  {note}"]
    return [*_wrapped(note, " " * (len(line) - len(line.lstrip()))), line]


def _wrapped(note: Note, margin: str) -> list[str]:
    """Return the lines of a note, each preceded by a margin."""
    return textwrap.wrap(str(note), WIDEST, initial_indent=margin, subsequent_indent=f"{margin}# ")


def range_of(values: Sequence[Array], unit: str = "1") -> str:
    """Return a text with the smallest and the largest of some values."""
    low, high = min(x.min() for x in values), max(x.max() for x in values)
    return f"{low:.4g} to {high:.4g}{'' if unit == '1' else f' {unit}'}"


def scaled(values: Array) -> Array:
    """Return values scaled to 0 to 1; zeros if all values are equal."""
    return np.asarray((values - values.min()) / (float(np.ptp(values)) or 1.0))
