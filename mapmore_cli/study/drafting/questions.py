"""What a person is asked of a folder."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.study.drafting.answers import Answers, ToldColumn, told_column
from mapmore_cli.study.drafting.columns import Guess
from mapmore_cli.study.drafting.draft import Draft, Note

WIDTH = 40  # characters of a course
MOST_OPTIONS = 4
MOST_COLUMNS = 7  # questions about columns; two more are about the rest
BLOCKS = "▁▂▃▄▅▆▇█"

Ask = Callable[["Question"], str]
"""Returns what a person answers: the empty text takes the first option. It is asked again where the answer cannot be."""


@dataclass(frozen=True)
class Option:
    """An answer: its `text`, what speaks for it, and the course of its column."""

    text: str
    why: str
    course: str = ""


@dataclass(frozen=True)
class Question:
    """One thing that the data cannot tell; `check` raises UsageError for an answer that cannot be."""

    text: str
    options: tuple[Option, ...]
    form: str = ""
    check: Callable[[str], object] = lambda _: None


def course(values: Sequence[Array]) -> str:
    """Return a column over its samples, 40 characters wide, of all recordings one after the other."""
    pooled = np.concatenate(values)
    places = np.linspace(0, len(pooled) - 1, min(WIDTH, len(pooled))).astype(int)
    low, span = float(pooled.min()), float(np.ptp(pooled)) or 1.0
    return "".join(BLOCKS[int((len(BLOCKS) - 1) * (float(value) - low) / span + 0.5)] for value in pooled[places])


def asked_columns(draft: Draft, said: Answers, ask: Ask) -> Answers:
    """Ask for every column that is not sure; the answers name all columns of the draft."""
    told = {name: _as_told(entry) for name, entry in draft.data["columns"].items()}
    found: dict[str, ToldColumn] = {}
    asked = 0
    target = draft.spec["target"]
    for name, column in told.items():
        note = draft.notes.get(("data", "columns", name))
        if note is None or note.sure or asked == MOST_COLUMNS:
            found[name] = column
            continue
        asked += 1
        options = [(column, note.why), *((_of_guess(one), one.why) for one in draft.rivals.get(name, ()))][:MOST_OPTIONS]
        what = "What is to be predicted" if isinstance(target, dict) and target["column"] == name else f"Which column is the {name}"
        question = Question(
            f"{what}?",
            tuple(Option(_shown(name, one), why, course(draft.raw[one.column])) for one, why in options),
            "a number of the list, COLUMN:UNIT, NAME=COLUMN:UNIT, or - for none",
            lambda reply, options=options, name=name: _read(reply, name, options, draft),  # type: ignore[misc]
        )
        answer = _read(ask(question), name, options, draft)
        if answer is not None:
            own, one = answer
            found[own] = one
            told_target = said.target or (target["column"] if isinstance(target, dict) else None)
            said = replace(said, target=own) if told_target == name and own != name else said
    joined = [name for log in draft.data.get("join", ()) for name in log["columns"]]
    return replace(said, columns=found) if found.keys() - {"time"} and not (joined and len(found) == len(joined)) else said


def asked_rest(draft: Draft, ask: Ask) -> Draft:
    """Ask once whether what else is open is right; where it is, the marks go."""
    open_ = {loc: note for loc, note in draft.notes.items() if not note.sure}
    if not open_:
        return draft
    options = (Option("yes", "all of them are right"), Option("no", "they stay marked CHECK"))
    listed = "".join(f"\n  - {'.'.join(map(str, loc))}: {note.why}" for loc, note in open_.items())
    if ask(Question(f"Are these guesses right?{listed}", options, "yes or no", _yes_or_no)).strip().casefold() in ("", "1", "y", "yes"):
        return replace(draft, notes={loc: Note(note.why) for loc, note in draft.notes.items()})
    return draft


def asked_length(draft: Draft, ask: Ask) -> str:
    """Ask for the length of the muscle, where names say by how many millimetres it was shortened; the empty text where it is unknown."""
    if not any("say --length" in note.why for note in draft.notes.values()):
        return ""
    why = "the names say by how much it was shortened; with its length that is a strain"
    return ask(Question("How long is the muscle?", (Option("unknown", why),), "a length, as 228mm")).strip()


def _yes_or_no(reply: str) -> None:
    if reply.strip().casefold() not in ("", "1", "2", "y", "n", "yes", "no"):
        raise UsageError(f"{reply!r} is neither yes nor no", "say yes or no")


def _as_told(entry: Mapping[str, str | int | float]) -> ToldColumn:
    column = entry["column"]
    assert isinstance(column, str | int)
    unit = str(entry["unit"]) if "unit" in entry else None
    return ToldColumn(column, unit, float(entry.get("scale", 1)), float(entry.get("offset", 0)))


def _of_guess(guess: Guess) -> ToldColumn:
    return ToldColumn(guess.column, None if guess.unit == "1" else guess.unit, guess.scale, guess.offset)


def _shown(name: str, told: ToldColumn) -> str:
    return f"{name}={told.column}" + (f":{told.unit}" if told.unit else "")


def _read(reply: str, name: str, options: Sequence[tuple[ToldColumn, str]], draft: Draft) -> tuple[str, ToldColumn] | None:
    """Return the name and the column that an answer says; None for `-`. Raises UsageError for no such column, or a unit that cannot be."""
    reply = reply.strip()
    if not reply:
        return name, options[0][0]
    if reply == "-":
        return None
    if reply.isdigit() and 1 <= int(reply) <= len(options):
        return name, options[int(reply) - 1][0]
    own, equals, rest = reply.rpartition("=") if "=" in reply else ("", "", reply)
    where, _, unit = rest.partition(":")
    own = own.strip() if equals else name
    if not re.fullmatch(r"[A-Za-z_]\w*", own, re.ASCII):
        raise UsageError(f"{own!r} is no name of a quantity", "use letters, digits and _")
    column: str | int = int(where) if where.strip().isdigit() else where.strip()
    if column not in draft.raw:
        raise UsageError(f"there is no column {column} of numbers", f"name one of {', '.join(map(str, draft.raw))}")
    return own, told_column(own, column, unit.strip())
