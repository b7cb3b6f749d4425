"""Ask questions in a terminal: at most four for any folder. The answer to each can be
taken back.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.annexes.drafting.answers import Answers, read_group, read_names
from mapmore_cli.annexes.drafting.columns import Table
from mapmore_cli.annexes.drafting.draft import Column, scaled
from mapmore_cli.annexes.drafting.finding import find, listed
from mapmore_cli.annexes.drafting.held_out import LAST, LAST_SAMPLES, WHOLE
from mapmore_cli.annexes.drafting.name_groups import group_words
from mapmore_cli.annexes.drafting.understanding import Understood
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import UsageError

BLOCKS = "▁▂▃▄▅▆▇█"
BACK = "b"
MOST_GROUPS = 20  # largest number of values in a column that may distinguish groups


@dataclass(frozen=True)
class Option:
    """A column or an answer from which a person can choose: its number, its description, and a
    drawing of its values, made of characters.
    """

    number: str
    text: str
    course: str = ""


@dataclass(frozen=True)
class Question:
    """A question that the data cannot answer. `options` are the possible choices, `form` says how
    to write the reply, and `take` returns the answers with this reply added; it raises UsageError
    for an invalid reply.
    """

    text: str
    options: tuple[Option, ...]
    form: str
    take: Callable[[str], Answers]


Ask = Callable[[Question], str]
"""Function that asks a question and returns a person's answer. The answer `b` returns to the
previous question. After an invalid answer, the question is asked again.
"""
View = Callable[[Answers], Understood]
"""Function that interprets answers: it returns the columns, targets and inputs of the study."""


@dataclass(frozen=True)
class Asked:
    """Everything that the questions need: the columns, the names of the recordings, a function that
    interprets answers, and the answers so far.
    """

    table: Table
    names: Sequence[str]
    view: View
    answers: Answers

    def options(self, but: Iterable[Column] = ()) -> tuple[Option, ...]:
        """Return the columns from which a person can choose, except those in `but`. They have the
        same numbers as in the list that `init` prints.
        """
        columns = listed(self.table, but).items()
        return tuple(
            Option(str(at), column.described, course(column.values)) for at, column in columns
        )


def interview(
    table: Table, names: Sequence[str], view: View, answers: Answers, ask: Ask
) -> Answers:
    """Ask the open questions, and return all answers.

    Raises UsageError if the person does not answer a necessary question.
    """
    past: list[tuple[int, Answers]] = []
    place = 0
    while place < len(QUESTIONS):
        question = QUESTIONS[place](Asked(table, names, view, answers))
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
    """Return a drawing of the values of a column over its samples, made of `width` characters. The
    recordings follow each other.
    """
    shares = scaled(np.concatenate(values))
    places = np.linspace(0, len(shares) - 1, min(width, len(shares))).astype(int)
    return "".join(BLOCKS[int((len(BLOCKS) - 1) * share + 0.5)] for share in shares[places])


def _target(asked: Asked) -> Question | None:
    with suppress(UsageError):  # UsageError means that the target is still unknown
        if asked.answers.target or asked.view(asked.answers):
            return None

    def take(reply: str) -> Answers:
        chosen = read_names("the target", reply)
        for column in chosen.values():
            find(asked.table, column.column, "the target")
        return replace(asked.answers, target=chosen)

    return Question(
        "What is to be predicted?",
        asked.options(),
        "Write numbers or titles; a name and a unit can be added, for example `force=6:N`",
        take,
    )


def _inputs(asked: Asked) -> Question | None:
    answers, known = asked.answers, asked.view(asked.answers)
    if answers.columns or answers.inputs is not None or len(known.inputs) < 2:
        return None
    targets = [known.columns[name].column for name in known.targets]

    def take(reply: str) -> Answers:
        if not reply:
            return answers
        chosen = read_names("the inputs", reply.lstrip("- "))
        columns = [
            find(asked.table, column.column, "the inputs").column for column in chosen.values()
        ]
        if any(column in columns for column in targets):
            raise UsageError("the target cannot be an input", "leave the target out of the inputs")
        if reply.startswith("-"):
            rest = {name: known.columns[name] for name in known.inputs}
            chosen = {name: column for name, column in rest.items() if column.column not in columns}
        inputs = replace(answers, inputs=chosen)
        asked.view(inputs)
        return inputs

    return Question(
        "Which columns are the inputs?",
        asked.options(targets),
        "Press Enter for all, or write the inputs, for example `4,5` or "
        "`pressure=5:bar,time=0:s`; `-1,2` means all except these",
        take,
    )


def _held_out(asked: Asked) -> Question | None:
    answers, known = asked.answers, asked.view(asked.answers)
    if answers.validate is not None:
        return None

    def take(reply: str) -> Answers:
        if reply and reply not in (WHOLE, LAST_SAMPLES):
            reply = known.drive_called(reply, asked.table, "what is held out")
        return replace(answers, validate=reply) if reply else answers

    others = {column.column for column in asked.table.values()} - {
        known.columns[name].column for name in known.inputs
    }
    named = tuple(
        Option("", f"{condition.quantity}  {condition.why}") for condition in known.conditions
    )
    whole = f" `{WHOLE}` (every third recording)," if len(asked.names) > 1 else ""
    return Question(
        "Which data are held out to test the model?",
        (*asked.options(others), *named),
        "Press Enter to let names, levels or recordings decide, or write an input (its inner "
        f"values),{whole} or `{LAST_SAMPLES}` (the last {100 * LAST:g} % of each recording)",
        take,
    )


def _groups(asked: Asked) -> Question | None:
    answers, known = asked.answers, asked.view(asked.answers)
    others = [known.columns[name].column for name in known.targets]
    others += [column.column for column in asked.table.values() if len(column.kinds) > MOST_GROUPS]
    words = group_words(asked.names, "specimen")
    words = [] if words == [*asked.names] else [*dict.fromkeys(words)]
    if answers.group is not None or not (words or listed(asked.table, others)):
        return None

    def take(reply: str) -> Answers:
        group = replace(answers, group=read_group(reply)) if reply else answers
        asked.view(group)
        return group

    return Question(
        "Which groups, for example specimens or sessions, are scored separately?",
        (*asked.options(others), *(Option("", f"names: {word}") for word in words)),
        "Press Enter for none, or write the column of the groups, or a word for what the names "
        "distinguish, for example `specimen`",
        take,
    )


QUESTIONS = (_target, _inputs, _held_out, _groups)
"""Functions that return the questions in their order. A function returns None if its question need
not be asked.
"""
