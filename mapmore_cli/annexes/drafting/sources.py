"""Find out which files form a study, and write the `files` of its spec.

A study consists of all files of one layout, in whatever folders they lie.
"""

from __future__ import annotations

import glob
import hashlib
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from mapmore_cli.annexes.drafting.columns import read_titles
from mapmore_cli.annexes.drafting.draft import Column, Draft, Named, Section
from mapmore_cli.annexes.drafting.names import Condition, stem_of
from mapmore_cli.annexes.drafting.preview import (
    Preview,
    comment_among,
    kinds_of_lines,
    preview,
    unread,
)
from mapmore_cli.checking.names import POSITIONS, read_label
from mapmore_cli.domain.errors import DataError
from mapmore_cli.ingestion.files import expand, relative_name
from mapmore_cli.storage.readers import READERS, reader_of
from mapmore_cli.study.units import CANONICAL


@dataclass(frozen=True)
class Study:
    """Files of one layout, and a name for them. `bad` are the files of the folder that belong to no
    study, with the reasons.

    `variants` are the layouts of files with other units, for example bar if most files have kPa.
    """

    files: tuple[Path, ...]
    layout: Preview
    name: str = ""
    bad: Mapping[Path, str] = field(default_factory=dict)
    variants: Mapping[Path, Preview] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{len(self.files)} file{'s' if len(self.files) > 1 else ''}"

    @cached_property
    def folder(self) -> Path:
        """The folder that contains all files."""
        return Path(os.path.commonpath([file.parent for file in self.files]))

    @property
    def of_layout(self) -> Study:
        """The study with only the files whose layout is exactly `layout`, without the variants."""
        files = tuple(file for file in self.files if file not in self.variants)
        return replace(self, files=files, variants={})

    def changed_columns(self, columns: Named) -> dict[Path, Section]:
        """Return, for each file whose titles or units differ from those of the other files, its own
        entries of `columns`. Files in which columns only stand in another order have none.
        """
        of_layouts = {id(one): self._columns_of(one, columns) for one in self.variants.values()}
        changed = {file: of_layouts[id(layout)] for file, layout in self.variants.items()}
        return {file: entries for file, entries in changed.items() if entries}

    def _columns_of(self, layout: Preview, columns: Named) -> Section:
        """Return the entries of `columns` that differ in another layout."""
        usual, titled = _identities(self.layout), read_titles(self.layout, {})
        there = {identity: column for column, identity in _identities(layout).items()}
        titled_there = read_titles(layout, {})
        changed: Section = {}
        for name, one in columns.items():
            if (identity := usual.get(one.column)) is not None and not one.parts:
                other = titled_there[there[identity]]
                if (other.column, other.unit) != (one.column, titled[one.column].unit):
                    entry = replace(one, column=other.column).as_spec()
                    changed[name] = {**entry, "unit": other.unit or one.unit}
        return changed

    @cached_property
    def parts(self) -> list[tuple[Path, Section]]:
        """The file of every recording, and the sheet or table of the file that holds the recording.
        The sheet is given if the names of sheets contain information; the table, if there are
        several.
        """
        if self.layout.tables:
            places: list[Section] = [{"table": at} for at, _ in self.layout.tables]
        else:
            is_told = len(self.files) == 1 or self.layout.left
            places = [{"sheet": sheet} for sheet in (is_told and self.layout.alike) or ()]
        return [(file, place) for file in self.files for place in places or [{}]]

    @cached_property
    def names(self) -> list[str]:
        """The name of each recording: its path in the folder; for a single file, its sheet or the
        text above its table; both if tables are in several files.
        """
        titles, is_one = dict(self.layout.tables), len(self.files) == 1
        stems = {file: stem_of(relative_name(file, self.folder)) for file in self.files}
        names = []
        for file, place in self.parts:
            title = titles.get(place.get("table", 0), "") if is_one or titles else ""
            title = title or (place.get("sheet", "") if is_one else "")
            names.append(title if is_one and title else f"{stems[file]} {title}".strip())
        return names

    @property
    def quantities(self) -> set[str]:
        """Names of the quantities that titles of the study's columns identify."""
        labels = map(read_label, self.layout.titles)
        return {label.quantity for label in labels if label is not None}


def find_studies(path: Path) -> tuple[list[Study], list[str]]:
    """Return the studies under a path, the one with the most files first, and for every other file
    the reason why it is left out, with the remedy.

    Raises DataError if the path does not exist.
    """
    if not path.exists():
        raise DataError(
            f"{path}: no such file or folder", "give a recording, or a folder of recordings"
        )
    every = [path] if path.is_file() else [one for one in sorted(path.rglob("*")) if one.is_file()]
    left_out: list[str] = []
    bad: dict[Path, str] = {}
    copies = _copies(every)
    seen: dict[tuple[str, tuple[bytes, ...]], Preview] = {}
    layouts: dict[str, tuple[Preview, list[Path]]] = {}
    for file in (one for one in every if one == path or _is_own(one, path)):
        if file != path and reader_of(file) is None:
            left_out += filter(None, [unread(file)])
            continue
        if file in copies:
            left_out.append(f"{file.name}: has the same contents as {copies[file].name}")
            bad[file] = "has the same contents as another file"
            continue
        try:
            like = (file.suffix, kinds_of_lines(file))
            layout = seen[like] if like in seen and like[1] else preview(file)
        except DataError as fault:
            left_out.append(fault.message)
            bad[file] = "holds no table that could be read"
            continue
        seen[like] = layout
        kind = repr(replace(layout, numeric=()))
        layouts.setdefault(kind, (layout, []))[1].append(file)
    commented = [(_with_comments(layout, files), files) for layout, files in layouts.values()]
    studies = [replace(one, bad=bad) for one in _joined(commented)]
    studies.sort(key=lambda study: (-len(study.files), study.files[0]))
    folders = [study.folder for study in studies]
    named = (replace(one, name=_name(one, folders.count(one.folder) == 1)) for one in studies)
    return [*named], left_out


def _copies(files: Sequence[Path]) -> dict[Path, Path]:
    """Return the files that have the same contents as another file, with that file, which has the
    shorter name. Empty files are no copies.
    """
    by_size: dict[int, list[Path]] = {}
    for file in sorted(files, key=lambda file: (len(file.name), file)):
        by_size.setdefault(file.stat().st_size, []).append(file)
    first: dict[bytes, Path] = {}
    copies: dict[Path, Path] = {}
    for size, alike in by_size.items():
        for file in alike if size and len(alike) > 1 else ():
            with file.open("rb") as contents:
                digest = hashlib.file_digest(contents, "blake2b").digest()
            if digest in first:
                copies[file] = first[digest]
            first.setdefault(digest, file)
    return copies


def _with_comments(layout: Preview, files: Sequence[Path]) -> Preview:
    """Return the layout with the mark of comment lines, if a text has such lines between its
    rows.
    """
    if "comment" not in READERS[layout.reader].keys or layout.tables:
        return layout
    marks = (comment_among(file, layout) for file in files)
    mark = next((mark for mark in marks if mark is not None), None)
    return replace(layout, settings=layout.settings | ({"comment": mark} if mark else {}))


Identity = tuple[str | int, ...]
"""What is equal in the titles of a column in all files of a study."""


def _identities(layout: Preview) -> dict[Column, Identity]:
    """Return what identifies each column of numbers in files with other units or another order of
    columns: its quantity, its name, and its unit unless all units of the quantity can be converted.
    The place of a column is added if some titles are missing or equal.
    """
    columns = [one for one in read_titles(layout, {}).values() if one.place in layout.numeric]
    identities: list[Identity] = [
        (
            one.title_as_name,
            one.quantity,
            one.unit if one.quantity not in CANONICAL else bool(one.unit),
        )
        for one in columns
    ]
    is_by_title = all(isinstance(one.column, str) for one in columns)
    if not is_by_title or len({*identities}) < len(identities):
        identities = [(*one, place) for place, one in enumerate(identities)]
    return dict(zip([one.column for one in columns], identities, strict=True))


def _joined(layouts: Sequence[tuple[Preview, list[Path]]]) -> list[Study]:
    """Return a study for each layout, with its files. Layouts that differ only in the units of
    their titles, or in the order of the columns, form one study, for which the layout of the most
    files is used.
    """
    families: dict[str, list[tuple[Preview, list[Path]]]] = {}
    for layout, files in layouts:
        identities = sorted(_identities(layout).values(), key=repr)
        bare = replace(layout, columns=(), titles=(), units=(), numeric=())
        families.setdefault(repr((bare, identities)), []).append((layout, files))
    studies = []
    for family in families.values():
        (layout, _), *others = sorted(family, key=lambda one: -len(one[1]))
        variants = {file: other for other, files in others for file in files}
        files = sorted(file for _, some in family for file in some)
        studies.append(Study(tuple(files), layout, variants=variants))
    return studies


def _is_own(file: Path, folder: Path) -> bool:
    """Return True for a file that is neither hidden, nor left by an office program or a file
    manager, nor the result of a run.
    """
    inside = file.relative_to(folder)
    ours = any((folder / parent / "run.json").is_file() for parent in inside.parents)
    hidden = any(part.startswith((".", "~$")) for part in inside.parts)
    return not (ours or hidden or file.name.casefold() in ("thumbs.db", "desktop.ini"))


def _name(study: Study, alone: bool) -> str:
    """Return a name for a study: the name of the folder if it contains no other study, otherwise
    the words that all names of its files share.
    """
    stems = [re.split(r"[_\s/]+", stem_of(file.name)) for file in study.files]
    common = [words[0] for words in zip(*stems, strict=False) if len(set(words)) == 1]
    is_whole = (alone and len(study.files) > 1) or not common
    return re.sub(
        r"[^A-Za-z0-9._-]+", "-", study.folder.resolve().name if is_whole else "_".join(common)
    ).strip("._-")[:80]


def second_of(study: Study, studies: Sequence[Study]) -> Study | None:
    """Return the log with the pressure of the same tests: the only other layout in the folder whose
    titles name the pressure and that has as many files.

    None if the study has its own pressure, or if more than one other is possible.
    """
    beside = [
        one
        for one in studies
        if (one.folder, len(one.files)) == (study.folder, len(study.files))
        and {"time", "pressure"} <= one.quantities
        and one.quantities.isdisjoint({"force", *POSITIONS})
    ]
    is_lacking = "time" in study.quantities and "pressure" not in study.quantities
    return beside[0] if is_lacking and len(beside) == 1 else None


def patterns(files: Sequence[Path], folder: Path, bad: Iterable[Path] = ()) -> list[str]:
    """Return a list with one glob, relative to `folder`, that matches all `files` and at most `bad`
    files besides. If there is no such glob, return the names of all files.

    In the glob, each folder or file is given by the words with which all its names begin and end.
    """
    names = [relative_name(file, folder) for file in files]
    steps = [name.split("/") for name in names]
    if len(files) > 1 and len({len(step) for step in steps}) == 1:
        one = "/".join(_glob_of(sorted({*parts})) for parts in zip(*steps, strict=True))
        found = _resolved(expand(one, folder, may_be_empty=True))
        if found - _resolved(bad) == _resolved(files):
            return [one]
    return names


def _resolved(files: Iterable[Path]) -> set[tuple[Path, str]]:
    """Return the resolved folder and the name of each file, which are the same however the path is
    written. Only the folders are resolved, because there may be thousands of files.
    """
    members: dict[Path, list[str]] = {}
    for file in files:
        members.setdefault(file.parent, []).append(file.name)
    return {
        (whole, name)
        for folder, names in members.items()
        for whole in [folder.resolve()]
        for name in names
    }


def _glob_of(parts: Sequence[str]) -> str:
    """Return a glob of the names of one folder or file in all paths."""
    if len(parts) == 1:
        return glob.escape(parts[0]) if parts[0] != ".." else ".."
    begin = os.path.commonprefix(parts).rstrip("0123456789")  # noqa: RUF071 - of letters
    end = os.path.commonprefix([part[::-1] for part in parts])[::-1]  # noqa: RUF071 - of letters
    mark = re.search(r"[_\s-]|(?:\.[A-Za-z]\w*)+$", end)
    return f"{glob.escape(begin)}*{glob.escape(end[mark.start() :]) if mark else ''}"


def started(
    study: Study,
    folder: Path,
    conditions: Sequence[Condition] = (),
    remark: str = "",
    columns: Named | None = None,
) -> Draft:
    """Return a draft with the name and the files; recordings for which the same values are set
    share an entry. Files with other units have `columns` of their own.

    `remark` is about numbers in names that only count repetitions.
    """
    layout = study.layout
    data: Section = {"files": [], "reader": layout.reader, **layout.settings}
    draft = Draft({"schema_version": 1, "name": study.name, "data": data}, files=len(study.files))
    if not layout.settings.get("header", True):
        draft = draft.noted(("data", "header"), "the first line holds numbers")
    if "sample_time" in layout.settings:
        draft = draft.noted(("data", "sample_time"), "s: as the file says")
    is_by_part = bool(layout.tables) or (
        bool(study.parts[0][1]) and bool(conditions or layout.left)
    )
    if is_by_part and not layout.tables:
        draft = draft.without_data("sheet")
    if layout.is_map:
        draft = draft.noted(("data", "table"), "a map: each cell is a sample")
    if layout.left:
        why = f"left out because their layout differs: {', '.join(map(repr, layout.left))}"
        draft = draft.noted(("data", "sheet" if "sheet" in draft.data else "reader"), why)
    entries = _file_entries(study, folder, conditions, is_by_part, columns or {})
    draft = draft.with_data("files", entries)
    named = {one if isinstance(one, str) else one["path"] for one in entries}
    globs = [one for one in named if glob.has_magic(one)] if study.bad else []
    matched = {place for one in globs for place in _resolved(expand(one, folder, True))}
    bad = {
        relative_name(file, folder): reason
        for file, reason in study.bad.items()
        if matched & _resolved([file])
    }
    if bad:
        why = "; ".join(f"{name} {reason}" for name, reason in sorted(bad.items()))
        draft = draft.with_data("skip_bad_files", sorted(bad), why)
    reasons = [f"names: {', '.join(one.why for one in conditions)}"] if conditions else []
    if changed := study.changed_columns(columns or {}):
        reasons.append(f"{len(changed)} of {len(study.files)} files have other names or units")
    if layout.tables:
        reasons.append(f"each of the {len(layout.tables)} tables in a file is a recording")
    if reasons or remark:
        why = "; ".join(filter(None, [*reasons, remark]))
        draft = draft.noted(("data", "files"), why, all(one.sure for one in conditions))
    return draft


def _file_entries(
    study: Study,
    folder: Path,
    conditions: Sequence[Condition],
    is_by_part: bool,
    columns: Named,
) -> list[Any]:
    """Return the `files` of a spec: globs, with the sheet or the table, and the values from
    names.
    """
    values = [one.in_model_units for one in conditions]
    changed = study.changed_columns(columns)
    members: dict[tuple[Any, ...], list[Path]] = {}
    for at, (file, place) in enumerate(study.parts):
        part = tuple(place.items() if is_by_part else ())
        kind = (part, repr(changed.get(file)), tuple(series[at] for series in values))
        members.setdefault(kind, []).append(file)
    entries: list[Any] = []
    for (part, _, numbers), files in members.items():
        more: Section = dict(part)
        if files[0] in changed:
            more["columns"] = changed[files[0]]
        if numbers:
            more["set"] = dict(zip((one.quantity for one in conditions), numbers, strict=True))
        paths = patterns(list(dict.fromkeys(files)), folder, study.bad)
        entries += [{"path": path, **more} for path in paths] if more else paths
    return entries
