"""Content hashes of files, taken again only where size or time says that the content may have changed."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Stamp:
    """What a file was: its size in bytes, its modification time and the SHA-256 of its content."""

    size: int
    mtime_ns: int
    sha256: str


def take_stamp(path: Path, known: Stamp | None = None, rehash: bool = False) -> Stamp:
    """The stamp of a file; the hash is `known`'s where size and time are too, unless `rehash`. OSError where it cannot be read."""
    # Looked at before it is read: a file that changes meanwhile has another time than its stamp, and is read again next time.
    state = path.stat()
    if known is not None and not rehash and (state.st_size, state.st_mtime_ns) == (known.size, known.mtime_ns):
        return known
    with path.open("rb") as file:
        return Stamp(state.st_size, state.st_mtime_ns, hashlib.file_digest(file, "sha256").hexdigest())


def stamps_of(folder: Path, outputs: tuple[str, ...]) -> dict[str, Stamp]:
    """The stamps of every file of `outputs` (files or folders in `folder`), by POSIX path relative to `folder`."""
    files = [path for output in outputs for path in _files_of(folder / output)]
    return {path.relative_to(folder).as_posix(): take_stamp(path) for path in files}


def _files_of(path: Path) -> list[Path]:
    return sorted(inner for inner in path.rglob("*") if inner.is_file()) if path.is_dir() else [path]
