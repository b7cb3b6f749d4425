"""Remember the files that a command reads, so that none of its outputs replaces one of them."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path

_READ: ContextVar[set[Path] | None] = ContextVar("_READ", default=None)


@contextmanager
def files_read() -> Iterator[set[Path]]:
    """Collect the paths of the files that are read within the context. If the context is inside
    another one of this kind, both collect the paths.
    """
    around, paths = _READ.get(), set[Path]()
    token = _READ.set(paths)
    try:
        yield paths
    finally:
        _READ.reset(token)
        if around is not None:
            around |= paths


def note_read(paths: Iterable[Path]) -> None:
    """Add paths to the set that `files_read` collects. Outside of the context of `files_read`, do
    nothing.
    """
    if (known := _READ.get()) is not None:
        known.update(paths)


def is_read(path: Path) -> bool:
    """Return True if an existing file was read before, under any name."""
    state = path.stat()
    for other in _READ.get() or ():
        with suppress(OSError):  # the file may have been removed since
            if os.path.samestat(state, other.stat()):
                return True
    return False
