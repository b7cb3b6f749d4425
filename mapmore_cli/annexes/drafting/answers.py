"""What a person says of a folder: on the line (`--columns ...`), or when asked."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from mapmore_cli.annexes.drafting.columns import TitledColumns
from mapmore_cli.annexes.drafting.draft import Column, Draft, NamedColumn, Note, range_of
from mapmore_cli.annexes.drafting.groups import Group
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import SpecError, UsageError
from mapmore_cli.spec.units import CANONICAL, check_unit, convert

FORM = (
    'write `--columns "time:ms,_,pressure:bar,force:N"` by place, or `name=title:unit`; `_` '
    "leaves a column out"
)
_QUANTITY = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_NUMBER = r"\d+(?:\.\d+)?(?:[eE][+-]?\d+)?"
_UNIT = re.compile(
    rf"(?P<unit>.*?)(?:\*(?P<scale>[+-]?{_NUMBER}))?(?P<offset>[+-]{_NUMBER})?", re.DOTALL
)
WIDTH = 40  # characters of a course
BLOCKS = "▁▂▃▄▅▆▇█"


@dataclass(frozen=True)
class Answers:
    """What a person has said; None and empty where nothing is said.

    Attributes
    ----------
    columns
        All columns that are used, by quantity. Where some are named, no other is used.
    target
        The quantity to predict.
    hold
        The quantity that was held, and the unit of its numbers in names of files; `none` says that
        nothing was.
    group
        What the words of names tell apart, which else are studies of their own: files are one
        study, and the quantity of that name numbers its groups; `none` pools them.
    length
        Of the muscle, m.
    """

    columns: Mapping[str, NamedColumn] = field(default_factory=dict)
    target: str | None = None
    hold: tuple[str, str] | None = None
    group: str | None = None
    length: float | None = None

    def about(self, group: Group) -> dict[str, NamedColumn]:
        """Return the columns that files have, of those that were said; none by their places where
        the files have fewer.
        """
        here, width = group.layout.columns, group.layout.width
        places = [one.column for one in self.columns.values() if isinstance(one.column, int)]
        return {
            name: replace(told, column=here[told.column]) if isinstance(told.column, int) else told
            for name, told in self.columns.items()
            if told.column in here or (isinstance(told.column, int) and max(places) < width)
        }


NOTHING_SAID = Answers()


def read_columns(text: str) -> dict[str, NamedColumn]:
    """Read `time:ms,_,force:N` by place, or `force=Load:N` by title or place; UsageError for what
    is neither.
    """
    told: dict[str, NamedColumn] = {}
    for place, entry in enumerate(one.strip() for one in text.split(",")):
        if entry in ("", "_", "-"):
            continue
        name, equals, rest = entry.partition("=")
        where, _, unit = rest.rpartition(":") if equals and ":" in rest else (rest, "", "")
        if not equals:
            name, _, unit = entry.partition(":")
        name = name.strip()
        if name in told:
            raise UsageError(
                f"--columns: {name} is said twice",
                "give each column a name of its own, as `p1` and `p2`",
            )
        column: Column = place
        if equals:
            column = int(where) if where.strip().isdigit() else where.strip()
        told[name] = _told_column("--columns", name, column, unit)
    if len(told.keys() - {"time"}) < 2:
        raise UsageError(
            "--columns: two columns are needed, one that drives and one that follows", FORM
        )
    return told


def read_hold(text: str) -> tuple[str, str]:
    """Read `strain`, `strain:%` or `none`; UsageError for what is no quantity with a unit."""
    name, _, unit = text.partition(":")
    held = _told_column("--hold", name.strip(), 0, unit)
    return name.strip(), held.unit


def _told_column(option: str, name: str, column: Column, text: str) -> NamedColumn:
    """Return the column in a unit such as `bar`, `N*1.744-18.6` (scale and offset) or ``;
    UsageError for a unit that cannot be.
    """
    if not _QUANTITY.fullmatch(name):
        raise UsageError(f"{option}: {name[:40]!r} is no name of a quantity", FORM)
    match = _UNIT.fullmatch(text.strip())
    assert match is not None  # everything matches
    try:
        if match["unit"]:
            check_unit(match["unit"])
            convert(1.0, match["unit"], CANONICAL.get(name, match["unit"]))
    except SpecError as fault:
        raise UsageError(f"{option}: {name}: {fault.message}", fault.remedy or FORM) from fault
    return NamedColumn(
        column, match["unit"], scale=float(match["scale"] or 1), offset=float(match["offset"] or 0)
    )


# Questions
# --------------------------------------------------------------------------------------------------

Ask = Callable[["Question"], str]
"""Returns what a person answers; it is asked again where the answer cannot be."""


@dataclass(frozen=True)
class Option:
    """An answer or a column: its `text`, what is known of it, and its course."""

    text: str
    why: str = ""
    course: str = ""


@dataclass(frozen=True)
class Question:
    """One thing that the data cannot tell: `form` says how to answer, and `check` raises UsageError
    for an answer that cannot be.
    """

    text: str
    options: tuple[Option, ...]
    form: str
    check: Callable[[str], object]


def course(values: Sequence[Array]) -> str:
    """Return a column over its samples, 40 characters wide, of all recordings one after the
    other.
    """
    pooled = np.concatenate(values)
    places = np.linspace(0, len(pooled) - 1, min(WIDTH, len(pooled))).astype(int)
    shares = (pooled[places] - pooled.min()) / (float(np.ptp(pooled)) or 1.0)
    return "".join(BLOCKS[int((len(BLOCKS) - 1) * share + 0.5)] for share in shares.tolist())


def asked_columns(table: TitledColumns, ask: Ask) -> dict[str, NamedColumn]:
    """Ask which columns are used, and what they are."""

    def read(reply: str) -> dict[str, NamedColumn]:
        columns = read_columns(reply)
        for told in columns.values():
            if told.column not in table.raw:
                raise UsageError(
                    f"there is no column {told.column} of numbers",
                    f"name some of {', '.join(map(str, table.raw))}",
                )
        return columns

    options = tuple(
        Option(f"column {column}", range_of(values), course(values))
        for column, values in table.raw.items()
    )
    form = "NAME=COLUMN:UNIT of each that is used, as time=0:s,pressure=4:psi,angle=2"
    return read(ask(Question("Which columns are used, and what are they?", options, form, read)))


def asked_target(names: Sequence[str], ask: Ask) -> str:
    """Ask which of the names is to be predicted."""

    def read(reply: str) -> str:
        reply = reply.strip()
        if reply.isdigit() and 1 <= int(reply) <= len(names):
            return names[int(reply) - 1]
        if reply not in names:
            raise UsageError(f"{reply!r} is none of them", f"say one of {', '.join(names)}")
        return reply

    options = tuple(map(Option, names))
    return read(ask(Question("What is to be predicted?", options, "a number or a name", read)))


def asked_rest(draft: Draft, ask: Ask) -> Draft:
    """Ask once whether what is open is right; where it is, the marks go."""
    if not draft.open:
        return draft
    options = tuple(Option(".".join(map(str, loc)), note.why) for loc, note in draft.open.items())
    question = Question("Is this right?", options, "Enter for yes, else no: it stays marked", _yes)
    if not _yes(ask(question)):
        return draft
    return replace(draft, notes={loc: Note(note.why) for loc, note in draft.notes.items()})


def _yes(reply: str) -> bool:
    reply = reply.strip().casefold()
    if reply not in ("", "y", "n", "yes", "no"):
        raise UsageError(f"{reply!r} is neither yes nor no", "say yes or no")
    return reply in ("", "y", "yes")
