"""From the globs of a spec to the files they name."""

from __future__ import annotations

import difflib
import glob
import os
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePath, PurePosixPath

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.foreign import is_one_line
from mapmore_cli.storage.readers import READERS

SHOWN = 4  # names listed in a message


def expand(pattern: str, folder: Path) -> list[Path]:
    """Return the files that a glob names, sorted by POSIX path; relative ones start at `folder`.

    A path that exists as it is written is taken literally, brackets and all. Raises DataError for a folder, or where nothing matches.
    """
    files = _expanded(pattern, folder)
    for path in files:
        name = relative_name(path, folder)
        if not is_one_line(name):
            raise DataError(f"the name {name!r} is not one line of valid text", "rename the file")
        if path.stat().st_size == 0:  # as all files below /proc say of themselves, which may never end
            raise DataError(f"{name}: is empty", "leave it out of `files`, or get it again")
    return files


def _expanded(pattern: str, folder: Path) -> list[Path]:
    literal = folder / pattern
    if literal.is_dir():
        raise DataError(f"{pattern}: is a folder", f"Name the files in it, as `{pattern.rstrip('/')}/*.csv`.")
    if literal.is_file():
        return [literal]
    found = set(_matches(pattern, folder))
    files = sorted((path for path in found if path.is_file()), key=lambda path: relative_name(path, folder))
    for path in sorted(found.difference(files)):
        if not path.exists():
            raise DataError(f"{relative_name(path, folder)}: is a link that leads nowhere", "mend the link, or leave it out of `files`")
        if not path.is_dir():
            raise DataError(f"{relative_name(path, folder)}: is no regular file", "name files that hold recordings")
    if not files:
        raise DataError(f"{pattern}: no such file", _what_exists(literal))
    return files


def _matches(pattern: str, folder: Path) -> Iterator[Path]:
    """Everything that a glob names. `**` enters each folder once, by whatever links it is reached: links may lead back up."""
    parts = PurePath(pattern).parts
    if "**" not in parts:
        yield from (folder / name for name in glob.glob(pattern, root_dir=folder))  # noqa: PTH207 - Path.glob refuses ".."
        return
    head, rest = parts[: parts.index("**")], parts[parts.index("**") + 1 :]
    seen: set[tuple[int, int]] = set()
    for top in sorted(_matches(str(PurePath(*head)), folder)) if head else [folder]:
        for inner in _folders(top, seen) if top.is_dir() else ():
            yield from _matches(str(PurePath(*rest or "*")), inner)


def _folders(top: Path, seen: set[tuple[int, int]]) -> Iterator[Path]:
    """Yield a folder and all that lie in it, those that are hidden left out."""
    try:
        state = top.stat()
        if (state.st_dev, state.st_ino) in seen:
            return
        seen.add((state.st_dev, state.st_ino))
        inner = sorted(entry.name for entry in os.scandir(top) if entry.is_dir() and not entry.name.startswith("."))
    except OSError as fault:
        raise DataError(f"{top}: cannot be read ({fault.strerror})", "change its permissions, or name the files without `**`") from fault
    yield top
    for name in inner:
        yield from _folders(top / name, seen)


def relative_name(path: Path, folder: Path) -> str:
    """Return the POSIX path from `folder`: the same on every machine that has the same tree."""
    return Path(os.path.relpath(path, folder)).as_posix()


def unique_ids(sources: Sequence[str]) -> list[str]:
    """Name recordings after their files, without `.gz` and the format's suffix; with parent folders where names repeat."""
    parts = [PurePosixPath(_without_suffix(source)).parts for source in sources]
    depth = [1] * len(parts)
    while True:
        ids = ["-".join(part[-n:]) for part, n in zip(parts, depth, strict=True)]
        longer = [min(n + 1, len(part)) if ids.count(name) > 1 else n for name, part, n in zip(ids, parts, depth, strict=True)]
        if longer == depth:
            return ids
        depth = longer


def _without_suffix(source: str) -> str:
    stem = source.removesuffix(".gz")
    suffixes = [suffix for reader in READERS.values() for suffix in reader.suffixes]
    return next((stem.removesuffix(suffix) for suffix in suffixes if stem.endswith(suffix)), stem) or source


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
    more = ", ..." if len(shown) < len(names) else ""
    return f"The folder {folder} has: {', '.join(shown)}{more}"
