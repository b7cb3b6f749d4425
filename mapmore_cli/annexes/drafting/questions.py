"""What is asked at a terminal: at most five questions for any folder, each can be taken back."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.annexes.drafting.answers import Answers, read_hold, read_names
from mapmore_cli.annexes.drafting.columns import Table, find
from mapmore_cli.annexes.drafting.draft import NamedColumn, scaled
from mapmore_cli.annexes.drafting.understanding import Understood
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import UsageError

BLOCKS = "▁▂▃▄▅▆▇█"
BACK = "b"


@dataclass(frozen=True)
class Option:
    """A column or an answer: how it is called, its `text`, and its course."""

    number: str
    text: str
    course: str = ""


@dataclass(frozen=True)
class Question:
    """One thing that the data cannot tell: `form` says how to answer, and `take` returns what is
    then said, or raises UsageError.
    """

    text: str
    options: tuple[Option, ...]
    form: str
    take: Callable[[str], Answers]


class Stopped(UsageError):
    """What was understood is not right; nothing is written."""


Ask = Callable[[Question], str]
"""Returns what a person answers, `b` for the question before; it is asked again where the answer
cannot be.
"""
View = Callable[[Answers], Understood]
"""Returns what is understood by answers."""


def interview(table: Table, view: View, answers: Answers, ask: Ask) -> Answers:
    """Ask what is open, and at last whether all is right; return what was said.

    Raises UsageError where the person says no, or says nothing of what has to be known.
    """
    past: list[tuple[int, Answers]] = []
    place = 0
    while place <= len(QUESTIONS):
        if place == 0:
            question = _target(table, view, answers)
        else:
            question = QUESTIONS[place - 1](table, view(answers), answers, view)
        if question is not None:
            reply = ask(question).strip()
            if reply == BACK:
                place, answers = past.pop() if past else (0, answers)
                continue
            past.append((place, answers))
            answers = question.take(reply)
        place += 1
    return answers


def course(values: Sequence[Array], width: int = 40) -> str:
    """Return a column over its samples as so many characters, one recording after the other."""
    shares = scaled(np.concatenate(values))
    places = np.linspace(0, len(shares) - 1, min(width, len(shares))).astype(int)
    return "".join(BLOCKS[int((len(BLOCKS) - 1) * share + 0.5)] for share in shares[places])


def _options(table: Table, but: Iterable[NamedColumn] = ()) -> tuple[Option, ...]:
    given = {one.column for one in but}
    return tuple(
        Option(str(one.place), one.described, course(one.values))
        for one in table.values()
        if one.moves and one.column not in given
    )


def _target(table: Table, view: View, answers: Answers) -> Question | None:
    with suppress(UsageError):  # while nobody says what is predicted
        if answers.target or view(answers):
            return None

    def take(reply: str) -> Answers:
        said = read_names("the target", reply)
        for one in said.values():
            find(table, one.column, "the target")
        return replace(answers, target=said)

    return Question(
        "What is to be predicted?",
        _options(table),
        "numbers or titles; with a name and a unit as `force=6:N`",
        take,
    )


def _inputs(table: Table, known: Understood, answers: Answers, view: View) -> Question | None:
    if answers.columns or answers.inputs is not None or len(known.inputs) < 2:
        return None
    targets = [known.columns[name] for name in known.targets]

    def take(reply: str) -> Answers:
        if not reply:
            return answers
        said = read_names("the inputs", reply.lstrip("- "))
        columns = [find(table, one.column, "the inputs").column for one in said.values()]
        if any(one.column in columns for one in targets):
            raise UsageError("the inputs: the target is no input", "leave it out")
        if reply.startswith("-"):
            rest = {name: known.columns[name] for name in known.inputs}
            said = {name: one for name, one in rest.items() if one.column not in columns}
        inputs = replace(answers, inputs=said)
        view(inputs)
        return inputs

    return Question(
        "What drives it?",
        _options(table, targets),
        "Enter: all; else those that drive, `4,5` or `pressure=5:bar`; `-1,2`: all but these",
        take,
    )


def _units(table: Table, known: Understood, answers: Answers, _: View) -> Question | None:
    unsure = {name: one for name, one in known.columns.items() if not one.sure}
    if not unsure:
        return None
    usual = ",".join(f"{name}:{one.unit}" for name, one in unsure.items())

    def take(reply: str) -> Answers:
        settled: dict[str, NamedColumn | None] = {
            name: replace(one, why="you", sure=True) for name, one in unsure.items()
        }
        for name, one in (read_names("the units", reply) if reply else {}).items():
            if name not in unsure:
                raise UsageError(f"the units: {name} is not asked for", f"say {usual}")
            if one.column == "none":
                settled[name] = None
                continue
            column = unsure[name].column if one.refers_to(name) else one.column
            column = find(table, column, "the units").column
            settled[name] = replace(one, column=column, unit=one.unit or unsure[name].unit)
        return replace(answers, settled=settled)

    return Question(
        "Which units are these in?",
        tuple(Option(name, one.why) for name, one in unsure.items()),
        f"Enter: `{usual}`; else so, as `time=2:s` for another column, or `time=none`",
        take,
    )


def _held(_: Table, known: Understood, answers: Answers, _view: View) -> Question | None:
    if answers.hold is not None or len(known.drives) < 2:
        return None

    def take(reply: str) -> Answers:
        if not reply:
            return answers
        hold = read_hold(reply)
        if hold.name != "none" and hold.name not in known.drives and not hold.word:
            raise UsageError(
                f"{hold.name} drives nothing", f"say {', '.join(known.drives)}, or none"
            )
        return replace(answers, hold=hold)

    return Question(
        "What was held while the others moved?",
        tuple(Option(str(place), name) for place, name in enumerate(known.drives, start=1)),
        "Enter: as the recordings show; else its name, or none",
        take,
    )


def _summary(_: Table, known: Understood, answers: Answers, _view: View) -> Question:
    def take(reply: str) -> Answers:
        if reply.casefold() not in ("", "y", "yes"):
            raise Stopped("stopped: what was understood is not right", "say it on the line")
        return answers

    return Question(
        "Is this right?",
        tuple(Option(name, text) for name, text in known.summary().items()),
        "Enter: yes; b: back; no: stop",
        take,
    )


QUESTIONS = (_inputs, _units, _held, _summary)
"""What is asked once it is known what is predicted."""
