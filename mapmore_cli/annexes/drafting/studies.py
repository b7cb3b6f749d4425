"""Find out which files form a study: all files of one layout, in whatever folders they lie."""

from __future__ import annotations

import filecmp
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from mapmore_cli.annexes.drafting.columns import read_titles
from mapmore_cli.annexes.drafting.draft import Column, Named, Section
from mapmore_cli.annexes.drafting.first_lines import HEAD, comment_among, kinds_of_lines, unread
from mapmore_cli.annexes.drafting.layout import FileLayout
from mapmore_cli.annexes.drafting.names import stem_of
from mapmore_cli.annexes.drafting.preview import preview
from mapmore_cli.annexes.drafting.spelling import words
from mapmore_cli.annexes.drafting.titles import name_in
from mapmore_cli.checking.names import read_label
from mapmore_cli.domain.errors import DataError
from mapmore_cli.ingestion.globs import relative_name
from mapmore_cli.storage.readers import READERS, reader_of
from mapmore_cli.storage.run_record import holds_results
from mapmore_cli.study.loader import SCHEMA
from mapmore_cli.study.units import CANONICAL

_FOR_SENSORS = {"tare", "tara", "calibration", "kalibrierung"}
"""Words in names of files that were recorded to find the zero or the scale of a sensor."""


@dataclass(frozen=True)
class FolderStudy:
    """Files with the same layout, and a name for them.

    - `bad`: the files of the folder that belong to no study, with the reasons.
    - `variants`: the layouts of the files whose columns have other units or another order, for
      example bar if most files have kPa.
    - `above`: the words above each table of a file.
    """

    files: tuple[Path, ...]
    layout: FileLayout
    name: str = ""
    bad: Mapping[Path, str] = field(default_factory=dict)
    variants: Mapping[Path, FileLayout] = field(default_factory=dict)
    above: Mapping[Path, Sequence[str]] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{len(self.files)} file{'s' if len(self.files) > 1 else ''}"

    @cached_property
    def folder(self) -> Path:
        """The folder that contains all files."""
        return Path(os.path.commonpath([file.parent for file in self.files]))

    @property
    def of_layout(self) -> FolderStudy:
        """The study without the files in `variants`, so that all its files have exactly the same
        `layout`.
        """
        files = tuple(file for file in self.files if file not in self.variants)
        return replace(self, files=files, variants={})

    def changed_columns(self, columns: Named) -> dict[Path, Section]:
        """Return the entries of `columns` that single files need, by file, because the titles or
        units of their columns differ from those of most files. A file in which only the order of
        the columns differs needs no entries.
        """
        of_layouts = {
            id(layout): self._columns_of(layout, columns) for layout in self.variants.values()
        }
        changed = {file: of_layouts[id(layout)] for file, layout in self.variants.items()}
        return {file: entries for file, entries in changed.items() if entries}

    def _columns_of(self, layout: FileLayout, columns: Named) -> Section:
        """Return the entries of `columns` that a file with this `layout` needs, because its titles
        or units differ from those of most files.
        """
        usual, titled = _identities(self.layout), read_titles(self.layout, {})
        there = {identity: column for column, identity in _identities(layout).items()}
        titled_there = read_titles(layout, {})
        changed: Section = {}
        for name, column in columns.items():
            if (identity := usual.get(column.column)) is not None and not column.parts:
                other = titled_there[there[identity]]
                if (other.column, other.unit) != (column.column, titled[column.column].unit):
                    entry = replace(column, column=other.column).as_spec()
                    changed[name] = {**entry, "unit": other.unit or column.unit}
        return changed

    @cached_property
    def parts(self) -> list[tuple[Path, Section]]:
        """The file of every recording, and the sheet or table of the file that holds the recording.
        The sheet is given if the names of sheets contain information. The number of the table is
        given if a file holds several tables.
        """
        if self.layout.tables:
            places: list[Section] = [{"table": at} for at in self.layout.tables]
        else:
            is_told = len(self.files) == 1 or self.layout.left
            places = [{"sheet": sheet} for sheet in (is_told and self.layout.alike) or ()]
        return [(file, place) for file in self.files for place in places or [{}]]

    @cached_property
    def names(self) -> list[str]:
        """Text that distinguishes each recording from the others. If there are several files, the
        text is the path of the file in the folder. If all recordings are in one file, the text is
        the sheet or the text above the table. For tables in several files, the text contains both.
        """
        is_one = len(self.files) == 1
        stems = {file: stem_of(relative_name(file, self.folder)) for file in self.files}
        names = []
        for file, place in self.parts:
            titles = dict(zip(self.layout.tables, self.above[file], strict=True))
            title = titles.get(place.get("table", 0), "")
            if is_one:
                title = title or place.get("sheet", "")
            names.append(title if is_one and title else f"{stems[file]} {title}".strip())
        return names

    @property
    def quantities(self) -> set[str]:
        """Names of the quantities that titles of the study's columns identify."""
        labels = map(read_label, self.layout.titles)
        return {label.quantity for label in labels if label is not None}


def find_studies(path: Path) -> tuple[list[FolderStudy], list[str]]:
    """Return the studies under a path, the study with the most files first. Also return, for every
    file that belongs to no study, the reason why it is left out, with the remedy.

    Raises DataError if the path does not exist.
    """
    if not path.exists():
        raise DataError(
            f"{path}: no such file or folder", "give a recording, or a folder of recordings"
        )
    inside = (
        inner for inner in sorted(path.rglob("*")) if inner.is_file() and _is_own(inner, path)
    )
    every = [path] if path.is_file() else [*inside]
    readable = [file for file in every if file == path or reader_of(file) is not None]
    copies = _copies(readable)  # a copy of an unreadable file need not be found
    root = path if path.is_dir() else path.parent
    names = {file: relative_name(file, root) for file in readable}
    for_sensors = [file for file in readable if _FOR_SENSORS & {*words(stem_of(file.name))}]
    if len(for_sensors) == len(readable):
        for_sensors = []  # if all files have such names, they are the tests
    bad = {
        copy: f"{names[copy]}: has the same contents as {names[file]}"
        for copy, file in copies.items()
    } | {
        file: f"{names[file]}: was recorded for a sensor, as its name says; write what it shows as "
        "`scale` and `offset` of a column, or rename it if it is a test"
        for file in for_sensors
    }
    layouts, faults = _layouts_of([file for file in readable if file not in bad])
    bad |= faults
    others = {file: why for file in {*every} - {*readable} if (why := unread(file))}
    studies = [replace(study, bad=bad) for study in _joined(layouts)]
    studies.sort(key=lambda study: (-len(study.files), study.files[0]))
    folders = [study.folder for study in studies]
    named = [
        replace(study, name=_name(study, folders.count(study.folder) == 1)) for study in studies
    ]
    reasons = bad | others
    return named, [reasons[file] for file in every if file in reasons]


def _layouts_of(files: Iterable[Path]) -> tuple[dict[Path, FileLayout], dict[Path, str]]:
    """Return the layout of each file, and the reasons why other files have none. If several text
    files have the same kinds of lines, only the first is examined, and the others get its layout.
    """
    layouts: dict[Path, FileLayout] = {}
    faults: dict[Path, str] = {}
    seen: dict[tuple[str, tuple[bytes, ...]], FileLayout] = {}
    for file in files:
        try:
            like = (file.suffix, kinds_of_lines(file))
            layout = seen[like] if like in seen and like[1] else preview(file)
        except DataError as fault:
            faults[file] = fault.message
            continue
        # files with several tables can have equal first lines, but different layouts
        if not layout.tables:
            seen[like] = layout
        layouts[file] = layout
    return layouts, faults


def _copies(files: Iterable[Path]) -> dict[Path, Path]:
    """Return the files that are copies, each with its original. If several files have the same
    contents, the file with the shortest name is the original, and the others are its copies. Empty
    files are not compared.
    """
    by_size: dict[int, list[Path]] = {}
    for file in sorted(files, key=lambda file: (len(file.name), file)):
        by_size.setdefault(file.stat().st_size, []).append(file)
    first: dict[tuple[int, int], Path] = {}
    copies: dict[Path, Path] = {}
    for size, alike in by_size.items():
        for file in alike if size and len(alike) > 1 else ():
            with file.open("rb") as contents:
                other = first.setdefault((size, hash(contents.read(HEAD))), file)
            if other is not file and filecmp.cmp(file, other, shallow=False):
                copies[file] = other
    return copies


def _with_comments(layout: FileLayout, files: Sequence[Path]) -> FileLayout:
    """Return the layout. If a text has comment lines between its rows, the layout also holds the
    characters with which comment lines begin.
    """
    if "comment" not in READERS[layout.reader].keys or layout.tables:
        return layout
    marks = (comment_among(file, layout) for file in files)
    mark = next((mark for mark in marks if mark is not None), None)
    return replace(layout, settings=layout.settings | ({"comment": mark} if mark else {}))


Identity = tuple[str | int, ...]
"""What identifies a column in all files of a study: its name, its quantity and, if all files must
have the same unit, its unit.
"""


def _identities(layout: FileLayout) -> dict[Column, Identity]:
    """Return an identity for each column of numbers. If two files differ only in units or in the
    order of columns, a column of one file corresponds to the column with the equal identity in the
    other.

    The identity consists of the name, the quantity and the unit of the column. For a known
    quantity, the identity only says whether there is a unit, because units of a known quantity can
    be converted. The position of the column is added if some titles are missing or equal.
    """
    columns = [
        column for column in read_titles(layout, {}).values() if column.place in layout.numeric
    ]
    identities: list[Identity] = [
        (
            name_in(column.title),
            column.quantity,
            column.unit if column.quantity not in CANONICAL else bool(column.unit),
        )
        for column in columns
    ]
    is_by_title = all(isinstance(column.column, str) for column in columns)
    if not is_by_title or len({*identities}) < len(identities):
        identities = [
            (*identity, column.place) for column, identity in zip(columns, identities, strict=True)
        ]
    return dict(zip([column.column for column in columns], identities, strict=True))


def _joined(layouts: Mapping[Path, FileLayout]) -> list[FolderStudy]:
    """Return a study for each layout, with its files. Layouts that differ only in the units in
    their titles, or in the order of the columns, form one study. Its `layout` is the one that the
    largest number of its files have.
    """
    alike: dict[str, list[Path]] = {}
    for file, layout in layouts.items():
        alike.setdefault(repr(layout), []).append(file)
    families: dict[str, list[tuple[FileLayout, list[Path]]]] = {}
    for files in alike.values():
        layout = _with_comments(layouts[files[0]], files)
        identities = sorted(_identities(layout).values(), key=repr)
        bare = replace(layout, columns=(), titles=(), units=())
        families.setdefault(repr((bare, identities)), []).append((layout, files))
    studies = []
    for family in families.values():
        (layout, _), *others = sorted(family, key=lambda variant: -len(variant[1]))
        variants = {file: other for other, files in others for file in files}
        files = sorted(file for _, some in family for file in some)
        above = {file: layouts[file].above for file in files}
        studies.append(FolderStudy(tuple(files), layout, variants=variants, above=above))
    return studies


def _is_own(file: Path, folder: Path) -> bool:
    """Return True for a file that may hold data. Return False for hidden files, for files that
    office programs or file managers leave behind, for results of runs, and for the schema that
    `init` writes for editors.
    """
    inside = file.relative_to(folder)
    ours = any(holds_results(folder / parent) for parent in inside.parents)
    hidden = any(part.startswith((".", "~$")) for part in inside.parts)
    return not (ours or hidden or file.name.casefold() in ("thumbs.db", "desktop.ini", SCHEMA))


def _name(study: FolderStudy, alone: bool) -> str:
    """Return a name for a study. It consists of the words that the names of all its files contain
    at the same position. If there are no such words, or if the study has several files and is the
    only one in its folder (`alone`), it is the name of the folder.
    """
    stems = [re.split(r"[_\s/]+", stem_of(file.name)) for file in study.files]
    common = [words[0] for words in zip(*stems, strict=False) if len(set(words)) == 1]
    is_whole = (alone and len(study.files) > 1) or not common
    return re.sub(
        r"[^A-Za-z0-9._-]+", "-", study.folder.resolve().name if is_whole else "_".join(common)
    ).strip("._-")[:80]
