"""`mapmore init`: from a file or a folder to specs in which every guess says why, with a word about everything that is left out."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.domain.recording import Recording
from mapmore_cli.ingestion.samples import unwrapped
from mapmore_cli.spec.units import parse_quantity
from mapmore_cli.storage.tables import remembered
from mapmore_cli.study.drafting.answers import NOTHING_SAID, Answers
from mapmore_cli.study.drafting.columns import Guess, Raw, guess_columns, told_guesses, turn_of, twins_of, with_turns
from mapmore_cli.study.drafting.draft import Draft
from mapmore_cli.study.drafting.experiment import find_held, with_experiment
from mapmore_cli.study.drafting.groups import Group, find_groups, number_in, tests_of
from mapmore_cli.study.drafting.model import hysteresis_beside, with_comparison
from mapmore_cli.study.drafting.moving import guess_others, moves, pressures_of, remembers, with_counted_samples, with_memory
from mapmore_cli.study.drafting.proof import proven
from mapmore_cli.study.drafting.questions import Ask, asked_columns, asked_length, asked_rest
from mapmore_cli.study.drafting.recordings import (
    cleaned,
    constants_of,
    dataset_of,
    loads_told,
    pressures_told,
    raw_columns,
    read_draft,
    started,
    with_columns,
    with_strain,
    with_volts,
)
from mapmore_cli.study.drafting.second_logs import second_of, with_column_beside, with_found_shift, with_second_log
from mapmore_cli.study.inspection.evidence import set_in_steps

Search = Callable[[Draft, Path], Draft]
"""Returns a draft with the model that was found for it, given the folder that its paths start at."""

POSITIONS = ("strain", "displacement", "length")
"""Quantities that say how far a muscle has contracted, the most telling first."""


def propose(
    group: Group, name: str, folder: Path, answers: Answers = NOTHING_SAID, second: tuple[Group, Answers | None] | None = None
) -> Draft:
    """Return the spec of a group of recordings, with paths from `folder`; `answers` are what a person has said of them.

    `second` are the logs of the pressure, where these are files of their own, and what was said of them. What cannot be told from the data
    is marked `CHECK`. Its model is still to be found (`proven`).

    Raises
    ------
    DataError
        Where no two columns of numbers move.
    """
    if group.beside is not None:
        return _followed(*with_column_beside(started(group, name, folder, "", None), group, group.beside, folder), folder)
    titles = dict(zip(group.layout.columns, group.layout.titles or (), strict=False))
    below = dict(zip(group.layout.columns, group.layout.below, strict=False))
    raw = raw_columns(group, folder)
    turns = {column: turn for column, values in raw.items() if (turn := turn_of(values)) is not None}
    raw = {column: [unwrapped(one, turns[column]) for one in values] if column in turns else values for column, values in raw.items()}
    loads = loads_told(group)
    guesses = (
        told_guesses(answers, titles, raw)
        if answers.columns
        else guess_columns(titles, raw, below, pressures_told(group), loads is not None)
    )
    guesses = with_turns(guesses, turns)
    moving = [one for one in guesses if np.ptp(np.concatenate(raw[guesses[one].column]))]
    target: str | None = answers.target or next((one for one in ("force", "displacement", "length") if one in moving), None)
    position = next((one for one in POSITIONS if one in guesses), None) if target == "force" else None
    untold = next((one for one in ("pressure", position or "strain") if one not in guesses), "") if target == "force" else ""
    second = second if {"time", "force"} <= guesses.keys() and position is not None and "pressure" not in guesses else None
    untold = untold if second is None else ""
    words = (len(group.files) == 1 and group.layout.told) or [part.condition for part in group.names]
    found = constants_of(words, untold, answers.length, strict=bool(answers.columns) and answers.hold != untold) if untold else None
    untold, constants = found or (untold, None)
    plain = target is not None and ("pressure" in guesses or bool(constants and untold == "pressure") or second is not None)
    known = {"time", "pressure", target, *POSITIONS, "load"}
    if answers.columns and not (plain and guesses.keys() <= known):
        return _of_told(group, name, folder, titles, raw, guesses, target)
    if not plain or (not answers.columns and len(pressures_of(titles, _without_twins(raw, guesses), guesses)) > 1):
        return _of_unknown(group, name, folder, titles, raw, guesses, turns)
    assert target is not None
    if target == "displacement" and loads is not None and len(set(loads)) > 1:
        untold, constants = "load", loads
    position = position or (untold if constants is not None and untold in POSITIONS else None)
    used = guesses if answers.columns else {one: guesses[one] for one in ("time", "pressure", position, target) if one in guesses}
    draft = with_columns(started(group, name, folder, untold, constants), used, titles, raw)
    if second is not None:
        clock = raw[guesses["time"].column][0]
        draft = with_second_log(draft, second[0], folder, guesses["time"], (float(clock.min()), float(clock.max())), second[1])
        draft = with_found_shift(draft, folder, target)
    draft, dataset = cleaned(draft, folder, target)
    if answers.length is not None:
        draft, position = with_strain(draft, dataset, answers.length, position)
        target = "strain" if target != "force" and "derive" in draft.data else target
        dataset = dataset_of(draft.data, folder, target)
    simple = draft.with_section("target", "static" if target == "force" else {"column": target})
    try:
        return _of_experiment(draft, dataset.recordings, folder, target, position, answers.hold)
    except DataError as fault:  # too few samples for what the experiment looks like
        return simple.noted(("target",), f"made plain, as {fault.message}", False)


def _without_twins(raw: Raw, guesses: Mapping[str, Guess]) -> Raw:
    """Return the columns without those that are one of the others in another unit."""
    twins = twins_of(raw, guesses["pressure"].column if "pressure" in guesses else None)
    return {column: values for column, values in raw.items() if column not in twins}


def _of_told(
    group: Group, name: str, folder: Path, titles: Mapping[str | int, str], raw: Raw, guesses: Mapping[str, Guess], target: str | None
) -> Draft:
    """Return the draft of columns that a person has named: the target follows all others but the time."""
    names = [one for one in guesses if one != "time"]
    target = target or names[-1]
    if target not in names or len(names) < 2:
        told = ", ".join(guesses)
        raise DataError(f"{group.files[0].name}: '{target}' is to follow, and the columns that were named are {told}", "name both")
    draft = with_columns(started(group, name, folder, "", None), guesses, titles, raw)
    return _followed(draft, [one for one in names if one != target], target, folder)


def _of_experiment(
    draft: Draft, recordings: Sequence[Recording], folder: Path, target: str, position: str | None, hold: str | None = None
) -> Draft:
    """Return the draft with the experiment: static where something was held or nothing tells the time, else with memory.

    `hold` is what a person says was held.
    """
    held = find_held(recordings, ("pressure", position), hold) if position is not None else None
    if held is None and moves(recordings, target):
        inputs = [one for one in ("pressure", position) if one is not None and one != target]
        return with_memory(draft, recordings, inputs, target)
    step = set_in_steps([one.columns["force"] for one in recordings]) if target == "force" and position is not None and held else None
    if step is not None and position is not None and set_in_steps([one.columns[position] for one in recordings]) is None:
        return _turned_round(draft, recordings, folder, position, step)
    draft = with_experiment(draft, recordings, held)
    draft = draft.with_section("target", "static" if target == "force" else {"column": target})
    return with_comparison(draft, dataset_of(draft.data, folder, target))


def _turned_round(draft: Draft, recordings: Sequence[Recording], folder: Path, position: str, step: float) -> Draft:
    """Return the draft of a muscle whose force was set: the position is what was measured, and the target."""
    draft = with_experiment(draft, recordings, find_held(recordings, ("pressure", "force")))
    why = f"the force was set in steps of {step:.4g} N, and {position} measured: the noise lies there"
    draft = draft.with_section("target", {"column": position}, why)
    return with_comparison(draft, dataset_of(draft.data, folder, position))


def _of_unknown(
    group: Group,
    name: str,
    folder: Path,
    titles: Mapping[str | int, str],
    raw: Raw,
    known: Mapping[str, Guess],
    turns: Mapping[str | int, float],
) -> Draft:
    """Return the draft of columns of which no one knows what they are: one drives, one follows."""
    found = guess_others(titles, raw, known)
    if found is None:
        told = ", ".join(group.layout.titles or ()) or f"{group.layout.width} columns without titles"
        wide = [title for title in group.layout.titles or () if (number := number_in(title)) is not None and number[1] is not None]
        if len(wide) > 1:
            how = "write a row for each value, with its pressure in a column of its own"
            raise DataError(f"{group.files[0].name}: one column for each of {', '.join(wide)} is a wide table: {how}")
        raise DataError(f"{group.files[0].name}: no two columns of numbers move in {told}", "write the spec by hand")
    guesses, inputs, target = found
    draft = with_columns(started(group, name, folder, "", None), with_turns(guesses, turns), titles, raw)
    return _followed(draft, inputs, target, folder)


def _followed(draft: Draft, inputs: Sequence[str], target: str, folder: Path) -> Draft:
    """Return the draft with a model of what follows on what drives: with memory where something tells of it."""
    draft, dataset = cleaned(draft, folder, target)
    memory = remembers(dataset.recordings, inputs[0], target)
    if memory is not None and "time" not in dataset.recordings[0].columns:
        draft = with_counted_samples(draft, memory)
        dataset = read_draft(draft, folder, target)
    if moves(dataset.recordings, target) and (target != "force" or memory is not None or len(inputs) > 2):
        return with_memory(draft, dataset.recordings, inputs, target)
    return with_comparison(draft.with_section("target", {"column": target}), dataset)


@dataclass(frozen=True)
class Start:
    """The drafts, that of the most files first, each with that of its hysteresis behind it, and remarks about what they do not cover."""

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
    """Draft a spec for every group of recordings under `path`, or for the largest one only, with relative paths from `folder`.

    Where somebody can be asked (`ask`), what is open is asked. `search` finds the model of a draft, by default `proven`.

    Raises
    ------
    DataError
        Where nothing usable is found; the message says why of every file.
    """
    with remembered():
        return _start(path, folder, name, single, answers, ask, search or proven)


def _start(path: Path, folder: Path, name: str | None, single: bool, answers: Answers, ask: Ask | None, search: Search) -> Start:
    groups, remarks = find_groups(path, answers.group)
    names = _unique([_name(group.label) for group in groups], [_name(group.folder.name) for group in groups])
    about = {group.files: answers.for_columns(group.layout.columns, group.layout.width) for group in groups}
    seconds = {group.files: second_of(group, groups) for group in groups}
    drafts: list[Draft] = []
    for group, own in zip(groups, names, strict=True):
        if group in seconds.values():
            continue
        said = about[group.files]
        if said is None:
            remarks.append(f"{own} ({_count(group)}): it has none of the columns that were named")
            continue
        if drafts and single:
            remarks.append(f"{own} ({_count(group)}): another study; without -o every study gets a spec of its own")
            continue
        try:
            asked = own if name is None else name if single or len(groups) == 1 else f"{name}-{own}"
            second = seconds[group.files]
            beside_it = None if second is None else (second, about[second.files])
            draft = _drafted(group, asked, folder, said, beside_it)
            draft = replace(draft, raw=raw_columns(group, folder), files=len(group.files))
            if ask is not None:
                draft = _interviewed(draft, said, ask, lambda told: _drafted(group, asked, folder, told, beside_it))  # noqa: B023
            draft = search(draft, folder)
            drafts.append(draft if ask is None else asked_rest(draft, ask))
            beside = None if single else hysteresis_beside(drafts[-1], folder)
            if beside is not None:
                drafts.append(search(beside, folder))
        except (DataError, SpecError) as fault:
            remarks.append(f"{own} ({_count(group)}): {fault.message}")
    if not drafts:
        raise DataError(f"{path}: no usable recording was found", "\n  ".join(_few(remarks)) or "give a folder of recordings, as CSV files")
    return Start(tuple(drafts), tuple(_few(remarks)))


def _drafted(group: Group, name: str, folder: Path, said: Answers, second: tuple[Group, Answers | None] | None) -> Draft:
    """Return what is proposed, with what titles say of volts, and names of files of the split."""
    draft = propose(group, name, folder, said, second)
    if not said.columns:
        draft = with_volts(draft, group.layout)
    tests = [file.name for file in tests_of(group.files)]
    return draft.with_data("split", {"validate": {"files": tests}}, "the names of the files say so") if tests else draft


def _interviewed(draft: Draft, said: Answers, ask: Ask, again: Callable[[Answers], Draft]) -> Draft:
    """Return the draft with what a person answers: it is made `again` of the answers about columns and length."""
    told = asked_columns(draft, said, ask)
    length = asked_length(draft, ask)
    if length:
        told = replace(told, length=parse_quantity(length, "m"))
    return replace(again(told), raw=draft.raw, files=draft.files) if told != said else draft


def _count(group: Group) -> str:
    return f"{len(group.files)} file{'s' if len(group.files) > 1 else ''}"


def _name(label: str) -> str:
    """Return a run's name made of a label."""
    return re.sub(r"[^A-Za-z0-9._-]+", "-", label).strip("._-")[:80] or "study"


def _unique(labels: Sequence[str], folders: Sequence[str]) -> list[str]:
    """Return the labels, those that repeat with their folder before them, and with a number where this does not help."""
    names = [label if labels.count(label) == 1 else f"{folder}-{label}" for label, folder in zip(labels, folders, strict=True)]
    return [name if names.count(name) == 1 else f"{name}-{names[: place + 1].count(name)}" for place, name in enumerate(names)]


def _few(remarks: Sequence[str], most: int = 8) -> list[str]:
    return [*remarks[:most], *([f"... and {len(remarks) - most} more"] if len(remarks) > most else [])]
