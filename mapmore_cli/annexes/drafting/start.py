"""`mapmore init`: from a file or a folder to specs, with a word about everything that is left out.

Titles, units and the person decide what columns are; nothing is guessed from values.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from mapmore_cli.annexes.drafting.answers import (
    NOTHING_SAID,
    Answers,
    Ask,
    asked_columns,
    asked_rest,
    asked_target,
)
from mapmore_cli.annexes.drafting.columns import (
    named_by_person,
    named_by_titles,
    refuse_choice,
    target_of,
)
from mapmore_cli.annexes.drafting.draft import Draft
from mapmore_cli.annexes.drafting.experiment import find_held, with_experiment
from mapmore_cli.annexes.drafting.filenames import held_in_names, tests_of
from mapmore_cli.annexes.drafting.groups import Group, find_groups, second_of, started
from mapmore_cli.annexes.drafting.proof import proven
from mapmore_cli.annexes.drafting.recordings import (
    cleaned,
    read_draft,
    table_of,
    with_columns,
    with_second_log,
    with_strain,
)
from mapmore_cli.checking.names import POSITIONS
from mapmore_cli.domain.errors import DataError, SpecError, UsageError

Search = Callable[[Draft, Path], Draft]
"""Returns a draft with the model that was found for it, given the folder that its paths start at.
"""

MOST_REMARKS = 8


@dataclass(frozen=True)
class Start:
    """The drafts, that of the most files first, and remarks about what they do not cover."""

    drafts: tuple[Draft, ...]
    remarks: tuple[str, ...]


def propose(
    group: Group,
    name: str,
    folder: Path,
    answers: Answers = NOTHING_SAID,
    second: Group | None = None,
    ask: Ask | None = None,
) -> Draft:
    """Return the spec of a group of recordings, with paths from `folder`. Its model is still to be
    found (`proven`).

    Raises
    ------
    UsageError
        Where neither titles nor `answers` say what is to be predicted, and nobody can be asked; or
        where a name that was said is none of a column.
    DataError
        Where the recordings cannot be read.
    """
    table = table_of(group, folder)
    told_of_second = {} if second is None else answers.about(second)
    answers = replace(answers, columns=answers.about(group))
    hold = answers.hold
    constants = held_in_names(group.conditions, None if hold == ("none", "") else hold)
    columns = named_by_person(answers.columns, table) if answers.columns else named_by_titles(table)
    target = answers.target or target_of([*columns], constants is not None or second is not None)
    if target is None and ask is not None:
        if not answers.columns:
            columns = named_by_person(asked_columns(table, ask), table)
        target = target_of([*columns], False) or asked_target(
            [one for one in columns if one != "time"], ask
        )
    if target is None:
        raise refuse_choice(table, group.files[0].name)
    if target not in columns or len(columns.keys() - {"time"}) + (constants is not None) < 2:
        raise UsageError(
            f"{group.files[0].name}: '{target}' is to follow, and the columns are "
            f"{', '.join(columns)}",
            "name both by --columns",
        )
    quantity, told = constants or ("", [])
    if quantity in columns:
        quantity, told = "", []
    is_muscle = target in ("force", *POSITIONS) and "pressure" in (*columns, quantity)
    if is_muscle and not answers.columns and not answers.target:
        columns = {
            key: one
            for key, one in columns.items()
            if key in ("time", "pressure", target) or (target == "force" and key in POSITIONS)
        }
    draft = with_columns(started(group, name, folder, quantity, told), columns, table)
    if second is not None and "pressure" not in columns:
        draft = with_second_log(draft, second, folder, target, told_of_second)
    draft, dataset = cleaned(draft, folder, target)
    if answers.length is not None:
        draft = with_strain(draft, dataset, answers.length)
        target = target if target == "force" or "derive" not in draft.data else "strain"
        dataset = read_draft(draft, folder, target)
    recordings = dataset.recordings
    inputs = [one for one in recordings[0].columns if one not in ("time", target, group.of)]
    held = None
    pair = _swept_and_held(inputs, hold)
    if pair is not None:
        held = find_held(recordings, pair, hold and hold[0])
    return with_experiment(draft, recordings, target, inputs, held)


def _swept_and_held(inputs: Sequence[str], hold: tuple[str, str] | None) -> tuple[str, str] | None:
    """Return the two inputs of which one may be held while the other is swept: the pressure and a
    position, or what a person says; None where there are no such two.
    """
    if hold is not None and hold[0] not in ("none", *inputs):
        raise UsageError(
            f"--hold: no input is called {hold[0]}", f"say {', '.join(inputs)}, or none"
        )
    others = [one for one in POSITIONS if one in inputs]
    if "pressure" in inputs and others:
        return "pressure", others[0]
    rest = [one for one in inputs if hold is not None and one != hold[0]]
    return (hold[0], rest[0]) if hold is not None and hold[0] in inputs and rest else None


def start(
    path: Path,
    folder: Path,
    name: str | None = None,
    single: bool = False,
    answers: Answers = NOTHING_SAID,
    ask: Ask | None = None,
    search: Search | None = None,
) -> Start:
    """Draft a spec for every group of recordings under `path`, or for the largest one only, with
    relative paths from `folder`.

    Where somebody can be asked (`ask`), what is open is asked. `search` finds the model of a draft,
    by default `proven`.

    Raises
    ------
    DataError
        Where nothing usable is found; the message says why of every file.
    UsageError
        Where nothing says what is to be predicted, of any study.
    """
    drafts: list[Draft] = []
    open_choice: UsageError | None = None
    groups, remarks = find_groups(path, answers.group)
    names = _unique(
        [_run_name(group.label) for group in groups],
        [_run_name(group.folder.name) for group in groups],
    )
    seconds = {group.files: second_of(group, groups) for group in groups}
    for group, own in zip(groups, names, strict=True):
        if any(group is second for second in seconds.values()):
            continue
        if answers.columns and not answers.about(group):
            remarks.append(f"{own} ({group}): it has none of the columns that were named")
            continue
        if drafts and single:
            remarks.append(
                f"{own} ({group}): another study; without -o every study gets a spec of its own"
            )
            continue
        is_only = single or len(groups) == 1
        called = own if name is None else name if is_only else f"{name}-{own}"
        try:
            draft = propose(group, called, folder, answers, seconds[group.files], ask)
            if tests := tests_of(group.files):
                held_out = {"validate": {"files": tests}}
                draft = draft.with_data("split", held_out, "the names of the files say so")
            draft = (search or proven)(draft, folder)
            drafts.append(draft if ask is None else asked_rest(draft, ask))
        except UsageError as fault:
            open_choice = open_choice or fault
            remarks.append(fault.message.partition("\n")[0])
        except (DataError, SpecError) as fault:
            remarks.append(f"{own} ({group}): {fault.message}")
    if not drafts and open_choice is not None:
        raise open_choice
    if not drafts:
        told = "\n  ".join(_first_remarks(remarks))
        raise DataError(
            f"{path}: no usable recording was found",
            told or "give a folder of recordings, as CSV files",
        )
    return Start(tuple(drafts), tuple(_first_remarks(remarks)))


def _first_remarks(remarks: Sequence[str]) -> list[str]:
    more = len(remarks) - MOST_REMARKS
    return [*remarks[:MOST_REMARKS], *([f"... and {more} more"] if more > 0 else [])]


def _run_name(label: str) -> str:
    return re.sub(r"[^A-Za-z0-9._-]+", "-", label).strip("._-")[:80] or "study"


def _unique(labels: Sequence[str], folders: Sequence[str]) -> list[str]:
    """Return the labels, those that repeat with their folder before them, and with a number where
    this does not help.
    """
    names = [
        label if labels.count(label) == 1 else f"{folder}-{label}"
        for label, folder in zip(labels, folders, strict=True)
    ]
    return [
        name if names.count(name) == 1 else f"{name}-{names[: place + 1].count(name)}"
        for place, name in enumerate(names)
    ]
