"""`mapmore init`: from a file or a folder to specs in which every guess says why, with a word about
everything that is left out.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from mapmore_cli.annexes.drafting.answers import (
    NOTHING_SAID,
    Answers,
    Ask,
    asked_columns,
    asked_length,
    asked_rest,
)
from mapmore_cli.annexes.drafting.columns import (
    Table,
    count_pressures,
    guess_columns,
    guess_others,
    span,
    told_guesses,
)
from mapmore_cli.annexes.drafting.draft import Draft, Guess
from mapmore_cli.annexes.drafting.experiment import (
    followed,
    hysteresis_beside,
    of_experiment,
    with_target,
)
from mapmore_cli.annexes.drafting.groups import (
    Group,
    constants_of,
    find_groups,
    loads_told,
    pressures_told,
    second_of,
    started,
)
from mapmore_cli.annexes.drafting.proof import proven
from mapmore_cli.annexes.drafting.recordings import (
    cleaned,
    read_draft,
    some_of,
    table_of,
    with_column_beside,
    with_columns,
    with_second_log,
    with_strain,
    with_volts,
)
from mapmore_cli.checking.names import POSITIONS, number_in, tests_of
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.spec.units import convert, parse_quantity

Search = Callable[[Draft, Path], Draft]
"""Returns a draft with the model that was found for it, given the folder that its paths start at.
"""

Second = tuple[Group, Answers | None]
"""The logs of the pressure, where these are files of their own, and what was said of them."""


def propose(
    group: Group,
    name: str,
    folder: Path,
    answers: Answers = NOTHING_SAID,
    second: Second | None = None,
) -> Draft:
    """Return the spec of a group of recordings, with paths from `folder`; `answers` are what a
    person has said of them.

    What cannot be told from the data is marked `CHECK`. Its model is still to be found (`proven`).

    Raises
    ------
    DataError
        Where no two columns of numbers move.
    """
    if group.beside is not None:
        return followed(
            *with_column_beside(started(group, name, folder), group, group.beside, folder), folder
        )
    table = table_of(group, folder)
    loads, is_told = loads_told(group), bool(answers.columns)
    guesses = (
        told_guesses(answers, table)
        if is_told
        else guess_columns(table, pressures_told(some_of(group.names)), loads is not None)
    )
    moving = [one for one in guesses if span(table.raw[guesses[one].column])]
    target = answers.target or next(
        (one for one in ("force", "displacement", "length") if one in moving), None
    )
    position = (
        next((one for one in POSITIONS if one in guesses), None) if target == "force" else None
    )
    second = (
        second
        if {"time", "force"} <= guesses.keys()
        and position is not None
        and "pressure" not in guesses
        else None
    )
    untold, constants = "", None
    if target == "force" and second is None:
        untold = next((one for one in ("pressure", position or "strain") if one not in guesses), "")
        told = (
            constants_of(
                group.conditions, untold, answers.length, strict=is_told and answers.hold != untold
            )
            if untold
            else None
        )
        untold, constants = told or (untold, None)
    plain = target is not None and (
        "pressure" in guesses
        or (constants is not None and untold == "pressure")
        or second is not None
    )
    if is_told and not (
        plain and guesses.keys() <= {"time", "pressure", target, *POSITIONS, "load"}
    ):
        inputs, target = _as_told(group, guesses, target)
        return followed(
            with_columns(started(group, name, folder), guesses, table), inputs, target, folder
        )
    if target is None or not plain or (not is_told and count_pressures(table, guesses) > 1):
        guesses, inputs, target = _unknown(group, table, guesses)
        return followed(
            with_columns(started(group, name, folder), guesses, table), inputs, target, folder
        )
    if target == "displacement" and loads is not None and len(set(loads)) > 1:
        untold, constants = "load", loads
    position = position or (untold if constants is not None and untold in POSITIONS else None)
    used = (
        guesses
        if is_told
        else {one: guesses[one] for one in ("time", "pressure", position, target) if one in guesses}
    )
    draft = with_columns(started(group, name, folder, untold, constants), used, table)
    if second is not None:
        clock = convert(table.raw[guesses["time"].column][0], guesses["time"].unit, "s")
        draft = with_second_log(draft, second[0], folder, clock, target, second[1])
    draft, dataset = cleaned(draft, folder, target)
    if answers.length is not None:
        draft = with_strain(draft, dataset, answers.length)
        if "derive" in draft.data:
            target, position = target if target == "force" else "strain", position and "strain"
        dataset = read_draft(draft, folder, target)
    try:
        return of_experiment(draft, dataset.recordings, folder, target, position, answers.hold)
    except DataError as fault:  # too few samples for what the experiment looks like
        return with_target(draft, target).noted(
            ("target",), f"made plain, as {fault.message}", False
        )


def _as_told(group: Group, guesses: dict[str, Guess], target: str | None) -> tuple[list[str], str]:
    """Return the inputs and the target of columns that a person has named: the target follows all
    others but the time.
    """
    names = [one for one in guesses if one != "time"]
    target = target or names[-1]
    if target not in names or len(names) < 2:
        told = ", ".join(guesses)
        raise DataError(
            f"{group.files[0].name}: '{target}' is to follow, and the columns that were named "
            f"are {told}",
            "name both",
        )
    return [one for one in names if one != target], target


def _unknown(
    group: Group, table: Table, known: dict[str, Guess]
) -> tuple[dict[str, Guess], list[str], str]:
    """Return columns of which no one knows what they are: one drives, one follows."""
    found = guess_others(table, known)
    if found is not None:
        return found
    titles = group.layout.titles or ()
    wide = [
        title
        for title in titles
        if (number := number_in(title)) is not None and number[1] is not None
    ]
    if len(wide) > 1:
        how = "write a row for each value, with its pressure in a column of its own"
        raise DataError(
            f"{group.files[0].name}: one column for each of {', '.join(wide)} is a wide "
            f"table: {how}"
        )
    told = ", ".join(titles) or f"{group.layout.width} columns without titles"
    raise DataError(
        f"{group.files[0].name}: no two columns of numbers move in {told}", "write the spec by hand"
    )


@dataclass(frozen=True)
class Start:
    """The drafts, that of the most files first, each with that of its hysteresis behind it, and
    remarks about what they do not cover.
    """

    drafts: tuple[Draft, ...]
    remarks: tuple[str, ...]


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
    """
    drafts: list[Draft] = []
    groups, remarks = find_groups(path, answers.group)
    names = _unique(
        [_name(group.label) for group in groups], [_name(group.folder.name) for group in groups]
    )
    seconds = {
        group.files: second for group in groups if (second := second_of(group, groups)) is not None
    }
    for group, own in zip(groups, names, strict=True):
        said = answers.for_columns(group.layout.columns, group.layout.width)
        if group in seconds.values():
            continue
        if said is None:
            remarks.append(f"{own} ({group}): it has none of the columns that were named")
            continue
        if drafts and single:
            remarks.append(
                f"{own} ({group}): another study; without -o every study gets a spec of its own"
            )
            continue
        called = own if name is None else name if single or len(groups) == 1 else f"{name}-{own}"
        other = seconds.get(group.files)
        beside = (
            None
            if other is None
            else (other, answers.for_columns(other.layout.columns, other.layout.width))
        )
        try:
            for draft in _drafts_of(
                group, called, folder, said, beside, ask, search or proven, single
            ):
                drafts.append(draft)  # noqa: PERF402 - the first one stays where the second fails
        except (DataError, SpecError) as fault:
            remarks.append(f"{own} ({group}): {fault.message}")
    remarks = [
        *remarks[:MOST_REMARKS],
        *([f"... and {len(remarks) - MOST_REMARKS} more"] if len(remarks) > MOST_REMARKS else []),
    ]
    if not drafts:
        raise DataError(
            f"{path}: no usable recording was found",
            "\n  ".join(remarks) or "give a folder of recordings, as CSV files",
        )
    return Start(tuple(drafts), tuple(remarks))


MOST_REMARKS = 8


def _drafts_of(
    group: Group,
    name: str,
    folder: Path,
    said: Answers,
    second: Second | None,
    ask: Ask | None,
    search: Search,
    single: bool,
) -> Iterator[Draft]:
    """Yield the draft of a group, with its model, and that of its hysteresis: made once more where
    answers tell of columns or a length.
    """

    def drafted(said: Answers) -> Draft:
        draft = propose(group, name, folder, said, second)
        draft = draft if said.columns else with_volts(draft, group.layout)
        tests = [file.name for file in tests_of(group.files)]
        return (
            draft.with_data(
                "split", {"validate": {"files": tests}}, "the names of the files say so"
            )
            if tests
            else draft
        )

    draft = drafted(said)
    if ask is not None:
        told = asked_columns(draft, said, ask)
        length = asked_length(draft, ask)
        told = replace(told, length=parse_quantity(length, "m")) if length else told
        draft = drafted(told) if told != said else draft
    draft = search(draft, folder)
    draft = draft if ask is None else asked_rest(draft, ask)
    yield draft
    beside = None if single else hysteresis_beside(draft, folder)
    if beside is not None:
        yield search(beside, folder)


def _name(label: str) -> str:
    """Return a run's name made of a label."""
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
