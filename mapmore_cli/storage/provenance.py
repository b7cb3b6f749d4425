"""What a file was made from: content hashes of its sources, the format that it is in, and the versions of the tools."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path

from mapmore_cli.domain.errors import DataError


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


def refuse_newer(path: Path, found: str, known: str) -> None:
    """Raise DataError where a file's major version is above the one that this program knows, or is no version at all."""
    try:
        major = int(found.split(".")[0])
    except ValueError:
        raise DataError(f"{path}: has the unreadable format version {found!r}", "delete it and run `mapmore run CONFIG`") from None
    if major > int(known.split(".")[0]):
        remedy = "update mapmore, or make the file again with this version by `mapmore run CONFIG --force`"
        raise DataError(f"{path}: was written in format {found} by a newer mapmore; this one reads up to {known}", remedy)


@cache
def tool_versions() -> Mapping[str, str]:
    """Versions of what decides about numbers and files, without importing any of it."""
    packages = {name: version(name) for name in ("mapmore", "numpy", "scipy", "h5py")}
    return {**packages, "python": platform.python_version()}
