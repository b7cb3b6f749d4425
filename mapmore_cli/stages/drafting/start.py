"""`mapmore init`: from a file or a folder to specs in which every guess says why, with a word about everything that is left out."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.domain.recording import Recording
from mapmore_cli.stages.drafting.columns import Guess, Raw, guess_columns
from mapmore_cli.stages.drafting.components import hysteresis_beside
from mapmore_cli.stages.drafting.draft import Draft
from mapmore_cli.stages.drafting.experiment import find_held, with_experiment
from mapmore_cli.stages.drafting.groups import Group, find_groups
from mapmore_cli.stages.drafting.model import with_model
from mapmore_cli.stages.drafting.moving import guess_others, moves, remembers, with_counted_samples, with_memory
from mapmore_cli.stages.drafting.proof import proven
from mapmore_cli.stages.drafting.recordings import (
    cleaned,
    constants_of,
    dataset_of,
    loads_told,
    pressures_told,
    raw_columns,
    started,
    with_columns,
    with_strain,
)
from mapmore_cli.stages.drafting.second_logs import second_of, with_column_beside, with_second_log
from mapmore_cli.stages.inspection.evidence import set_in_steps
from mapmore_cli.storage.tables.remembered import remembered

POSITIONS = ("strain", "displacement", "length")
"""Quantities that say how far a muscle has contracted, the most telling first."""


def propose(group: Group, name: str, folder: Path, length: float | None = None, second: Group | None = None) -> Draft:
    """The spec of a group of recordings, with paths from `folder`; `length` is that of the muscle in m, where it is known.

    `second` are the logs of the pressure, where these are files of their own. What cannot be told from the data is marked `CHECK`. The
    spec passes its own check, and of short recordings its own run.

    Raises
    ------
    DataError
        Where no two columns of numbers move.
    """
    if group.beside is not None:
        return proven(_followed(*with_column_beside(started(group, name, folder, "", None), group, group.beside, folder), folder), folder)
    titles = dict(zip(group.layout.columns, group.layout.titles or (), strict=False))
    below = dict(zip(group.layout.columns, group.layout.below, strict=False))
    raw = raw_columns(group, folder)
    loads = loads_told(group)
    guesses = guess_columns(titles, raw, below, pressures_told(group), loads is not None)
    moving = [one for one in guesses if np.ptp(np.concatenate(raw[guesses[one].column]))]
    target: str | None = next((one for one in ("force", "displacement", "length") if one in moving), None)
    position = next((one for one in POSITIONS if one in guesses), None) if target == "force" else None
    untold = next((one for one in ("pressure", position or "strain") if one not in guesses), "") if target == "force" else ""
    second = second if {"time", "force"} <= guesses.keys() and position is not None else None
    untold = untold if second is None else ""
    constants = constants_of(group, untold) if untold else None
    if target is None or ("pressure" not in guesses and not (constants and untold == "pressure") and second is None):
        return proven(_of_unknown(group, name, folder, titles, raw, guesses), folder)
    if target == "displacement" and loads is not None and len(set(loads)) > 1:
        untold, constants = "load", loads
    position = position or ("strain" if constants is not None and untold == "strain" else None)
    guesses = {one: guesses[one] for one in ("time", "pressure", position, target) if one in guesses}
    draft = with_columns(started(group, name, folder, untold, constants), guesses, list(titles.values()))
    if second is not None:
        clock = raw[guesses["time"].column][0]
        draft = with_second_log(draft, second, folder, guesses["time"], (float(clock.min()), float(clock.max())))
    draft, dataset = cleaned(draft, folder, target)
    if length is not None:
        draft, position = with_strain(draft, dataset, length, position)
        target = "strain" if target != "force" and "derive" in draft.data else target
        dataset = dataset_of(draft.data, folder, target)
    plain = draft.with_section("target", "static" if target == "force" else {"column": target})
    plain = plain.with_section("dictionary", [{"polynomial": {"of": ["pressure"], "order": 1}}])
    try:
        draft = _modelled(draft, dataset.recordings, folder, target, position)
    except DataError as fault:  # too few samples for what the experiment looks like
        draft = plain.noted(("target",), f"made plain, as {fault.message}", False)
    return proven(draft, folder)


def _modelled(draft: Draft, recordings: Sequence[Recording], folder: Path, target: str, position: str | None) -> Draft:
    """The draft with the experiment and the model: static where something was held or nothing tells the time, else with memory."""
    held = find_held(recordings, ("pressure", position)) if position is not None else None
    if held is None and moves(recordings, target):
        inputs = [one for one in ("pressure", position) if one is not None and one != target]
        steady = [name for name in ("load",) if name in recordings[0].columns]
        return with_memory(draft, recordings, inputs, target, steady)
    step = set_in_steps([one.columns["force"] for one in recordings]) if target == "force" and position is not None and held else None
    if step is not None and position is not None and set_in_steps([one.columns[position] for one in recordings]) is None:
        return _turned_round(draft, recordings, folder, position, step)
    draft = with_experiment(draft, recordings, position)
    draft = draft.with_section("target", "static" if target == "force" else {"column": target})
    return with_model(draft, dataset_of(draft.data, folder, target), [one for one in ("pressure", position) if one is not None])


def _turned_round(draft: Draft, recordings: Sequence[Recording], folder: Path, position: str, step: float) -> Draft:
    """The draft of a muscle whose force was set: the position is what was measured, and the target."""
    draft = with_experiment(draft, recordings, "force")
    why = f"the force was set in steps of {step:.4g} N, and {position} measured: the noise lies there"
    draft = draft.with_section("target", {"column": position}, why)
    return with_model(draft, dataset_of(draft.data, folder, position), ["pressure", "force"])


def _of_unknown(group: Group, name: str, folder: Path, titles: Mapping[str | int, str], raw: Raw, known: Mapping[str, Guess]) -> Draft:
    """The draft of columns of which no one knows what they are: one drives, one follows."""
    found = guess_others(titles, raw, known)
    if found is None:
        told = ", ".join(group.layout.titles or ()) or f"{group.layout.width} columns without titles"
        raise DataError(f"{group.files[0].name}: no two columns of numbers move in {told}", "write the spec by hand")
    guesses, inputs, target = found
    return _followed(with_columns(started(group, name, folder, "", None), guesses, list(titles.values())), inputs, target, folder)


def _followed(draft: Draft, inputs: Sequence[str], target: str, folder: Path) -> Draft:
    """The draft with a model of what follows on what drives: with memory where something tells of it."""
    draft, dataset = cleaned(draft, folder, target)
    memory = remembers(dataset.recordings, inputs[0], target)
    if memory is not None and "time" not in dataset.recordings[0].columns:
        draft = with_counted_samples(draft, memory)
        dataset = dataset_of(draft.data, folder, target)
    if moves(dataset.recordings, target) and (target != "force" or memory is not None):
        return with_memory(draft, dataset.recordings, inputs, target)
    draft = draft.with_section("target", {"column": target})
    return with_model(draft, dataset, inputs)


@dataclass(frozen=True)
class Start:
    """The drafts, that of the most files first, each with that of its hysteresis behind it, and remarks about what they do not cover."""

    drafts: tuple[Draft, ...]
    remarks: tuple[str, ...]


def start(path: Path, folder: Path, name: str | None = None, single: bool = False, length: float | None = None) -> Start:
    """Draft a spec for every group of recordings under `path`, or for the largest one only, with relative paths from `folder`.

    Raises
    ------
    DataError
        Where nothing usable is found; the message says why of every file.
    """
    with remembered():
        return _start(path, folder, name, single, length)


def _start(path: Path, folder: Path, name: str | None, single: bool, length: float | None) -> Start:
    groups, remarks = find_groups(path)
    names = _unique([_name(group.label) for group in groups], [_name(group.files[0].parent.name) for group in groups])
    seconds = {group.files: second_of(group, groups) for group in groups}
    drafts: list[Draft] = []
    for group, own in zip(groups, names, strict=True):
        if group in seconds.values():
            continue
        if drafts and single:
            remarks.append(f"{own} ({len(group.files)} files): another study; without -o every study gets a spec of its own")
            continue
        try:
            asked = own if name is None else name if single or len(groups) == 1 else f"{name}-{own}"
            drafts.append(propose(group, asked, folder, length, seconds[group.files]))
            beside = None if single else hysteresis_beside(drafts[-1], folder)
            if beside is not None:
                drafts.append(proven(beside, folder))
        except (DataError, SpecError) as fault:
            remarks.append(fault.message)
    if not drafts:
        raise DataError(f"{path}: no usable recording was found", "\n  ".join(_few(remarks)) or "give a folder of recordings, as CSV files")
    return Start(tuple(drafts), tuple(_few(remarks)))


def _name(label: str) -> str:
    """A run's name made of a label."""
    return re.sub(r"[^A-Za-z0-9._-]+", "-", label).strip("._-")[:80] or "study"


def _unique(labels: Sequence[str], folders: Sequence[str]) -> list[str]:
    """The labels, those that repeat with their folder before them, and with a number where this does not help."""
    names = [label if labels.count(label) == 1 else f"{folder}-{label}" for label, folder in zip(labels, folders, strict=True)]
    return [name if names.count(name) == 1 else f"{name}-{names[: place + 1].count(name)}" for place, name in enumerate(names)]


def _few(remarks: Sequence[str], most: int = 8) -> list[str]:
    return [*remarks[:most], *([f"... and {len(remarks) - most} more"] if len(remarks) > most else [])]
