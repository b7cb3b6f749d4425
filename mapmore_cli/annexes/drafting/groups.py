"""Which files belong to one study, by their layout and names, and the `files` of its spec."""

from __future__ import annotations

import glob
import os
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from operator import itemgetter
from pathlib import Path
from typing import Any

from mapmore_cli.annexes.drafting.draft import Draft
from mapmore_cli.annexes.drafting.filenames import NameParts, Told, read_names, words_of
from mapmore_cli.annexes.drafting.preview import Preview, preview
from mapmore_cli.checking.names import POSITIONS, read_label
from mapmore_cli.domain.errors import DataError
from mapmore_cli.ingestion.files import expand, relative_name
from mapmore_cli.storage.readers import reader_of

UNREAD = (
    *(".npz", ".npy", ".json", ".parquet", ".feather", ".pkl", ".pickle", ".xls", ".ods"),
    *(".bag", ".db3", ".mcap", ".sqlite"),
)
"""Suffixes of files that may hold data, which no reader takes."""


@dataclass(frozen=True)
class Group:
    """Files of one layout with what their names say; `alone` where the folder has no other group.

    `of` is the quantity that numbers specimens which are one study.
    """

    files: tuple[Path, ...]
    names: tuple[NameParts, ...]
    layout: Preview
    alone: bool = True
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
        sheets = self.layout.told if len(self.files) == 1 else ()
        return sheets or [part.condition for part in self.names]

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
        labels = map(read_label, self.layout.titles or ())
        return {label.quantity for label in labels if label is not None}

    @property
    def label(self) -> str:
        """A name for the study: that of the folder where it has no other, else the words that all
        its files share.
        """
        names = [words_of(path.relative_to(self.folder).as_posix()) for path in self.files]
        common = [column[0] for column in zip(*names, strict=True) if len(set(column)) == 1]
        is_whole = (self.alone and len(self.files) > 1) or not common
        return self.folder.name if is_whole else "_".join(common)


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
    every = [path] if path.is_file() else [one for one in sorted(path.rglob("*")) if one.is_file()]
    files = [one for one in every if one == path or _is_own(one, path)]
    left_out = []
    layouts: dict[str, tuple[Preview, list[Path]]] = {}
    for file in files:
        if file != path and reader_of(file) is None:
            if file.suffix.casefold() in UNREAD:
                how = "save it as CSV, HDF5 or MAT"
                left_out.append(f"{file.name}: no reader takes {file.suffix}; {how}")
            continue
        try:
            layout = preview(file)
        except DataError as fault:
            left_out.append(fault.message)
            continue
        layouts.setdefault(repr(layout), (layout, []))[1].append(file)
    home = path.parent if path.is_file() else path
    groups = [
        group
        for layout, members in layouts.values()
        for group in _by_names(members, home, layout, pooled)
    ]
    folders = Counter(group.folder for group in groups)
    groups = [replace(group, alone=folders[group.folder] == 1) for group in groups]
    return sorted(groups, key=lambda group: (-len(group.files), group.files[0])), left_out


def _is_own(file: Path, folder: Path) -> bool:
    """Return True for a file that is neither hidden nor the result of a run."""
    inside = file.relative_to(folder)
    ours = any((folder / parent / "run.json").is_file() for parent in inside.parents)
    return not ours and not any(part.startswith(".") for part in inside.parts)


def _by_names(
    files: Sequence[Path], home: Path, layout: Preview, pooled: str | None
) -> list[Group]:
    """Return files whose names have equally many words, and the same words where these tell groups
    apart and are not `pooled`.
    """
    members: dict[tuple[int, tuple[str, ...]], list[tuple[Path, NameParts]]] = {}
    names = {file: file.relative_to(home).as_posix() for file in files}
    for count in dict.fromkeys(len(words_of(name)) for name in names.values()):
        alike = [file for file in files if len(words_of(names[file])) == count]
        for file, part in zip(alike, read_names([names[file] for file in alike]), strict=True):
            members.setdefault((count, () if pooled else part.group), []).append((file, part))
    groups = []
    for group in members.values():
        paths, parts = zip(*group, strict=True)
        several = len({part.group for part in parts}) > 1
        groups.append(
            Group(paths, parts, layout, of=pooled if several and pooled != "none" else None)
        )
    return groups


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
        if one.files[0].parent == group.files[0].parent
        and len(one.files) == len(group.files)
        and {"time", "pressure"} <= one.quantities
        and one.quantities.isdisjoint({"force", *POSITIONS})
    ]
    return beside[0] if len(beside) == 1 else None


def patterns(files: Sequence[Path], folder: Path) -> list[str]:
    """Globs from `folder` that match these files and no others: one where there is one, else the
    files themselves.

    It is made of the words at which all names begin and end.
    """
    parent = relative_name(files[0].parent, folder)
    where = "" if parent == "." else f"{glob.escape(parent)}/"
    names = [file.name for file in files]
    begin = os.path.commonprefix(names).rstrip("0123456789")  # noqa: RUF071 - of letters
    end = os.path.commonprefix([name[::-1] for name in names])[::-1]  # noqa: RUF071 - of letters
    words = [end[mark.start() :] for mark in re.finditer(r"(?:\.[A-Za-z]\w*)+$|[_\s-]", end)][::-1]
    wanted = {path.resolve() for path in files}
    for start, stop in product((begin, ""), words) if len(files) > 1 else ():
        pattern = f"{where}{glob.escape(start)}*{glob.escape(stop)}"
        if {path.resolve() for path in expand(pattern, folder)} == wanted:
            return [pattern]
    return [relative_name(file, folder) for file in files]


def started(
    group: Group, name: str, folder: Path, quantity: str = "", constants: Sequence[Told] = ()
) -> Draft:
    """Return a draft with the name and the files; those for which the same constant is set share an
    entry.
    """
    layout, count = group.layout, len(group.files)
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
    of_sheets = bool(constants) and count == 1 and bool(layout.told)
    if layout.sheets or of_sheets:
        draft = draft.without("data.sheet")
    if layout.left:
        why = f"laid out in another way, and left out: {', '.join(map(repr, layout.left))}"
        draft = draft.noted(("data", "sheet" if "sheet" in draft.data else "reader"), why)
    specimens = group.specimens if group.of else [(0, "")] * count
    if of_sheets:
        one_each = zip(layout.told, constants, strict=True)
        parts = [(group.files[0], sheet, told, specimens[0]) for sheet, told in one_each]
    else:
        known = zip(group.files, constants or [Told()] * count, specimens, strict=True)
        sheets = layout.sheets or ("",)
        parts = [(file, sheet, told, one) for file, told, one in known for sheet in sheets]
    members: dict[tuple[Told, tuple[int, str], str], list[Path]] = {}
    for file, sheet, told, specimen in sorted(parts, key=itemgetter(2, 3)):
        members.setdefault((told, specimen, sheet), []).append(file)
    entries: list[Any] = []
    for (told, (number, word), sheet), files in members.items():
        values = {quantity: told.value} if constants else {}
        values |= {group.of: number} if group.of else {}
        whys = [told.why, f"'{word}' is {group.of} {number}" if group.of else ""]
        draft = draft.noted(
            ("data", "files", len(entries)), "; ".join(filter(None, whys)) or None, not constants
        )
        more = {"sheet": sheet, "set": values}
        more = {key: value for key, value in more.items() if value}
        paths = patterns(files, folder)
        entries += [{"path": path, **more} for path in paths] if more else paths
    draft = draft.with_data("files", entries)
    if group.of is None:
        return draft
    return draft.with_data("groups", {"of": group.of}, "each is scored by itself")
