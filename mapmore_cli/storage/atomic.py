"""Write files so that, even after a crash, a file has either its old contents or all of its new
contents. Also convert errors of the file system into messages for the user.
"""

from __future__ import annotations

import errno
import os
import re
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from io import BufferedRandom
from pathlib import Path
from secrets import token_hex
from tempfile import gettempdir
from typing import IO, cast

from mapmore_cli.domain.errors import WriteError

TEMPORARY = ".tmp-"
"""Prefix of the names of unfinished files and folders."""

UNFINISHED = re.compile(re.escape(TEMPORARY) + r"[0-9a-f]{12}-.+", re.DOTALL)
"""Names of files and folders that `unfinished_beside` has created."""

_NO_LINK = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
"""Flags with which every file is opened; the system itself then refuses a link in its place."""

_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG}
_REFUSED = {
    errno.EACCES,
    errno.EPERM,
    errno.EISDIR,
    errno.ENOTDIR,
    errno.EEXIST,
    errno.ENAMETOOLONG,
    errno.ELOOP,
    errno.EXDEV,
    errno.ENOTEMPTY,
}


def is_special(path: Path) -> bool:
    """Return True if `path` is, for example, a pipe, a terminal or `/dev/null`. In contrast to a
    regular file, such a file is never replaced; data are written into it.
    """
    other = path.exists() and not path.is_file() and not path.is_dir()
    # a link, for example to a pipe, is not special: `refuse_irregular` refuses it, because the user
    # named the link and not its target
    return _is_of_system(path) or (other and not path.is_symlink())


def _is_of_system(path: Path) -> bool:
    """Return True for a path directly in `/dev` or `/dev/fd`, or anywhere in `/proc`, for example
    `/dev/stdout`. Such a path may lead to a regular file that another program has opened. Data must
    therefore be written into this file, and it must not be replaced.

    A file in a folder of `/dev`, for example `/dev/shm`, is an ordinary file.
    """
    place = Path(os.path.abspath(path))  # noqa: PTH100 - links stay as they are named
    return place.parts[1:2] == ("proc",) or place.parent in (Path("/dev"), Path("/dev/fd"))


def refuse_irregular(place: Path) -> None:
    """Raise WriteError if a file or folder is to be written at `place`, but a link, a pipe or
    another special file is there.
    """
    if place.is_symlink():
        raise WriteError(
            f"{place}: is a link, and mapmore does not write through links, because the file "
            "behind it would be overwritten",
            "move the link away, or name the place that it leads to",
        )
    if is_special(place):
        raise WriteError(
            f"{place}: is a pipe, a socket or a device, which mapmore does not replace with a file",
            "move it away, or name another place",
        )


def content_of(path: Path) -> bytes:
    """Return the bytes of a regular file. Raises FileNotFoundError if `path` is something else, for
    example a pipe, because reading a pipe would wait for a writer. (The name of the file is chosen
    by mapmore, so that nobody expects a pipe there.)
    """
    if not path.is_file():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
    return path.read_bytes()


def holds(path: Path, content: bytes) -> bool:
    """Return True if a path is a regular file with this content."""
    return path.is_file() and path.stat().st_size == len(content) and path.read_bytes() == content


def make_folder(folder: Path) -> None:
    """Make a folder whose name mapmore itself chooses, unless it exists. Raises WriteError as
    `refuse_irregular` does.
    """
    refuse_irregular(folder)
    folder.mkdir(exist_ok=True)


@contextmanager
def unfinished_beside(path: Path, folder: bool = False) -> Iterator[Path]:
    """Make an empty file or folder beside `path`, with a temporary name. The caller writes its
    contents, and moves it to `path`. If this does not happen before the end of the context, it is
    removed.

    Temporary files for the same `path` that killed processes have left are removed. The new file or
    folder is locked as long as this process lives, so that other processes do not remove it.
    """
    if not path.name:  # the current folder
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    _clear_abandoned(path)
    while True:
        unfinished = path.with_name(f"{TEMPORARY}{token_hex(6)}-{path.name}")
        unfinished.mkdir(0o700) if folder else unfinished.touch(exist_ok=False)
        handle = _locked(unfinished)
        if unfinished.exists():
            break
        # another process removed the file before it was locked here, because it looked abandoned
        _let_go(handle)
    try:
        yield unfinished
    finally:
        # if the folder cannot be removed, the next process removes it
        with suppress(OSError) if folder else nullcontext():
            remove(unfinished)
        _let_go(handle)


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """Make a private folder in the system's folder for temporary files, and remove it at the end.
    Remains of killed processes are removed too.
    """
    with unfinished_beside(Path(gettempdir()) / "mapmore", folder=True) as folder:
        yield folder


def _clear_abandoned(path: Path) -> None:
    """Remove the unfinished files and folders for `path` that no process has locked."""
    name = re.compile(rf"{re.escape(TEMPORARY)}[0-9a-f]{{12}}-{re.escape(path.name)}", re.DOTALL)
    abandoned = list[str]()
    # if the folder cannot be listed, nothing is removed, but it may still be possible to write in
    # it
    with suppress(OSError):
        abandoned = list(filter(name.fullmatch, os.listdir(path.parent)))  # noqa: PTH208
    for left in (path.parent / entry for entry in abandoned):
        if (handle := _locked(left, patient=False)) is not None:
            try:
                with suppress(OSError):  # files that belong to another user cannot be removed
                    remove(left)
            finally:
                os.close(handle)


def _locked(place: Path, patient: bool = True) -> int | None:
    """Lock a file or folder, and return its file handle. Other processes that try to lock it wait,
    or do not get the lock. Return None if another process holds the lock, or if the system has no
    such locks.
    """
    # Windows has no such locks. It is then unknown whether a process still uses an unfinished file,
    # so the caller does not remove it.
    if sys.platform == "win32":
        return None
    import fcntl

    handle = None
    try:
        handle = os.open(place, os.O_RDONLY | os.O_NONBLOCK | _NO_LINK)
        fcntl.flock(handle, fcntl.LOCK_EX | (0 if patient else fcntl.LOCK_NB))
    except OSError:
        _let_go(handle)
        return None
    return handle


def _let_go(handle: int | None) -> None:
    if handle is not None:
        os.close(handle)


def remove(place: Path) -> None:
    """Remove a file, a link or a whole folder, if it is there."""
    if place.is_dir() and not place.is_symlink():
        shutil.rmtree(place)
    else:
        place.unlink(missing_ok=True)


@contextmanager
def replacing(path: Path) -> Iterator[BufferedRandom]:
    """Open a file that replaces `path` when the block ends without error: the new file is written
    beside `path`, flushed to the disk, and moved over it.

    In an unfinished folder, the file is written directly and not flushed, because `sync_tree`
    flushes the whole folder before the folder is moved. Raises WriteError if `path` is a link or a
    special file.
    """
    refuse_irregular(path)
    alone = not any(UNFINISHED.fullmatch(part) for part in path.parent.parts)
    with (
        refusals_told(path.parent),
        unfinished_beside(path) if alone else nullcontext(path) as unfinished,
    ):
        how = os.O_RDWR | os.O_CREAT | os.O_TRUNC
        with cast(BufferedRandom, _opened(unfinished, how, "r+b")) as file:
            yield file
            file.flush()
            if alone:
                os.fsync(file.fileno())
        if alone:
            unfinished.replace(path)
            sync_folder(path.parent)


def _opened(path: Path, how: int, mode: str) -> IO[bytes]:
    """Open a file for writing, unless it is a link."""
    return os.fdopen(os.open(path, how | _NO_LINK, 0o666), mode)


@contextmanager
def opened_special(path: Path) -> Iterator[IO[bytes]]:
    """Open a special file (`is_special`), such as a pipe, for writing."""
    with (
        refusals_told(path.parent),
        path.open("wb") if _is_of_system(path) else _opened(path, os.O_WRONLY, "wb") as stream,
    ):
        yield stream


def write_own(path: Path, content: str | bytes) -> None:
    """Write a file as a whole, as `replacing` does, and replace any file with this name. Use this
    function only for files whose names mapmore chooses; the module `outputs` has functions for
    files that the user names, and protects existing files. Raises WriteError for a link or a
    special file; for example, writing into a pipe would wait for a reader.
    """
    with replacing(path) as file:
        file.write(content.encode() if isinstance(content, str) else content)


def sync_tree(folder: Path) -> None:
    """Flush every file and folder below `folder` to the disk."""
    for parent, _, names in os.walk(folder):
        for name in names:
            _sync(Path(parent) / name, os.O_RDONLY)
        sync_folder(Path(parent))


def sync_folder(folder: Path) -> None:
    """Flush the list of files in a folder to the disk, if the system supports this."""
    if hasattr(os, "O_DIRECTORY"):
        _sync(folder, os.O_RDONLY | os.O_DIRECTORY)


@contextmanager
def refusals_told(folder: Path) -> Iterator[None]:
    """Convert an OSError into a WriteError if the disk is full, or if the file system refuses
    access to something in `folder` or to one of its parent folders. Other errors are not changed.

    For example, a stage that cannot read a recording in another folder raises its own error.
    """
    try:
        yield
    except OSError as fault:
        place = (
            Path(os.fsdecode(fault.filename)) if isinstance(fault.filename, str | bytes) else folder
        )
        ours = place == folder or folder in place.parents or place in folder.parents
        if fault.errno in _FULL or (fault.errno in _REFUSED and ours):
            room = "make room on the disk, or " if fault.errno in _FULL else ""
            message = f"{place}: cannot be written ({os.strerror(fault.errno or 0)})"
            raise WriteError(message, f"{room}choose another folder with --runs or -o") from fault
        raise


def _sync(path: Path, flags: int) -> None:
    handle = os.open(path, flags)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
