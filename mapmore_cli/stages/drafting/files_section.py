"""The files of a study, its columns, and what was held according to the names of the files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.spec.units import convert, default_unit
from mapmore_cli.stages.drafting.columns import LARGEST_FRACTION, Guess
from mapmore_cli.stages.drafting.draft import Draft
from mapmore_cli.stages.drafting.file_names import number_in
from mapmore_cli.stages.drafting.groups import Group, patterns
from mapmore_cli.stages.drafting.readings import dataset_of

IMPOSSIBLE = 100  # per cent of strain


@dataclass(frozen=True, order=True)
class Told:
    """What the name of a file says about the held quantity, in the model's unit, and how."""

    value: float
    why: str


def constants_of(group: Group, quantity: str) -> list[Told] | None:
    """The held quantity by the names of the files; None where they say nothing.

    Strains above 1.5 are per cent, whether of the length or of the largest strain, and those of 100 are none; a name without a number
    stands for zero.
    """
    words = [part.condition for part in group.names]
    if any(word is None for word in words) or len(set(words)) < 2:
        return None
    numbers = [number_in(word or "") for word in words]
    largest = max(number[0] for number in numbers if number is not None)
    if quantity == "strain" and largest >= IMPOSSIBLE:
        return None
    model_unit = default_unit(quantity)
    usual = "%" if quantity == "strain" and largest > LARGEST_FRACTION else model_unit
    return [_told(word, number, quantity, usual, model_unit) for word, number in zip(words, numbers, strict=True)]


def _told(word: str | None, number: tuple[float, str | None] | None, quantity: str, usual: str, model_unit: str) -> Told:
    if number is None:
        return Told(0.0, f"'{word}' has no number: taken as {quantity} 0")
    value, unit = number[0], number[1] or usual
    shown = f"{value:g}{'' if unit == '1' else f' {unit}'}"
    return Told(float(f"{convert(value, unit, model_unit):.12g}"), f"'{word}' taken as {quantity} {shown}: say what was measured")


def started(group: Group, name: str, folder: Path, quantity: str, constants: Sequence[Told] | None) -> Draft:
    """A draft with the name and the files; those for which the same constant is set share an entry."""
    data: dict[str, Any] = {"files": [], "reader": group.layout.reader, **group.layout.settings}
    draft = Draft({"schema_version": 1, "name": name, "muscle": {"name": name}, "data": data})
    draft = draft.noted(("muscle",), "kind, length and diameter help `check`, as {kind: mckibben, length: 88 mm, diameter: 20 mm}", False)
    if "header" in group.layout.settings and not group.layout.settings["header"]:
        draft = draft.noted(("data", "header"), "the first line holds numbers")
    if constants is None:
        found = patterns(group.files, folder)
        return draft.with_data("files", found).noted(
            ("data", "files", 0), f"{len(group.files)} files" if len(found) < len(group.files) else None
        )
    entries: list[dict[str, Any]] = []
    for told in sorted(set(constants)):
        members = [file for file, own in zip(group.files, constants, strict=True) if own == told]
        for pattern in patterns(members, folder):
            draft = draft.noted(("data", "files", len(entries)), told.why, sure=False)
            entries.append({"path": pattern, "set": {quantity: told.value}})
    return draft.with_data("files", entries)


def with_columns(draft: Draft, guesses: Mapping[str, Guess], titles: Sequence[str]) -> Draft:
    """The draft with its columns; those that are not used are named."""
    used = {guess.column for guess in guesses.values()}
    left = ", ".join(title for title in titles if title not in used)
    draft = draft.with_data("columns", {one: guess.as_spec() for one, guess in guesses.items()}, f"left out: {left}" if left else None)
    for quantity, guess in guesses.items():
        draft = draft.noted(("data", "columns", quantity), guess.why, guess.sure)
    return draft


def cleaned(draft: Draft, folder: Path, target: str) -> tuple[Draft, Dataset]:
    """The draft with what its recordings need to be read, and these; a clock that runs backwards is left out."""
    lenient = {"missing": "drop", "repeated_time": "average"}
    try:
        dataset = dataset_of({**draft.data, **lenient}, folder, target)
    except DataError as fault:
        if "time" not in draft.data["columns"]:
            raise
        columns = {name: column for name, column in draft.data["columns"].items() if name != "time"}
        draft = draft.with_data("columns", columns, f"time is left out: {fault.message}", False)
        dataset = dataset_of({**draft.data, **lenient}, folder, target)
    lost = {reason: sum(one.dropped.get(reason, 0) for one in dataset.recordings) for reason in ("missing value", "repeated time")}
    if lost["missing value"]:
        draft = draft.with_data("missing", "drop", f"{lost['missing value']} samples have an empty cell")
    if lost["repeated time"]:
        draft = draft.with_data("repeated_time", "average", f"{lost['repeated time']} time stamps repeat: the logger rounds them")
    force = np.concatenate([one.columns[target] for one in dataset.recordings])
    if target == "force" and -force.min() > force.max():
        why = f"{draft.notes['data', 'columns', 'force'].why}: it pushes, or its sign is turned; `scale: -1` makes push positive"
        draft = draft.noted(("data", "columns", "force"), why, False)
    return draft, dataset
