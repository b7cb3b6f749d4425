"""Columns that may be longer than memory: made block by block, and kept in files without a name where they are long.

What comes out is an array like any other. One that was spooled is mapped from its file and cannot be written to; whoever goes through it by
`in_blocks` needs the memory of a block, and whoever takes it as a whole needs the memory of the whole.
"""

from __future__ import annotations

import mmap
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any
from weakref import WeakSet

import numpy as np

from mapmore_cli.domain.arrays import in_blocks, is_one_block, row_blocks
from mapmore_cli.storage.atomic import refusals_told

LONG = 8_000_000
"""Bytes of a column from which on it is spooled: a million numbers."""

MOST = 100
"""Columns that are spooled at one time, since each keeps a file open; those beyond stay in memory."""


@dataclass(frozen=True)
class _Spool:
    folder: Path
    mapped: WeakSet[mmap.mmap] = field(default_factory=WeakSet)

    def takes(self, size: int) -> bool:
        """Whether a column of so many bytes goes into a file."""
        return size > LONG and len(self.mapped) < MOST


_spool: ContextVar[_Spool | None] = ContextVar("_spool", default=None)


@contextmanager
def spooling_in(folder: Path) -> Iterator[None]:
    """Keep long columns that are made in this block in files in `folder`, which vanish with the columns, or with the program."""
    token = _spool.set(_Spool(folder))
    try:
        yield
    finally:
        _spool.reset(token)


class Growing:
    """A column to whose end values are added, as many as are `expected` without being copied."""

    def __init__(self, dtype: Any) -> None:
        self._dtype = np.dtype(dtype)
        self._size = 0
        self._held = np.empty(0, dtype)
        self._spool = _spool.get()
        self._file: IO[bytes] | None = None

    def add(self, values: Any, expected: int) -> None:
        """Append values, (b,); about `expected` are to come altogether. Raises WriteError where the disk is full."""
        start, self._size = self._size, self._size + len(values)
        room = max(self._size, expected)
        if self._file is None and self._spool is not None and self._spool.takes(room * self._dtype.itemsize):
            with refusals_told(self._spool.folder):
                self._file = tempfile.TemporaryFile(dir=self._spool.folder)  # noqa: SIM115 - open as long as the column grows
            self._write(self._held[:start])
        if self._file is not None:
            self._write(values)
            return
        if self._size > len(self._held):
            larger = np.empty(room, self._dtype)  # pages that nothing is written to take no memory
            larger[:start] = self._held[:start]
            self._held = larger
        self._held[start : self._size] = values

    def _write(self, values: Any) -> None:
        assert self._file is not None
        assert self._spool is not None
        with refusals_told(self._spool.folder):
            self._file.write(np.ascontiguousarray(values, self._dtype).data)
            self._file.flush()

    def whole(self) -> Any:
        """All values, (n,); nothing can be added any more."""
        if self._file is None or self._spool is None:
            return self._held[: self._size]
        with self._file as file:
            if not self._size:
                return np.empty(0, self._dtype)
            content = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        self._spool.mapped.add(content)
        return np.frombuffer(content, self._dtype)

    def __del__(self) -> None:
        if self._file is not None:
            self._file.close()


def by_blocks(function: Callable[..., Any], *columns: Any) -> Any:
    """`function(*columns)`, where each row, or each choice of rows, depends on these rows alone."""
    size = len(columns[0])
    if is_one_block(size):
        return function(*columns)
    result: Growing | None = None
    for block in in_blocks(*columns):
        values = function(*(block if len(columns) > 1 else (block,)))
        result = result or Growing(values.dtype)
        result.add(values, size)
    assert result is not None
    return result.whole()


def counted(function: Callable[[Any], Any], size: int) -> Any:
    """Return `function` of the row numbers from 0 to `size`, where each row depends on its number alone."""
    if is_one_block(size):
        return function(np.arange(size))
    result = Growing(function(np.arange(0)).dtype)
    for rows in row_blocks(size):
        result.add(function(np.arange(rows.start, rows.stop)), size)
    return result.whole()


def chosen(column: Any, mask: Any) -> Any:
    """Return the values of a column where `mask`."""
    return by_blocks(lambda values, where: values[where], column, mask)


def joined(columns: Sequence[Any]) -> Any:
    """Columns one after the other, (n,)."""
    size = sum(map(len, columns))
    if is_one_block(size) or len(columns) == 1:
        return np.concatenate(columns) if len(columns) > 1 else columns[0]
    result = Growing(columns[0].dtype)
    for column in columns:
        for block in in_blocks(column):
            result.add(block, size)
    return result.whole()
