"""Array types that every layer speaks, and columns taken and made block by block.

A column that is longer than memory is an array like any other: it is mapped from a file, and cannot
be written to. Whoever goes through it by blocks needs the memory of a block, and whoever takes it
as a whole needs the memory of the whole.
"""

from __future__ import annotations

import mmap
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from contextvars import ContextVar
from itertools import chain
from typing import Annotated, Any
from weakref import WeakKeyDictionary

import numpy as np

from mapmore_cli.domain.declared import Checked, QuantityName

_Shape = tuple[Any, ...]

Array = np.ndarray[_Shape, np.dtype[np.float64]]  # written out: NumPy 2.5 made NDArray an alias
"""Measured or computed values; shapes are given where the array is used."""

FINITE = Checked("is not finite", lambda found: np.isfinite(found).all())
ASCENDING = Checked("does not ascend", lambda found: (np.diff(found) >= 0).all())
Number = Annotated[float, FINITE]
Span = Annotated[tuple[Number, Number], ASCENDING]

Numbers = Annotated[Array, FINITE]
"""Values that a model cannot do without."""

IntArray = np.ndarray[_Shape, np.dtype[np.int64]]
"""Row numbers and identifiers."""

Rows = range | IntArray
"""Row numbers; those that follow each other take no room."""

BoolArray = np.ndarray[_Shape, np.dtype[np.bool_]]
"""Masks over samples."""

Value = Array | np.float64
"""One number for every row, or one for all."""

Columns = Mapping[QuantityName, Array]
"""Quantities by canonical name, each `(n,)`, row for row of one table."""

Ranges = Mapping[QuantityName, Span]
"""Least and greatest value of each quantity."""


def row_count(columns: Columns) -> int:
    """Return the number of rows of a table; zero for one without columns."""
    return len(next(iter(columns.values()), ()))


ROWS, WIDE = 1 << 14, 1 << 17
"""Samples of a block: of 128 KB of a column, so that what is computed of it stays in the
processor's cache; and of one for work that costs much to begin, as a model does.
"""


def row_blocks(size: int, rows: int = ROWS) -> Iterator[slice]:
    """Slices of so many `rows` that follow each other over `size` rows, at least one."""
    return (slice(start, min(start + rows, size)) for start in range(0, max(size, 1), rows))


def in_blocks(*columns: Any, overlap: int = 0, rows: int = ROWS) -> Iterator[tuple[Any, ...]]:
    """Blocks of columns of one length, `(n, ...)` each, at least one.

    Every block but the first begins with the last `overlap` rows of the one before.
    """
    for part in row_blocks(len(columns[0]), rows):
        yield tuple(column[max(0, part.start - overlap) : part.stop] for column in columns)
        if part.stop % WIDE == 0 or part.stop == len(columns[0]):
            for column in columns:
                give_back(column)


def extremes(column: Array, mask: BoolArray | None = None) -> tuple[float, float]:
    """Return the least and the largest value of a column, (n,), or of those where `mask`; NaN where
    one is NaN. Raises ValueError if there is no value.
    """
    if mask is not None and not mask.all():
        return _ends_of(blocks_where(column, mask))
    # what is in a file does not change
    of = _map_of(column)
    known = {} if of is None else _mapped.setdefault(of, {})
    place = (column.__array_interface__["data"][0], column.shape, column.strides)
    if place not in known:
        known[place] = _ends_of(x for (x,) in in_blocks(column, rows=WIDE))
    return known[place]


def _ends_of(blocks: Iterable[Array]) -> tuple[float, float]:
    ends = np.array([(x.min(), x.max()) for x in blocks if x.size]).reshape(-1, 2)
    return float(ends[:, 0].min()), float(ends[:, 1].max())


def blocks_where(column: Array, mask: BoolArray) -> Iterator[Array]:
    """Yield the values of a column where `mask`, block by block."""
    return (values[where] for values, where in in_blocks(column, mask))


LONG = 8_000_000
"""Bytes of a column from which on it is kept in a file: a million numbers."""

MOST = 200
"""Columns in files at one time, since each keeps one open; those beyond stay in memory."""

SCRATCH: ContextVar[str | None] = ContextVar("SCRATCH", default=None)
"""The folder of these files, which have no name and end with their columns, or with the program;
None for that of the system.
"""

_mapped: WeakKeyDictionary[mmap.mmap, dict[Any, tuple[float, float]]] = WeakKeyDictionary()
"""The ends of columns that are in files, as far as they are known."""


def stacked(blocks: Iterable[Sequence[Any]]) -> list[Any]:
    """Return columns one after the other of their parts, (b,) or (b, k) each, which come in blocks,
    at least one. Raises OSError if the disk is full.
    """
    held: list[Sequence[Any]] = []
    size, rest = 0, iter(blocks)
    for block in rest:
        held.append(block)
        size += max(part.nbytes for part in block)
        if size > LONG and len(_mapped) + len(block) <= MOST:
            return _in_files(chain(held, rest), block)
    return [
        parts[0] if len(parts) == 1 else np.concatenate(parts) for parts in zip(*held, strict=True)
    ]


def _in_files(blocks: Iterable[Sequence[Any]], like: Sequence[Any]) -> list[Any]:
    """Return the columns of the parts, with the types and the widths of those in `like`."""
    with ExitStack() as opened:
        files = [opened.enter_context(tempfile.TemporaryFile(dir=SCRATCH.get())) for _ in like]
        for block in blocks:
            for file, part in zip(files, block, strict=True):
                file.write(np.ascontiguousarray(part).data)
        for file in files:
            file.flush()
        contents = [mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) for file in files]
    _mapped.update((one, {}) for one in contents)
    columns = [np.frombuffer(one, part.dtype) for one, part in zip(contents, like, strict=True)]
    return [
        column if part.ndim == 1 else column.reshape(-1, *part.shape[1:])
        for column, part in zip(columns, like, strict=True)
    ]


def by_blocks(function: Callable[..., Any], *columns: Any, rows: int = ROWS) -> Any:
    """`function(*columns)`, where each row, or each choice of rows, depends on these rows alone."""
    if len(columns[0]) <= rows:  # thousands of short curves
        return function(*(column[:rows] for column in columns))
    return stacked([function(*block)] for block in in_blocks(*columns, rows=rows))[0]


def row_by_row(function: Callable[[dict[str, Any]], Any], columns: Mapping[str, Any]) -> Any:
    """`function(columns)`, (n,), where each row depends on this row of the columns alone."""
    return by_blocks(
        lambda *block: function(dict(zip(columns, block, strict=True))),
        *columns.values(),
        rows=WIDE,
    )


def picked(values: Any, rows: Rows | BoolArray) -> Any:
    """Return the values at some rows (or the row numbers), given by numbers or by a mask, (n,), in
    parts that each read little of a long column.
    """
    if isinstance(rows, range):
        return values[rows.start : rows.stop]
    if rows.dtype == np.bool_:
        return by_blocks(lambda part, here: row_numbers(part)[here], values, rows)

    def parts() -> Iterator[list[Any]]:
        for part in np.array_split(rows, -(-len(values) // WIDE) or 1):
            yield [values[part]]
            give_back(values)
            give_back(rows)

    return stacked(parts())[0]


def joined(columns: Sequence[Any]) -> Any:
    """Return columns one after the other, (n,)."""
    blocks = (block for column in columns for block in in_blocks(column))
    return columns[0] if len(columns) == 1 else stacked(blocks)[0]


def row_numbers(rows: Rows) -> IntArray:
    """Return row numbers, (n,), of which those that follow each other need not be in memory."""
    return np.arange(rows.start, rows.stop, rows.step) if isinstance(rows, range) else rows


def rows_where(mask: BoolArray) -> Rows:
    """Return the numbers of the rows where `mask`, (n,)."""
    first, count = int(mask.argmax()), int(np.count_nonzero(mask))
    if mask[first : first + count].all():
        return range(first, first + count)
    found: IntArray = picked(range(len(mask)), mask)
    return found


def give_back(column: object) -> None:
    """Let go of the memory that a column mapped from a file takes; its values are read from the
    file again where they are needed.
    """
    if (owner := _map_of(column)) is not None and hasattr(mmap, "MADV_DONTNEED"):
        owner.madvise(mmap.MADV_DONTNEED)


def _map_of(column: object) -> mmap.mmap | None:
    """Return the file that a column is mapped from; None of one in memory."""
    while isinstance(column, np.ndarray):
        column = column.base
    column = column.obj if isinstance(column, memoryview) else column
    return column if isinstance(column, mmap.mmap) else None
