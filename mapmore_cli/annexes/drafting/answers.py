"""What a person says of a folder: on the line (`--columns ...`), or when asked."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from mapmore_cli.annexes.drafting.draft import Column, Draft, Guess, Note
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
MOST_OPTIONS = 4
MOST_COLUMNS = 7  # questions about columns; two more are about the rest
BLOCKS = "▁▂▃▄▅▆▇█"


@dataclass(frozen=True)
class Answers:
    """What is known before anything is guessed; None and empty where nothing is said.

    Attributes
    ----------
    columns
        All columns that are used, by quantity. Where some are named, no other is guessed.
    target, hold
        The quantity to predict, and the one that was held; `none` says that nothing was.
    group
        What the words of names tell apart, which else are studies of their own: files are one
        study, and the quantity of that name numbers its groups; `none` pools them.
    length
        Of the muscle, m.
    """

    columns: Mapping[str, Guess] = field(default_factory=dict)
    target: str | None = None
    hold: str | None = None
    group: str | None = None
    length: float | None = None

    def for_columns(self, columns: Sequence[Column], width: int) -> Answers | None:
        """Return the answers about a table with these columns; None where it has none of them."""
        fits = all(
            told.column < width for told in self.columns.values() if isinstance(told.column, int)
        )
        found = {}
        for name, told in self.columns.items():
            if isinstance(told.column, int) and fits:
                found[name] = replace(told, column=columns[told.column])
            elif isinstance(told.column, str) and told.column in columns:
                found[name] = told
        return replace(self, columns=found) if found or not self.columns else None


NOTHING_SAID = Answers()


def read_columns(text: str) -> dict[str, Guess]:
    """Read `time:ms,_,force:N` by place, or `force=Load:N` by title or place; UsageError for what
    is neither.
    """
    found: dict[str, Guess] = {}
    for place, entry in enumerate(one.strip() for one in text.split(",")):
        if entry in ("", "_", "-"):
            continue
        name, equals, rest = entry.partition("=")
        where, _, unit = rest.rpartition(":") if equals and ":" in rest else (rest, "", "")
        if not equals:
            name, _, unit = entry.partition(":")
        name = name.strip()
        if not _QUANTITY.fullmatch(name):
            raise UsageError(f"--columns: {name[:40]!r} is no name of a quantity", FORM)
        if name in found:
            raise UsageError(
                f"--columns: {name} is said twice",
                "give each column a name of its own, as `p1` and `p2`",
            )
        found[name] = _told_column(name, _place_or_title(where) if equals else place, unit)
    if len(found.keys() - {"time"}) < 2:
        raise UsageError(
            "--columns: two columns are needed, one that drives and one that follows", FORM
        )
    return found


def _place_or_title(text: str) -> Column:
    return int(text) if text.strip().isdigit() else text.strip()


def _told_column(name: str, column: Column, text: str) -> Guess:
    """Return the column in a unit such as `bar`, `N*1.744-18.6` (scale and offset) or ``;
    UsageError for a unit that cannot be.
    """
    match = _UNIT.fullmatch(text.strip())
    assert match is not None  # everything matches
    try:
        if match["unit"]:
            check_unit(match["unit"])
            convert(1.0, match["unit"], CANONICAL.get(name, match["unit"]))
    except SpecError as fault:
        raise UsageError(f"--columns: {name}: {fault.message}", fault.remedy or FORM) from fault
    return Guess(
        column, match["unit"], scale=float(match["scale"] or 1), offset=float(match["offset"] or 0)
    )


# Questions
# --------------------------------------------------------------------------------------------------

Ask = Callable[["Question"], str]
"""Returns what a person answers: the empty text takes the first option. It is asked again where the
answer cannot be.
"""


@dataclass(frozen=True)
class Option:
    """An answer: its `text`, what speaks for it, and the course of its column."""

    text: str
    why: str
    course: str = ""


@dataclass(frozen=True)
class Question:
    """One thing that the data cannot tell; `check` raises UsageError for an answer that cannot
    be.
    """

    text: str
    options: tuple[Option, ...]
    form: str = ""
    check: Callable[[str], object] = lambda _: None


def course(values: Sequence[Array]) -> str:
    """Return a column over its samples, 40 characters wide, of all recordings one after the
    other.
    """
    pooled = np.concatenate(values)
    places = np.linspace(0, len(pooled) - 1, min(WIDTH, len(pooled))).astype(int)
    low, span = float(pooled.min()), float(np.ptp(pooled)) or 1.0
    return "".join(
        BLOCKS[int((len(BLOCKS) - 1) * (float(value) - low) / span + 0.5)]
        for value in pooled[places]
    )


def asked_columns(draft: Draft, said: Answers, ask: Ask) -> Answers:
    """Ask for every column that is not sure; the answers name all columns of the draft."""
    found: dict[str, Guess] = {}
    asked = 0
    for name, entry in draft.data["columns"].items():
        column = Guess.of_spec(entry)
        note = draft.open.get(("data", "columns", name))
        if note is None or asked == MOST_COLUMNS:
            found[name] = column
            continue
        asked += 1
        rivals = [
            (Guess.of_spec(rival.as_spec()), rival.why) for rival in draft.rivals.get(name, ())
        ]
        options = [(column, note.why), *rivals][:MOST_OPTIONS]
        is_target = draft.spec["target"] == {"column": name}
        read = partial(_read, name=name, options=[one for one, _ in options], draft=draft)
        question = Question(
            "What is to be predicted?" if is_target else f"Which column is the {name}?",
            tuple(
                Option(_shown(name, one), why, course(draft.raw[one.column]))
                for one, why in options
            ),
            "a number of the list, COLUMN:UNIT, NAME=COLUMN:UNIT, or - for none",
            read,
        )
        answer = read(ask(question))
        if answer is not None:
            own, told = answer
            found[own] = told
            if own != name and (said.target == name if said.target else is_target):
                said = replace(said, target=own)
    joined = [name for log in draft.data.get("join", ()) for name in log["columns"]]
    return (
        replace(said, columns=found)
        if found.keys() - {"time"} and not (joined and len(found) == len(joined))
        else said
    )


def asked_length(draft: Draft, ask: Ask) -> str:
    """Ask for the length of the muscle, where names say by how many millimetres it was shortened;
    the empty text where it is unknown.
    """
    if not any("say --length" in note.why for note in draft.notes.values()):
        return ""
    why = "the names say by how much it was shortened; with its length that is a strain"
    return ask(
        Question("How long is the muscle?", (Option("unknown", why),), "a length, as 228mm")
    ).strip()


def asked_rest(draft: Draft, ask: Ask) -> Draft:
    """Ask once whether what else is open is right; where it is, the marks go."""
    if not draft.open:
        return draft
    options = (Option("yes", "all of them are right"), Option("no", "they stay marked CHECK"))
    listed = "".join(
        f"\n  - {'.'.join(map(str, loc))}: {note.why}" for loc, note in draft.open.items()
    )
    if _is_yes(ask(Question(f"Are these guesses right?{listed}", options, "yes or no", _is_yes))):
        return replace(draft, notes={loc: Note(note.why) for loc, note in draft.notes.items()})
    return draft


def _is_yes(reply: str) -> bool:
    reply = reply.strip().casefold()
    if reply not in ("", "1", "2", "y", "n", "yes", "no"):
        raise UsageError(f"{reply!r} is neither yes nor no", "say yes or no")
    return reply in ("", "1", "y", "yes")


def _shown(name: str, told: Guess) -> str:
    return f"{name}={told.column}" + (f":{told.unit}" if told.unit else "")


def _read(
    reply: str, name: str, options: Sequence[Guess], draft: Draft
) -> tuple[str, Guess] | None:
    """Return the name and the column that an answer says; None for `-`. Raises UsageError for no
    such column, or a unit that cannot be.
    """
    reply = reply.strip()
    if not reply:
        return name, options[0]
    if reply == "-":
        return None
    if reply.isdigit() and 1 <= int(reply) <= len(options):
        return name, options[int(reply) - 1]
    own, equals, rest = reply.rpartition("=")
    where, _, unit = rest.partition(":")
    own = own.strip() if equals else name
    if not _QUANTITY.fullmatch(own):
        raise UsageError(f"{own!r} is no name of a quantity", "use letters, digits and _")
    column = _place_or_title(where)
    if column not in draft.raw:
        raise UsageError(
            f"there is no column {column} of numbers",
            f"name one of {', '.join(map(str, draft.raw))}",
        )
    return own, _told_column(own, column, unit)
