"""Decide whether files have changed since they were read or written.

A long result file contains a checksum of its values, which was computed while they were written.
The stamp of such a file contains this checksum, so that the file need not be read again for a hash.
If the file was changed, so that the checksum inside does not match its values, the stamp contains a
hash of the whole file. This hash differs from the checksum in the old stamp, and so the change is
detected.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

from mapmore_cli.domain.arrays import LONG
from mapmore_cli.storage.run_record import Stamp
from mapmore_cli.storage.seals import state_of


def take_stamp(path: Path, known: Stamp | None = None, rehash: bool = False) -> Stamp:
    """Return the stamp of a file. If size, times and inode number of the file are the same as in
    `known`, its hash is taken from `known`, unless `rehash` is True. Raises OSError if the file
    cannot be read.
    """
    # The state is taken before the file is read. If the file changes while it is read, its time
    # then differs from the time in the stamp, so that the file is read again later.
    state = state_of(path.stat())
    if known is not None and not rehash and known.is_of(state):
        return known
    size, mtime_ns, inode, ctime_ns = state
    digest = None
    if size > LONG:
        from mapmore_cli.storage.artefacts import checksum_of

        digest = checksum_of(path, rehash)
    if digest is None:
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
    return Stamp(size, mtime_ns, digest, inode, ctime_ns)


def stamp_of_result(path: Path) -> Stamp:
    """Return the stamp of a file that was written for a run, with `ctime_ns` 0 (unknown). The file
    is moved to its final path afterwards, which changes its `ctime_ns`.
    """
    return replace(take_stamp(path), ctime_ns=0)


def stamps_of(folder: Path, outputs: tuple[str, ...]) -> dict[str, Stamp]:
    """Return the stamps of every file of `outputs` (files or folders in `folder`), by POSIX path
    relative to `folder`.
    """
    places = [folder / output for output in outputs]
    files = (
        path
        for place in places
        for path in (sorted(filter(Path.is_file, place.rglob("*"))) if place.is_dir() else [place])
    )
    return {path.relative_to(folder).as_posix(): stamp_of_result(path) for path in files}
