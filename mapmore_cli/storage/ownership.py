"""Find out which files in a run folder belong to the run. These are the files that its record
lists, if they are unchanged.

Everything else may be important to somebody, for example a file that was changed after the run.
Such files are never removed or overwritten. They stay where they are, or are moved to the trash,
`RUNS/.trash/DATE`, which mapmore never empties.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from filecmp import cmp
from itertools import count
from pathlib import Path, PurePosixPath

from mapmore_cli.domain.errors import WriteError
from mapmore_cli.storage.atomic import UNFINISHED, make_folder, refusals_told, remove
from mapmore_cli.storage.run_record import RUN_RECORD, Stamp, recorded_name, written_files
from mapmore_cli.storage.seals import SEAL, read_seal
from mapmore_cli.storage.stamps import take_stamp

LOCK = ".lock"

ASIDE = ".old-"
"""Prefix of the name to which an old folder is renamed while a new one takes its place."""

TRASH = ".trash"
"""Folder beside the runs into which removed files are moved."""


def is_as_written(path: Path, stamp: Stamp | None, rehash: bool = False) -> bool:
    """Return True if a path is a regular file that has not changed since the run wrote it. `stamp`
    is the state of the file in the record of the run; None if the record does not list it. With
    `rehash`, the file is read even if its size and time are unchanged.
    """
    if stamp is None or path.is_symlink() or not path.is_file():
        return False
    now = take_stamp(path, stamp, rehash)
    return (now.size, now.sha256) == (stamp.size, stamp.sha256)


@dataclass(frozen=True)
class Contents:
    """Contents of a run folder by POSIX path: the run's own files, and everything else."""

    own: tuple[str, ...]
    others: tuple[str, ...]


def contents_of(run_dir: Path, rehash: bool = False) -> Contents:
    """Return the contents of a run folder. With `rehash`, files are read even if their size and
    time are unchanged.

    Links, folders without a recorded file, and folders with their own record are not searched,
    because everything in them belongs to somebody else. If the record names another run, for
    example in a copy of a folder, everything belongs to somebody else.
    """
    known = written_files(run_dir)
    folders = {parent.as_posix() for path in known for parent in PurePosixPath(path).parents}
    named = run_dir.parent / (recorded_name(run_dir) or "")
    own_files, others = list[str](), list[str]()

    def is_own(place: Path, path: str) -> bool:
        if UNFINISHED.fullmatch(path):
            return True
        if path == RUN_RECORD:
            return named.exists() and named.samefile(run_dir)
        if path == LOCK:
            return place.stat().st_size == 0
        if path == SEAL:
            return read_seal(run_dir) is not None
        return is_as_written(place, known.get(path.removeprefix(ASIDE)), rehash)

    def look(folder: Path) -> None:
        for place in sorted(folder.iterdir()):
            path = place.relative_to(run_dir).as_posix()
            known_folder = path.removeprefix(ASIDE) in folders and not (place / RUN_RECORD).exists()
            if place.is_symlink() or (place.is_dir() and not known_folder):
                (own_files if _is_left(place, path) else others).append(path)
            elif place.is_dir():
                look(place)
            else:
                (own_files if place.is_file() and is_own(place, path) else others).append(path)

    look(run_dir)
    return Contents(tuple(own_files), tuple(others))


def _is_left(place: Path, path: str) -> bool:
    """Return True if a folder was left behind by a killed process."""
    return bool(UNFINISHED.fullmatch(path)) and not place.is_symlink()


def remove_own(run_dir: Path, own_files: Sequence[str], now: bool) -> None:
    """Move the files of a run to the trash, or delete them if `now` is True. Then remove the
    folders of the run that are empty.

    The record is removed last. If the process is interrupted before, the remaining files can still
    be recognised as a run and removed.
    """
    paths = sorted(own_files, key=lambda path: (path == RUN_RECORD, path))
    paths = [path for path in paths if path != LOCK]
    if now:
        for path in paths:
            remove(run_dir / path)
    else:
        to_trash(run_dir, paths)
    (run_dir / LOCK).unlink(missing_ok=True)
    for folder, _, _ in os.walk(run_dir, topdown=False):
        with suppress(OSError):  # a folder is kept if a file was added to it in the meantime
            Path(folder).rmdir()


def to_trash(run_dir: Path, paths: Sequence[str], without: str = "") -> Path:
    """Move files of a run folder to the folder `RUNS/.trash/DATE/NAME`, or `NAME.2` if that exists,
    and return this folder. `paths` are POSIX paths relative to the run folder. In the trash, the
    files have the same relative paths, but without the prefix `without`.

    Raises WriteError if nothing can be moved there, for example to another file system.
    """
    trash = run_dir.parent / TRASH
    day = trash / time.strftime("%Y-%m-%d")
    with refusals_told(run_dir.parent):
        for folder in (trash, day):
            make_folder(folder)
        names = (f"{run_dir.name}{f'.{number}' if number > 1 else ''}" for number in count(1))
        place = next(day / name for name in names if not os.path.lexists(day / name))
        place.mkdir()
        if place.stat().st_dev != run_dir.stat().st_dev:
            place.rmdir()
            raise WriteError(
                f"{trash}: lies on another file system than {run_dir}, so that files cannot be "
                "moved there in one step; nothing was moved",
                "move the folder .trash away, or delete the runs with `clean --yes --now`",
            )
        for path in paths:
            target = place / path.removeprefix(without)
            target.parent.mkdir(parents=True, exist_ok=True)
            (run_dir / path).rename(target)
    return place


def put_back(run_dir: Path, output: str, known: Mapping[str, Stamp]) -> list[str]:
    """Clear the old folder of an `output`. The old folder was renamed to make room for the new
    folder.

    The files that the run wrote, and files that are equal to a new file of the same name, are
    deleted; other files are moved into the new folder. If the new folder already has another file
    of the same name, the old file is moved to the trash. Return the paths of the files that were
    moved to the trash.
    """
    aside, moved = run_dir / f"{ASIDE}{output}", list[str]()
    for old in list(_below(aside)):
        path = f"{output}/{old.relative_to(aside).as_posix()}"
        place = run_dir / path
        if is_as_written(old, known.get(path)) or is_same(old, place):
            old.unlink()
        elif os.path.lexists(place) or any(parent.is_file() for parent in place.parents):
            moved.append(old.relative_to(run_dir).as_posix())
        else:
            place.parent.mkdir(parents=True, exist_ok=True)
            old.rename(place)
    if moved:
        to_trash(run_dir, moved, ASIDE)
    for folder, _, _ in os.walk(aside, topdown=False):
        Path(folder).rmdir()
    return [path.removeprefix(ASIDE) for path in moved]


def _below(folder: Path) -> Iterator[Path]:
    """Yield all files and all links below a folder. Links are not followed."""
    for parent, folders, names in os.walk(folder):
        yield from (Path(parent) / name for name in names)
        yield from (place for name in folders if (place := Path(parent) / name).is_symlink())


def is_same(first: Path, second: Path) -> bool:
    """Return True if both paths are files with the same bytes, and not links."""
    if any(place.is_symlink() or not place.is_file() for place in (first, second)):
        return False
    return cmp(first, second, shallow=False)
