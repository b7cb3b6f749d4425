"""Remember the files that a command reads and the outputs that it will write, so that no output
replaces a file that the command reads.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path

from mapmore_cli.domain.errors import WriteError


@dataclass(frozen=True)
class _Files:
    """Files of a command: those that it has read, and the outputs that it will write."""

    read: set[Path]
    outputs: list[Path]


_FILES: ContextVar[_Files | None] = ContextVar("_FILES", default=None)


@contextmanager
def files_read() -> Iterator[set[Path]]:
    """Collect the paths of the files that are read within the context. Contexts can be nested: a
    file that is read within the inner context is added to the paths of both, and a file that was
    noted as an output in the outer context is an output in the inner context too.
    """
    around = _FILES.get()
    files = _Files(set(), [] if around is None else around.outputs)
    token = _FILES.set(files)
    try:
        yield files.read
    finally:
        _FILES.reset(token)
        if around is not None:
            around.read.update(files.read)


def note_read(paths: Iterable[Path]) -> None:
    """Add paths to the set of files that the command has read (`files_read`). Outside of a context
    of `files_read`, do nothing. Raises WriteError if one of the paths is an output of the command.
    """
    if (files := _FILES.get()) is not None:
        new = {*paths} - files.read
        files.read.update(new)
        for output in files.outputs:
            _refuse_same(output, new)


def note_output(path: Path) -> None:
    """Remember an output of the command. If the command later reads this file, `note_read` raises
    an error. Outside of a context of `files_read`, do nothing.
    """
    if (files := _FILES.get()) is not None:
        files.outputs.append(path)


def is_read(path: Path) -> bool:
    """Return True if the command has read the file `path`, under this name or another one."""
    try:
        refuse_read(path)
    except WriteError:
        return True
    return False


def refuse_read(path: Path) -> None:
    """Raise WriteError if the command has read the file `path`, under this name or another one (a
    hard link).
    """
    if (files := _FILES.get()) is not None:
        _refuse_same(path, files.read)


def _refuse_same(output: Path, inputs: Iterable[Path]) -> None:
    # if the output does not exist, `stat` fails, and there is nothing to protect
    with suppress(OSError):
        state = output.stat()
        for path in inputs:
            with suppress(OSError):  # a file that was read may have been deleted since
                if os.path.samestat(state, path.stat()):
                    raise WriteError(
                        f"{output}: this command reads the file, so its output cannot replace it",
                        "name another file for the output",
                    )
