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
    """Collect the paths of the files that are read within the context. A context around it collects
    them too.
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
    """Add paths to those that `files_read` collects; outside of its context, do nothing."""
    if (known := _READ.get()) is not None:
        known.update(paths)


def is_read(path: Path) -> bool:
    """Return True if an existing file is one of those that were read, under any name."""
    state = path.stat()
    for other in _READ.get() or ():
        with suppress(OSError):  # a file that was read may be gone
            if os.path.samestat(state, other.stat()):
                return True
    return False
