"""Which files belong to one study, by their layout and names, and the `files` of its spec, with
what names tell of each.
"""

from __future__ import annotations

import glob
import os
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mapmore_cli.annexes.drafting.draft import Draft
from mapmore_cli.annexes.drafting.preview import Preview, preview, shared_start
from mapmore_cli.checking.names import (
    POSITIONS,
    NameParts,
    mass_in,
    number_in,
    read_label,
    read_names,
    words_of,
)
from mapmore_cli.checking.rules.units import LARGEST_STRAIN
from mapmore_cli.domain.errors import DataError
from mapmore_cli.ingestion.files import expand, relative_name
from mapmore_cli.spec.units import convert, default_unit
from mapmore_cli.storage.readers import READERS, reader_of
from mapmore_cli.storage.tables.lines import lines_of

UNREAD = (
    ".npz",
    ".npy",
    ".json",
    ".parquet",
    ".feather",
    ".pkl",
    ".pickle",
    ".xls",
    ".ods",
    ".bag",
    ".db3",
    ".mcap",
    ".sqlite",
)
"""Suffixes of files that may hold data, which no reader takes."""

LENGTHS = {"mm", "cm"}
IMPOSSIBLE = 100  # per cent of strain
GRAVITY = 9.80665  # m/s^2
MOST_TOLD = 8  # sheets that a note names


@dataclass(frozen=True)
class Group:
    """Files of one layout with what their names say; `alone` where the folder has no other group.

    `beside` is the file whose one column belongs beside the one column of this. `of` is the
    quantity that numbers specimens which are one study.
    """

    files: tuple[Path, ...]
    names: tuple[NameParts, ...]
    layout: Preview
    alone: bool = True
    beside: Group | None = None
    of: str | None = None

    def __str__(self) -> str:
        return f"{len(self.files)} file{'s' if len(self.files) > 1 else ''}"

    @property
    def folder(self) -> Path:
        """The folder that all files are in."""
        return Path(os.path.commonpath([file.parent for file in self.files]))

    @property
    def conditions(self) -> Sequence[str | None]:
        """The words of the names that may say what was held, of sheets or of files."""
        return (len(self.files) == 1 and self.layout.told) or [
            part.condition for part in self.names
        ]

    @property
    def specimens(self) -> list[tuple[int, str]]:
        """The number of the specimen of every file, and the words of its name that tell it from
        others.
        """
        words = [" ".join(part.group) for part in self.names]
        return [(sorted(set(words)).index(word) + 1, word) for word in words]

    @property
    def quantities(self) -> set[str]:
        """What the titles name."""
        return {
            label.quantity
            for title in self.layout.titles or ()
            if (label := read_label(title)) is not None
        }

    @property
    def label(self) -> str:
        """A name for the study: that of the folder where it has no other, else the words that all
        its files share.
        """
        names = [words_of(path.relative_to(self.folder).as_posix()) for path in self.files]
        common = [column[0] for column in zip(*names, strict=True) if len(set(column)) == 1]
        return (
            self.folder.name
            if (self.alone and len(self.files) > 1) or not common
            else "_".join(common)
        )


def find_groups(path: Path, pooled: str | None = None) -> tuple[list[Group], list[str]]:
    """Return the groups of files under a path, the largest first, and for every other file why it
    is left out.

    What names tell apart is a group of its own, unless `pooled` names the quantity that numbers it,
    or is `none`.

    Raises DataError where the path does not exist.
    """
    if not path.exists():
        raise DataError(
            f"{path}: no such file or folder", "give a recording, or a folder of recordings"
        )
    every = (
        [path]
        if path.is_file()
        else [file for file in sorted(path.rglob("*")) if file.is_file() and _is_own(file, path)]
    )
    files = [file for file in every if file == path or reader_of(file) is not None]
    homes = _homes(files)
    left_out = []
    columns: dict[Path, Preview] = {}
    layouts: dict[tuple[Path, str], tuple[Preview, list[Path]]] = {}
    for file in files:
        try:
            layout = preview(file)
            layouts.setdefault((homes[file.parent], repr(layout)), (layout, []))[1].append(file)
        except DataError as fault:
            try:
                columns[file] = preview(file, least=1)
            except DataError:
                left_out.append(fault.message)
    groups = [
        group
        for (home, _), (layout, members) in layouts.items()
        for group in _by_names(members, home, layout, pooled)
    ]
    pairs = _pairs(columns)
    paired = {
        file
        for group in pairs
        for file in (*group.files, *(group.beside.files if group.beside else ()))
    }
    unread = [
        file for file in every if file.suffix.casefold() in UNREAD and reader_of(file) is None
    ]
    left_out += [
        f"{file.name}: no reader takes {file.suffix}; save it as CSV, HDF5 or MAT"
        for file in unread
    ]
    left_out += [
        f"{file.name}: a single column, and no other of as many rows beside it"
        for file in columns
        if file not in paired
    ]
    groups += pairs
    folders = Counter(group.folder for group in groups)
    groups = [replace(group, alone=folders[group.folder] == 1) for group in groups]
    return sorted(groups, key=lambda group: (-len(group.files), group.files[0])), left_out


def _is_own(file: Path, folder: Path) -> bool:
    """Return True for a file that is neither hidden nor the result of a run."""
    inside = file.relative_to(folder)
    ours = any((folder / parent / "run.json").is_file() for parent in inside.parents)
    return not ours and not any(part.startswith(".") for part in inside.parts)


def _homes(files: Sequence[Path]) -> dict[Path, Path]:
    """Every folder with itself; with the one above it where folders side by side tell what was
    held, as `10 psi` and `20 psi`.
    """
    folders = {file.parent for file in files}
    told = {
        one
        for one in folders
        if (number := number_in(one.name)) is not None and number[1] is not None
    }
    levels = Counter(one.parent for one in told)
    return {one: one.parent if one in told and levels[one.parent] > 1 else one for one in folders}


def _by_names(
    files: Sequence[Path], home: Path, layout: Preview, pooled: str | None
) -> list[Group]:
    """Files whose names in a folder have equally many words, and the same words where these tell
    groups apart and are not `pooled`.
    """
    members: dict[tuple[int, tuple[str, ...]], list[tuple[Path, NameParts]]] = {}
    names = {file: file.relative_to(home).as_posix() for file in files}
    for count in dict.fromkeys(len(words_of(name)) for name in names.values()):
        alike = [file for file in files if len(words_of(names[file])) == count]
        for file, part in zip(alike, read_names([names[file] for file in alike]), strict=True):
            members.setdefault((count, () if pooled else part.group), []).append((file, part))
    of = None if pooled == "none" else pooled
    made = [
        Group(tuple(file for file, _ in group), tuple(part for _, part in group), layout)
        for group in members.values()
    ]
    return [
        replace(group, of=of) if len({part.group for part in group.names}) > 1 else group
        for group in made
    ]


def _pairs(columns: Mapping[Path, Preview]) -> list[Group]:
    """Two files of a single column in one folder, of as many lines: the first one by its name, with
    the other beside it.
    """
    found = []
    for folder in dict.fromkeys(file.parent for file in columns):
        files = sorted(
            file for file in columns if file.parent == folder and reader_of(file) == READERS["csv"]
        )
        if (
            len(files) == 2
            and (count := _lines(files[0])) is not None
            and count == _lines(files[1])
        ):
            first, other = (Group((file,), (NameParts(),), columns[file]) for file in files)
            found.append(replace(first, beside=other))
    return found


def _lines(file: Path) -> int | None:
    """Return the number of lines; None of a damaged file."""
    try:
        return sum(1 for _ in lines_of(file))
    except DataError:
        return None


def second_of(group: Group, groups: Sequence[Group]) -> Group | None:
    """Return the log with the pressure of the same tests: the one group in the folder whose titles
    have it, and that has as many files.

    None where the group has a pressure of its own, lacks force, position or time, or more than one
    other comes into question.
    """
    here = group.quantities
    if not {"time", "force"} <= here or "pressure" in here or here.isdisjoint(POSITIONS):
        return None
    beside = [
        one
        for one in groups
        if one.files[0].parent == group.files[0].parent and len(one.files) == len(group.files)
    ]
    found = [
        one
        for one in beside
        if {"time", "pressure"} <= one.quantities
        and one.quantities.isdisjoint({"force", *POSITIONS})
    ]
    return found[0] if len(found) == 1 else None


def patterns(files: Sequence[Path], folder: Path) -> list[str]:
    """Globs from `folder` that match these files and no others: one where there is one, else the
    files themselves.
    """
    parent = relative_name(files[0].parent, folder)
    where = "" if parent == "." else f"{glob.escape(parent)}/"
    for pattern in _candidates([file.name for file in files]):
        if len(files) > 1 and {path.resolve() for path in expand(where + pattern, folder)} == {
            path.resolve() for path in files
        }:
            return [where + pattern]
    return [relative_name(file, folder) for file in files]


def _candidates(names: Sequence[str]) -> list[str]:
    """Patterns made of the words at which all names begin and end; the shortest are tried first."""
    begin = shared_start(names).rstrip("0123456789")
    end = shared_start([name[::-1] for name in names])[::-1]
    words = [end[mark.start() :] for mark in re.finditer(r"(?:\.[A-Za-z]\w*)+$|[_\s-]", end)][::-1]
    return [f"{glob.escape(start)}*{glob.escape(stop)}" for stop in words for start in (begin, "")]


# What names tell
# --------------------------------------------------------------------------------------------------


@dataclass(frozen=True, order=True)
class Told:
    """What the name of a file says about the held quantity, in the model's unit, and how."""

    value: float = 0.0
    why: str = ""


def constants_of(
    words: Sequence[str | None], quantity: str, length: float | None = None, *, strict: bool = False
) -> tuple[str, list[Told]] | None:
    """Return the held quantity by the names of the files, or by sheets of a workbook, and its
    values; None where they say nothing.

    Strains above 1.5 are per cent, whether of the length or of the largest strain, and those of 100
    are none; a name without a number stands for zero. Millimetres are a contraction: a strain of
    the muscle's `length` in m, and a `displacement` where that is not known. With `strict`, numbers
    without a unit say nothing. `L=180mm` is a length.
    """
    told = {word: number_in(word) for word in words if word is not None}
    numbers = [number for number in told.values() if number is not None]
    units = {unit for _, unit in numbers}
    kinds = {"strain" if unit in {"%", *LENGTHS} else "pressure" for unit in units - {None}}
    if (
        None in words
        or len(told) < 2
        or not numbers
        or (strict and None in units)
        or kinds - {quantity}
    ):
        return None
    usual = default_unit(quantity)
    if units & LENGTHS:
        labels = [read_label(word) for word in told]
        is_length = len(numbers) == len(told) and all(
            label is not None and label.quantity == "length" for label in labels
        )
        quantity, usual = (
            ("length" if is_length else "displacement" if length is None else "strain"),
            "mm",
        )
        if not is_length:
            return quantity, [_shortened(str(word), told[str(word)], length) for word in words]
    elif quantity == "strain":
        largest = max(value for value, _ in numbers)
        if largest >= IMPOSSIBLE:
            return None
        usual = "%" if largest > LARGEST_STRAIN else usual
    return quantity, [_said(str(word), told[str(word)], quantity, usual) for word in words]


def _shortened(word: str, number: tuple[float, str | None] | None, length: float | None) -> Told:
    """Return the contraction that a name tells in mm: a strain where the length of the muscle is
    known, else a displacement in m.
    """
    by = (
        0.0
        if number is None
        else convert(number[0], number[1] if number[1] in LENGTHS else "mm", "m")
    )
    why = f"'{word}' " + (
        f"taken as shortened by {1000 * by:g} mm"
        if number
        else "has no number: taken as not shortened"
    )
    if length is None:
        return Told(
            float(f"{by:.6g}"), f"{why}; say --length to make a strain of it, or the strain itself"
        )
    return Told(float(f"{by / length:.6g}"), f"{why} of {1000 * length:g} mm")


def _said(word: str, number: tuple[float, str | None] | None, quantity: str, usual: str) -> Told:
    if number is None:
        return Told(0.0, f"'{word}' has no number: taken as {quantity} 0")
    value, unit = number[0], number[1] or usual
    shown = f"{value:g}{'' if unit == '1' else f' {unit}'}"
    why = (
        f"'{word}' taken as {quantity} {shown}: say what was measured, here and in `levels` "
        "and `split`"
    )
    return Told(float(f"{convert(value, unit, default_unit(quantity)):.12g}"), why)


def pressures_told(names: Sequence[NameParts]) -> list[float]:
    """Return the pressures in bar that names of files tell with a unit; empty where not all of them
    do.
    """
    numbers = [number_in(part.condition or "") for part in names]
    told = [
        convert(number[0], number[1], "bar")
        for number in numbers
        if number and number[1] and number[1] not in {"%", *LENGTHS}
    ]
    return told if len(told) == len(numbers) else []


def loads_told(group: Group) -> list[Told] | None:
    """Return the dead loads that the names of the files tell, as `Sample 1 Final 200 grams`; None
    where not all of them do.
    """
    masses = [mass for path in group.files if (mass := mass_in(path.name)) is not None]
    told = [
        Told(
            float(f"{mass * GRAVITY:.6g}"),
            f"N: '{word}' taken as the mass of a load that hangs there",
        )
        for mass, word in masses
    ]
    return told if len(told) == len(group.files) else None


def started(
    group: Group,
    name: str,
    folder: Path,
    quantity: str = "",
    constants: Sequence[Told] | None = None,
) -> Draft:
    """Return a draft with the name and the files; those for which the same constant is set share an
    entry.
    """
    layout, count = group.layout, len(group.files)
    of_sheets = constants is not None and count == 1
    data: dict[str, Any] = {"files": [], "reader": layout.reader, **layout.settings}
    draft = Draft(
        {"schema_version": 1, "name": name, "muscle": {"name": name}, "data": data}, files=count
    )
    draft = draft.noted(
        ("muscle",),
        "kind, length and diameter help `check`, as {kind: mckibben, length: 88 mm, diameter: "
        "20 mm}",
    )
    if not layout.settings.get("header", True):
        draft = draft.noted(("data", "header"), "the first line holds numbers")
    if "sample_time" in layout.settings:
        draft = draft.noted(("data", "sample_time"), "s: as the file says")
    if layout.sheets or of_sheets:
        draft = draft.without("data.sheet")
    if layout.left:
        draft = draft.noted(
            ("data", "sheet" if "sheet" in draft.data else "reader"), _of_sheets(layout), False
        )
    entries: list[tuple[Any, str | None]]
    if of_sheets:
        (path,) = patterns(group.files, folder)
        pairs = zip(layout.told, constants or (), strict=True)
        entries = [
            ({"path": path, "sheet": sheet, "set": {quantity: one.value}}, one.why)
            for sheet, one in pairs
        ]
    elif constants is None and group.of is None:
        found = patterns(group.files, folder)
        entries = [
            (one, f"{count} files" if len(found) < count and one == found[0] else None)
            for one in found
        ]
    else:
        entries = []
        told_of = list(
            zip(
                constants or [Told()] * count,
                group.specimens if group.of else [(0, "")] * count,
                strict=True,
            )
        )
        for told, (number, word) in sorted(set(told_of)):
            members = [
                file
                for file, own in zip(group.files, told_of, strict=True)
                if own == (told, (number, word))
            ]
            known = ({quantity: told.value} if constants else {}) | (
                {group.of: number} if group.of else {}
            )
            words = "; ".join(
                [
                    *([told.why] if constants else []),
                    *([f"'{word}' is {group.of} {number}"] if group.of else []),
                ]
            )
            entries += [
                ({"path": pattern, "set": known}, words) for pattern in patterns(members, folder)
            ]
    files: list[Any] = []
    for entry, why in entries:
        draft = draft.noted(("data", "files", len(files)), why, sure=constants is None)
        plain = entry if isinstance(entry, dict) else {"path": entry}
        files += (
            [{**plain, "sheet": sheet} for sheet in layout.sheets]
            if layout.sheets and not of_sheets
            else [entry]
        )
    draft = draft.with_data("files", files)
    return (
        draft
        if group.of is None
        else draft.with_data("groups", {"of": group.of}, "each is scored by itself")
    )


def _of_sheets(layout: Preview) -> str:
    """Which sheets of a workbook are read, and which are not."""
    several = bool(layout.sheets) or "*" in layout.settings.get("sheet", "")
    which = "the sheets that are alike" if several else "the sheet with the most rows"
    names = ", ".join(f"'{name}'" for name in layout.left[:MOST_TOLD]) + (
        " ..." if len(layout.left) > MOST_TOLD else ""
    )
    return f"{which}; laid out in another way, and left out: {names}"
