"""Columns that may be longer than memory: made block by block, and kept in files without a name
where they are long.

What comes out is an array like any other. One that was spooled is mapped from its file and cannot
be written to; whoever goes through it by `in_blocks` needs the memory of a block, and whoever takes
it as a whole needs the memory of the whole.
"""

from __future__ import annotations

import mmap
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from itertools import chain
from pathlib import Path
from typing import Any
from weakref import WeakSet

import numpy as np

from mapmore_cli.domain.arrays import in_blocks, row_blocks
from mapmore_cli.storage.atomic import refusals_told

LONG = 8_000_000
"""Bytes of a column from which on it is spooled: a million numbers."""

MOST = 100
"""Columns that are spooled at one time, since each keeps a file open; those beyond stay in memory.
"""

_folder: ContextVar[Path | None] = ContextVar("_folder", default=None)
_mapped: WeakSet[mmap.mmap] = WeakSet()


@contextmanager
def spooling_in(folder: Path) -> Iterator[None]:
    """Keep long columns that are made in this block in files in `folder`, which vanish with the
    columns, or with the program.
    """
    token = _folder.set(folder)
    try:
        yield
    finally:
        _folder.reset(token)


def in_a_row(blocks: Iterable[Sequence[Any]]) -> list[Any]:
    """Return columns one after the other of their parts, (b,) each, which come in blocks, at least
    one. Raises WriteError where the disk is full.
    """
    held: list[Any] = []
    size, rest, folder = 0, iter(blocks), _folder.get()
    for block in rest:
        held.append(block)
        size += max(part.nbytes for part in block)
        if folder is not None and size > LONG and len(_mapped) + len(block) <= MOST:
            kinds = [part.dtype for part in block]
            return _in_files(chain(held, rest), kinds, folder)
    return list(map(np.concatenate, zip(*held, strict=True)))


def _in_files(blocks: Iterable[Sequence[Any]], kinds: Sequence[Any], folder: Path) -> list[Any]:
    with ExitStack() as opened:
        files = [opened.enter_context(tempfile.TemporaryFile(dir=folder)) for _ in kinds]
        for block in blocks:
            with refusals_told(folder):
                for file, part in zip(files, block, strict=True):
                    file.write(np.ascontiguousarray(part).data)
                    file.flush()
        contents = [mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) for file in files]
    _mapped.update(contents)
    return list(map(np.frombuffer, contents, kinds))


def by_blocks(function: Callable[..., Any], *columns: Any) -> Any:
    """`function(*columns)`, where each row, or each choice of rows, depends on these rows alone."""
    return in_a_row([function(*block)] for block in in_blocks(*columns))[0]


def counted(function: Callable[[Any], Any], size: int) -> Any:
    """Return `function` of the row numbers from 0 to `size`, where each row depends on its number
    alone.
    """
    return in_a_row([function(np.arange(rows.start, rows.stop))] for rows in row_blocks(size))[0]


def chosen(column: Any, mask: Any) -> Any:
    """Return the values of a column where `mask`."""
    return by_blocks(lambda values, where: values[where], column, mask)


def joined(columns: Sequence[Any]) -> Any:
    """Columns one after the other, (n,)."""
    return (
        columns[0]
        if len(columns) == 1
        else in_a_row(block for column in columns for block in in_blocks(column))[0]
    )
