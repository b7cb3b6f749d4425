"""Which files belong to one study, by their layout and by what their names say."""

from __future__ import annotations

import glob
import os
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from mapmore_cli.domain.errors import DataError
from mapmore_cli.ingestion.files import expand, relative_name
from mapmore_cli.storage.readers import READERS, reader_of, suffix_of
from mapmore_cli.storage.tables.lines import lines_of
from mapmore_cli.study.drafting.preview import UNIT, Preview, preview, shared_start

_REPEAT = re.compile(r"(?:test|run|rep|repeat|trial|take|try|no|nr|cycle)?\d{1,2}", re.IGNORECASE)
_REPEAT_WORD = re.compile(r"test|run|rep|repeat|trial|take|try|no|nr", re.IGNORECASE)
_SPECIMEN = re.compile(r"(?:specimens?|samples?|muscles?|actuators?|prototypes?|devices?|units?|dut|pam|s)", re.IGNORECASE)
_NUMBERED = re.compile(rf"{_SPECIMEN.pattern}[-#.]?(?:\d{{1,3}}|[a-z])", re.IGNORECASE)
_SIZE = re.compile(r"\d+(?:[.,]\d+)?(?:mm|cm|m|in)", re.IGNORECASE)
_NUMBER = re.compile(rf"(\d+(?:[.,]\d+)?)\s*(?:{UNIT}|(?![a-z0-9]))", re.IGNORECASE)


@dataclass(frozen=True)
class NameParts:
    """What one name says among the others.

    `group` holds the words that tell studies apart (sizes of a muscle, kinds), `condition` the one that may say what was held; `is_repeat`
    says whether a number of a repeat is part of it.
    """

    group: tuple[str, ...]
    condition: str | None
    is_repeat: bool


def words_of(name: str) -> list[str]:
    """Return the words of a file's name, without its suffixes, after those of the folder before it; `10 psi` is one word."""
    stem = name[:-3] if name.casefold().endswith(".gz") else name
    stem = stem[: len(stem) - len(suffix_of(Path(name)))]
    stem = re.sub(rf"(?<=\d)\s+(?={UNIT})", "", stem, flags=re.IGNORECASE)
    return [word for word in re.split(r"[_\s/]+", stem) if word]


def read_names(names: Sequence[str]) -> list[NameParts]:
    """Compare names word by word; where they have different numbers of words they say nothing.

    Among the words that vary, specimens (`S1`, `muscleA`, `Sample 2`), sizes (`10cm`) and words without numbers tell groups apart, `Test8`
    is a repeat, and the last one of the others that some of the names have a number in is the condition; one with a unit comes first.
    """
    split = [words_of(name) for name in names]
    if len({len(words) for words in split}) != 1:
        return [NameParts((), None, False) for _ in names]
    kinds = [
        "constant" if len(set(column)) == 1 else _kind(column, split[0][:place]) for place, column in enumerate(zip(*split, strict=True))
    ]
    numbered = [place for place, kind in enumerate(kinds) if kind == "condition"]
    united = [place for place in numbered if all((number_in(words[place]) or (0.0, None))[1] for words in split)]
    held = (united or numbered)[-1] if numbered else None
    return [
        NameParts(
            tuple(word for word, kind in zip(words, kinds, strict=True) if kind == "group"),
            None if held is None else words[held],
            "repeat" in kinds,
        )
        for words in split
    ]


def number_in(word: str) -> tuple[float, str | None] | None:
    """Return the number of a word with its unit of pressure or length, or `%`: (25, None) of `kinked25`, (19, "mm") of `kinked19mm2`."""
    found = _NUMBER.search(word)
    if found is None:
        return None
    units = {"kpa": "kPa", "pa": "Pa", "mpa": "MPa", "pct": "%", "percent": "%"}
    return float(found[1].replace(",", ".")), units.get(found[2].casefold(), found[2].casefold()) if found[2] else None


TRAINS = re.compile(r"train|training|estimation|identification", re.IGNORECASE)
TESTS = re.compile(r"test|testing|val|valid|validation", re.IGNORECASE)


def tests_of(files: Sequence[Path]) -> list[Path]:
    """Return the files whose names say `test` or `validation`, where all others say `train`; else none."""
    words = {file: words_of(file.name) for file in files}
    tests = [file for file in files if any(map(TESTS.fullmatch, words[file]))]
    trains = [file for file in files if any(map(TRAINS.fullmatch, words[file]))]
    return tests if tests and trains and len(tests) + len(trains) == len(files) and not {*tests} & {*trains} else []


def _kind(column: Sequence[str], before: Sequence[str]) -> str:
    if all(TRAINS.fullmatch(word) or TESTS.fullmatch(word) for word in column):
        return "repeat"
    if all(_REPEAT.fullmatch(word) and (not word.isdigit() or _follows_repeat_word(before)) for word in column):
        return "repeat"
    if all(_SIZE.fullmatch(word) for word in column) or _numbers_specimens(column, before):
        return "group"
    return "condition" if any(number_in(word) for word in column) else "group"


def _numbers_specimens(column: Sequence[str], before: Sequence[str]) -> bool:
    """Return True for `S1` and `S2`, and for `1` and `2` behind `Sample`."""
    behind = bool(before) and _SPECIMEN.fullmatch(before[-1].rstrip("-#.")) is not None
    return all(_NUMBERED.fullmatch(word) for word in column) or (behind and all(re.fullmatch(r"\d{1,3}|[A-Za-z]", word) for word in column))


def _follows_repeat_word(before: Sequence[str]) -> bool:
    return bool(before) and _REPEAT_WORD.fullmatch(before[-1]) is not None


@dataclass(frozen=True)
class Group:
    """Files of one layout with what their names say; `alone` where the folder has no other group.

    `beside` is the file whose one column belongs beside the one column of this. `of` is the quantity that numbers specimens which are one
    study.
    """

    files: tuple[Path, ...]
    names: tuple[NameParts, ...]
    layout: Preview
    alone: bool = True
    beside: Group | None = None
    of: str | None = None

    @property
    def folder(self) -> Path:
        """The folder that all files are in."""
        return Path(os.path.commonpath([file.parent for file in self.files]))

    @property
    def specimens(self) -> list[tuple[int, str]]:
        """The number of the specimen of every file, and the words of its name that tell it from others."""
        words = [" ".join(part.group) for part in self.names]
        return [(sorted(set(words)).index(word) + 1, word) for word in words]

    @property
    def label(self) -> str:
        """A name for the study: that of the folder where it has no other, else the words that all its files share."""
        names = [words_of(path.relative_to(self.folder).as_posix()) for path in self.files]
        common = [column[0] for column in zip(*names, strict=True) if len(set(column)) == 1]
        return self.folder.name if (self.alone and len(self.files) > 1) or not common else "_".join(common)


def find_groups(path: Path, pooled: str | None = None) -> tuple[list[Group], list[str]]:
    """Return the groups of files under a path, the largest first, and for every other file why it is left out.

    What names tell apart is a group of its own, unless `pooled` names the quantity that numbers it, or is `none`.

    Raises DataError where the path does not exist.
    """
    if not path.exists():
        raise DataError(f"{path}: no such file or folder", "give a recording, or a folder of recordings")
    files = [path] if path.is_file() else sorted(file for file in path.rglob("*") if _is_recording(file, path))
    homes = _homes(files)
    left_out = []
    columns: dict[Path, Preview] = {}
    layouts: dict[tuple[Path, str], tuple[Preview, list[Path]]] = {}
    for file in files:
        try:
            layout = preview(file)
        except DataError as fault:
            try:
                columns[file] = preview(file, least=1)
            except DataError:
                left_out.append(fault.message)
            continue
        layouts.setdefault((homes[file.parent], repr(layout)), (layout, []))[1].append(file)
    groups = [group for (home, _), (layout, members) in layouts.items() for group in _by_names(members, home, layout, pooled)]
    pairs = _pairs(columns)
    paired = {file for group in pairs for file in (*group.files, *(group.beside.files if group.beside else ()))}
    left_out += [f"{file.name}: no reader takes {file.suffix}; save it as CSV, HDF5 or MAT" for file in _of_data(path)]
    left_out += [f"{file.name}: a single column, and no other of as many rows beside it" for file in columns if file not in paired]
    groups += pairs
    folders = Counter(group.folder for group in groups)
    groups = [replace(group, alone=folders[group.folder] == 1) for group in groups]
    return sorted(groups, key=lambda group: (-len(group.files), group.files[0])), left_out


def _homes(files: Sequence[Path]) -> dict[Path, Path]:
    """Every folder with itself; with the one above it where folders side by side tell what was held, as `10 psi` and `20 psi`."""
    folders = {file.parent for file in files}
    told = {one: number for one in folders if (number := number_in(one.name)) is not None and number[1] is not None}
    levels = Counter(one.parent for one in told)
    return {one: one.parent if one in told and levels[one.parent] > 1 else one for one in folders}


def _pairs(columns: Mapping[Path, Preview]) -> list[Group]:
    """Two files of a single column in one folder, of as many lines: the first one by its name, with the other beside it."""
    found = []
    for folder in dict.fromkeys(file.parent for file in columns):
        files = sorted(file for file in columns if file.parent == folder and reader_of(file) == READERS["csv"])
        if len(files) == 2 and (count := _lines(files[0])) is not None and count == _lines(files[1]):
            first, other = (Group((file,), (NameParts((), None, False),), columns[file]) for file in files)
            found.append(replace(first, beside=other))
    return found


def _lines(file: Path) -> int | None:
    """Return the number of lines; None of a damaged file."""
    try:
        return sum(1 for _ in lines_of(file))
    except DataError:
        return None


UNREAD = (".npz", ".npy", ".json", ".parquet", ".feather", ".pkl", ".pickle", ".xls", ".ods", ".bag", ".db3", ".mcap", ".sqlite")
"""Suffixes of files that may hold data, which no reader takes."""


def _of_data(path: Path) -> list[Path]:
    """Return the files under a path that may hold data, and that no reader takes."""
    files = [path] if path.is_file() else sorted(path.rglob("*"))
    inside = [file for file in files if file.suffix.casefold() in UNREAD and reader_of(file) is None]
    return [file for file in inside if file == path or _is_own(file, path)]


def _is_recording(file: Path, folder: Path) -> bool:
    """Return True for a file of a known format that is neither hidden nor the result of a run."""
    return file.is_file() and reader_of(file) is not None and _is_own(file, folder)


def _is_own(file: Path, folder: Path) -> bool:
    """Return True for a file that is neither hidden nor the result of a run."""
    inside = file.relative_to(folder)
    ours = any((folder / parent / "run.json").is_file() for parent in inside.parents)
    return not ours and not any(part.startswith(".") for part in inside.parts)


def _by_names(files: Sequence[Path], home: Path, layout: Preview, pooled: str | None) -> list[Group]:
    """Files whose names in a folder have equally many words, and the same words where these tell groups apart and are not `pooled`."""
    members: dict[tuple[int, tuple[str, ...]], list[tuple[Path, NameParts]]] = {}
    names = {file: file.relative_to(home).as_posix() for file in files}
    for count in dict.fromkeys(len(words_of(name)) for name in names.values()):
        alike = [file for file in files if len(words_of(names[file])) == count]
        for file, part in zip(alike, read_names([names[file] for file in alike]), strict=True):
            members.setdefault((count, () if pooled else part.group), []).append((file, part))
    of = None if pooled == "none" else pooled
    made = [Group(tuple(file for file, _ in group), tuple(part for _, part in group), layout) for group in members.values()]
    return [replace(group, of=of) if len({part.group for part in group.names}) > 1 else group for group in made]


def patterns(files: Sequence[Path], folder: Path) -> list[str]:
    """Globs from `folder` that match these files and no others: one where there is one, else the files themselves."""
    parent = relative_name(files[0].parent, folder)
    where = "" if parent == "." else f"{glob.escape(parent)}/"
    for pattern in _candidates([file.name for file in files]):
        if len(files) > 1 and {path.resolve() for path in expand(where + pattern, folder)} == {path.resolve() for path in files}:
            return [where + pattern]
    return [relative_name(file, folder) for file in files]


def _candidates(names: Sequence[str]) -> list[str]:
    """Patterns made of the words at which all names begin and end; the shortest are tried first."""
    begin = shared_start(names).rstrip("0123456789")
    end = shared_start([name[::-1] for name in names])[::-1]
    words = [end[mark.start() :] for mark in re.finditer(r"(?:\.[A-Za-z]\w*)+$|[_\s-]", end)][::-1]
    return [f"{glob.escape(start)}*{glob.escape(stop)}" for stop in words for start in (begin, "")]
