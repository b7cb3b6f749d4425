"""Which files in the folder of a run are its own: those that its record lists, as it wrote them.

Everything else is somebody's who may miss it, as a file that was changed after the run. It is never
removed and never overwritten: it stays where it is, or moves to the trash, `RUNS/.trash/DATE`,
which mapmore never empties.
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
"""How the name of a folder that makes way starts."""

TRASH = ".trash"
"""The folder beside the runs that takes what was removed."""


def is_as_written(path: Path, stamp: Stamp | None, rehash: bool = False) -> bool:
    """Whether a file, and no link, is the one that a record lists with this stamp."""
    if stamp is None or path.is_symlink() or not path.is_file():
        return False
    now = take_stamp(path, stamp, rehash)
    return (now.size, now.sha256) == (stamp.size, stamp.sha256)


@dataclass(frozen=True)
class Contents:
    """What lies in the folder of a run, by POSIX path in it: its own files, and everything else."""

    own: tuple[str, ...]
    others: tuple[str, ...]


def contents_of(run_dir: Path, rehash: bool = False) -> Contents:
    """Return what lies in the folder of a run; `rehash` reads files even where size and time are as
    they were.

    Links, folders of which the record lists no file, and folders with a record of their own are not
    entered: they are somebody else's as a whole. So is a record that names another run, as in a
    copy of a folder.
    """
    known = written_files(run_dir)
    folders = {parent.as_posix() for path in known for parent in PurePosixPath(path).parents}
    named = run_dir.parent / (recorded_name(run_dir) or "")
    own, others = list[str](), list[str]()

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
                (own if _is_left(place, path) else others).append(path)
            elif place.is_dir():
                look(place)
            else:
                (own if place.is_file() and is_own(place, path) else others).append(path)

    look(run_dir)
    return Contents(tuple(own), tuple(others))


def _is_left(place: Path, path: str) -> bool:
    """Whether a folder is what a killed process has left of its work."""
    return bool(UNFINISHED.fullmatch(path)) and not place.is_symlink()


def remove_own(run_dir: Path, own: Sequence[str], now: bool) -> None:
    """Move the files of a run to the trash, or remove them `now`; then its folders, if empty.

    The record goes last: who is killed half-way leaves a run of which the rest can be removed.
    """
    paths = sorted(own, key=lambda path: (path == RUN_RECORD, path))
    paths = [path for path in paths if path != LOCK]
    if now:
        for path in paths:
            remove(run_dir / path)
    else:
        to_trash(run_dir, paths)
    (run_dir / LOCK).unlink(missing_ok=True)
    for folder, _, _ in os.walk(run_dir, topdown=False):
        with suppress(OSError):  # what came meanwhile keeps its folder
            Path(folder).rmdir()


def to_trash(run_dir: Path, paths: Sequence[str], without: str = "") -> Path:
    """Move files of the folder of a run, by their POSIX paths in it, to `RUNS/.trash/DATE/NAME`, or
    `NAME.2` where that is taken, with their paths `without` a prefix; the folder there.

    Raises WriteError where nothing can be moved there, as to another file system.
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
                f"{trash}: lies on another file system than {run_dir}, so that nothing can be "
                "moved there in one step; nothing was",
                "move the folder .trash away, or remove with `clean --yes --now`",
            )
        for path in paths:
            target = place / path.removeprefix(without)
            target.parent.mkdir(parents=True, exist_ok=True)
            (run_dir / path).rename(target)
    return place


def put_back(run_dir: Path, output: str, known: Mapping[str, Stamp]) -> list[str]:
    """Clear the folder that stepped aside for a new `output`: its own files go, and everything else
    comes into the new folder; the paths of those whose place is taken, which are in the trash.
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
    """Yield all files below a folder, and links, which are not followed."""
    for parent, folders, names in os.walk(folder):
        yield from (Path(parent) / name for name in names)
        yield from (place for name in folders if (place := Path(parent) / name).is_symlink())


def is_same(one: Path, other: Path) -> bool:
    """Whether two files, and no links, hold the same bytes."""
    if any(place.is_symlink() or not place.is_file() for place in (one, other)):
        return False
    return cmp(one, other, shallow=False)
