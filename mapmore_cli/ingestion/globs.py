"""Find the files that the globs of a spec match."""

from __future__ import annotations

import difflib
import fnmatch
import glob
import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from functools import lru_cache
from itertools import count, takewhile
from pathlib import Path, PurePath, PurePosixPath

from mapmore_cli.domain.declared import is_label
from mapmore_cli.domain.errors import DataError, Warn
from mapmore_cli.storage.inputs import note_read
from mapmore_cli.storage.run_record import holds_results

MOST_FOLDERS = 20_000
"""Largest number of folders that a glob may search: `/*/*/*/*/*` would search the whole
computer.
"""

SHOWN = 4  # largest number of folder names that a warning lists


def is_file_named(name: str, pattern: str, folder: Path) -> bool:
    """Return True if `pattern`, a path or a glob, matches the file `name`. A pattern without
    folders matches files in all folders.
    """
    paths = (name, PurePosixPath(name).name)
    if pattern in paths:
        return True
    relative = relative_name(folder / pattern, folder)
    return fnmatch.fnmatchcase(name, relative) or fnmatch.fnmatchcase(paths[1], pattern)


def expand(
    pattern: str, folder: Path, may_be_empty: bool = False, warn: Warn = lambda _: None
) -> list[Path]:
    """Return the files that a glob matches, sorted by POSIX path. Relative globs start at `folder`.

    If a file has exactly the name `pattern`, brackets in `pattern` are ordinary characters, not
    wildcards. Wildcards do not lead into folders with results of mapmore; otherwise, a run could
    read the results of an earlier run as recordings. If there are such folders, `warn` is called
    with a message that names them.

    Raises DataError if `pattern` is a folder, if no file matches, or if a matching file is empty
    (unless `may_be_empty`), is not a regular file, or has a name that is not allowed.
    """
    literal = folder / pattern
    if literal.is_dir():
        raise DataError(
            f"{pattern}: is a folder",
            f"Name the files in it, for example `{pattern.rstrip('/')}/*.csv`.",
        )
    files, results = list[Path](), set[Path]()
    matches = {literal} if literal.is_file() else {*_matches(pattern, folder, results)}
    names = sorted(relative_name(place, folder) for place in results)
    shown = ", ".join(names[:SHOWN]) + (", ..." if len(names) > SHOWN else "")
    for name, path in sorted((relative_name(path, folder), path) for path in matches):
        if path.is_dir():
            continue
        if not path.exists():
            raise DataError(
                f"{name}: is a link to a file that does not exist",
                "correct the link, or leave it out of `files`",
            )
        if not path.is_file():
            raise DataError(f"{name}: is not a regular file", "name files that contain recordings")
        if not is_label(name):
            raise DataError(
                f'the file name {name!r} must be one line of valid text without " ` $ < > \\',
                "rename the file",
            )
        # empty files are refused; this includes the files below /proc, which have size zero,
        # although some of them never end
        if path.stat().st_size == 0 and not may_be_empty:
            raise DataError(
                f"{name}: is empty",
                "leave it out of `files`, name it in `skip_bad_files`, or get it again",
            )
        files.append(path)
    if not files:
        where = f" outside of the results of mapmore in {shown}" if results else ""
        raise DataError(f"{pattern}: no such file{where}", _what_exists(literal))
    if results:
        warn(f"{pattern}: no recordings are read in {shown}, because results of mapmore lie there")
    note_read(files)
    return files


def _matches(pattern: str, folder: Path, results: set[Path]) -> Iterator[Path]:
    """Return all paths that a glob matches. `**` enters each folder only once, even if several
    links lead to it, because links may lead back to a parent folder. If wildcards lead to a folder
    with results of mapmore, this folder is not entered, but added to `results`.

    Raises DataError if the glob leads through more than `MOST_FOLDERS` folders.
    """
    entered = count(1)

    def is_entered(place: Path) -> bool:
        if holds_results(place):
            results.add(place)
            return False
        if next(entered) > MOST_FOLDERS:
            raise DataError(
                f"{pattern}: matches paths through more than {MOST_FOLDERS} folders",
                "name the folders explicitly, for example `measured/*/*.csv`",
            )
        return True

    yield from _below(PurePath(pattern).parts, folder, is_entered)


def _below(parts: Sequence[str], top: Path, is_entered: Callable[[Path], bool]) -> Iterator[Path]:
    """Yield the paths below the folder `top` that match a glob. `parts` are the names and wildcards
    between the slashes of the glob. If a wildcard leads to a folder, `is_entered` decides whether
    this folder is searched.
    """
    literal = list(takewhile(lambda part: not glob.has_magic(part), parts))
    here, rest = top.joinpath(*literal), parts[len(literal) :]
    if not rest:
        yield from [here] if os.path.lexists(here) else ()
        return
    if rest[0] == "**":
        inner: Iterable[Path] = _folders(here, set(), is_entered) if here.is_dir() else ()
    else:
        entries = _entries(here, rest[0])
        if len(rest) == 1:
            yield from map(Path, entries)
            return
        inner = (Path(entry) for entry in entries if entry.is_dir() and is_entered(Path(entry)))
    for path in inner:
        yield from _below(rest[1:] or ["*"], path, is_entered)


def _entries(folder: Path, part: str) -> list[os.DirEntry[str]]:
    """Return the files and folders in `folder` whose names match one part of a glob, for example
    `*.csv`. The list is empty if the folder cannot be read.
    """
    matches = re.compile(fnmatch.translate(part)).match
    with suppress(OSError), os.scandir(folder) as entries:
        return [
            entry
            for entry in entries
            if matches(entry.name) and (part.startswith(".") or not entry.name.startswith("."))
        ]
    return []


def _folders(
    top: Path, seen: set[tuple[int, int]], is_entered: Callable[[Path], bool]
) -> Iterator[Path]:
    """Yield a folder and all folders inside it, except hidden folders and folders for which
    `is_entered` returns False.
    """

    def refused(fault: OSError) -> None:
        message = f"{fault.filename}: cannot be read ({fault.strerror})"
        raise DataError(
            message, "change its permissions, or name the files without `**`"
        ) from fault

    for name, inner, _ in os.walk(top, onerror=refused, followlinks=True):
        state = Path(name).stat()
        if (state.st_dev, state.st_ino) in seen:
            inner.clear()
            continue
        seen.add((state.st_dev, state.st_ino))
        inner[:] = sorted(
            inner_name
            for inner_name in inner
            if not inner_name.startswith(".") and is_entered(Path(name, inner_name))
        )
        yield Path(name)


def relative_name(path: Path, folder: Path) -> str:
    """Return the POSIX path relative to `folder`. This relative path is the same on every machine
    that has the same tree of folders.
    """
    # the quick case: for a path inside `folder`, this takes a tenth of the time of `_way_to`
    with suppress(ValueError):
        inside = path.relative_to(folder)
        if ".." not in inside.parts:
            return inside.as_posix()
    way = _way_to(path.parent, folder, Path.cwd())
    return path.name if way == "." else f"{way}/{path.name}"


@lru_cache(maxsize=1000)
def _way_to(parent: Path, folder: Path, _current: Path) -> str:
    """Return the POSIX path that leads from `folder` to `parent`. Both may be relative to the
    current folder. The current folder is an argument, so that cached results become invalid when it
    changes.
    """
    return Path(os.path.relpath(parent, folder)).as_posix()


def _what_exists(path: Path) -> str:
    folder = path.parent
    while glob.has_magic(str(folder)):
        folder = folder.parent
    if not folder.is_dir():
        return f"The folder {folder} does not exist."
    names = sorted(entry.name for entry in folder.iterdir())
    if not names:
        return f"The folder {folder} is empty."
    shown = difflib.get_close_matches(path.name, names, n=SHOWN, cutoff=0.5) or names[:SHOWN]
    return (
        f"The folder {folder} contains: "
        f"{', '.join(shown)}{(', ...' if len(shown) < len(names) else '')}"
    )
