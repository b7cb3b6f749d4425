"""`mapmore init`: from a file or a folder to specs in which every guess says why, with a word about everything that is left out."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mapmore_cli.domain.errors import DataError
from mapmore_cli.stages.drafting.columns import guess_columns
from mapmore_cli.stages.drafting.draft import Draft
from mapmore_cli.stages.drafting.experiment import with_experiment
from mapmore_cli.stages.drafting.groups import Group, find_groups
from mapmore_cli.stages.drafting.model import with_model
from mapmore_cli.stages.drafting.recordings import cleaned, constants_of, dataset_of, raw_columns, started, with_columns

POSITIONS = ("strain", "displacement", "length")
"""Quantities that say how far a muscle has contracted, the most telling first."""


def propose(group: Group, name: str, folder: Path) -> Draft:
    """The spec of a group of recordings, with paths from `folder`.

    Raises
    ------
    DataError
        Where there is nothing to model: no pressure, or neither force nor displacement.
    """
    titles = dict(zip(group.layout.columns, group.layout.titles or (), strict=False))
    guesses = guess_columns(titles, raw_columns(group, folder))
    target = "force" if "force" in guesses else "displacement"
    position = next((one for one in POSITIONS if one in guesses), None) if target == "force" else None
    untold = next((one for one in ("pressure", position or "strain") if one not in guesses), "") if target == "force" else ""
    constants = constants_of(group, untold) if untold else None
    position = position or ("strain" if target == "force" and constants is not None and untold == "strain" else None)
    guesses = {one: guesses[one] for one in ("time", "pressure", position, target) if one in guesses}
    _refuse_unusable(group, target, {*guesses, *([untold] if constants else [])})
    draft = with_columns(started(group, name, folder, untold, constants), guesses, list(titles.values()))
    draft, dataset = cleaned(draft, folder, target)
    draft = with_experiment(draft, dataset.recordings, position)
    draft = draft.with_section("target", "static" if target == "force" else {"column": target})
    return with_model(draft, dataset_of(draft.data, folder, target), position)


def _refuse_unusable(group: Group, target: str, have: set[str]) -> None:
    missing = [one for one in ("pressure", target) if one not in have]
    if missing:
        told = ", ".join(group.layout.titles or ()) or f"{group.layout.width} columns without titles"
        what = " and no ".join("force or displacement" if one == target else one for one in missing)
        raise DataError(
            f"{group.files[0].name}: no {what} was recognised in {told}",
            "name the columns in a header, as pressure_kPa, strain, force_N, or write the spec by hand",
        )


@dataclass(frozen=True)
class Start:
    """The drafts, that of the most files first, and remarks about what they do not cover."""

    drafts: tuple[Draft, ...]
    remarks: tuple[str, ...]


def start(path: Path, folder: Path, name: str | None = None, single: bool = False) -> Start:
    """Draft a spec for every group of recordings under `path`, or for the largest one only, with relative paths from `folder`.

    Raises
    ------
    DataError
        Where nothing usable is found; the message says why of every file.
    """
    groups, remarks = find_groups(path)
    names = _unique([_name(group.label) for group in groups], [_name(group.files[0].parent.name) for group in groups])
    drafts: list[Draft] = []
    for group, own in zip(groups, names, strict=True):
        if drafts and single:
            remarks.append(f"{own} ({len(group.files)} files): another study; without -o every study gets a spec of its own")
            continue
        try:
            drafts.append(propose(group, own if name is None else name if single or len(groups) == 1 else f"{name}-{own}", folder))
        except DataError as fault:
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
