"""Define the array types of all layers, and operations on columns that work block by block.

A column that does not fit into memory is a read-only array that is mapped from a file. Code that
processes it block by block needs memory for one block only; any other code needs memory for the
whole column.
"""

from __future__ import annotations

import math
import mmap
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from contextvars import ContextVar
from itertools import chain
from typing import Annotated, Any
from weakref import WeakKeyDictionary

import numpy as np

from mapmore_cli.domain.declared import QuantityName, ValueCondition
from mapmore_cli.domain.errors import DataError

_Shape = tuple[Any, ...]

# not `NDArray`, because NumPy 2.5 changed how this alias is defined
Array = np.ndarray[_Shape, np.dtype[np.float64]]
"""Measured or computed values; shapes are given where the array is used."""

FINITE = ValueCondition("is not finite", lambda values: np.isfinite(values).all())
ASCENDING = ValueCondition("does not ascend", lambda values: (np.diff(values) >= 0).all())
Number = Annotated[float, FINITE]
Span = Annotated[tuple[Number, Number], ASCENDING]

Ends = tuple[float, float]
"""Smallest and largest value of a quantity."""

Numbers = Annotated[Array, FINITE]
"""Values without which a model cannot be used; they must be finite."""

IntArray = np.ndarray[_Shape, np.dtype[np.int64]]
"""Row numbers and identifiers."""

Rows = range | IntArray
"""Row numbers. Consecutive rows are a range, which needs no memory."""

BoolArray = np.ndarray[_Shape, np.dtype[np.bool_]]
"""Masks over samples."""

Value = Array | np.float64
"""One number for every row, or one number for all rows."""

Columns = Mapping[QuantityName, Array]
"""Quantities by canonical name, shape (n,) each, with the rows of one table."""

Ranges = Mapping[QuantityName, Span]
"""Smallest and largest value of each quantity."""


def row_count(columns: Columns) -> int:
    """Return the number of rows of a table; zero for a table without columns."""
    return len(next(iter(columns.values()), ()))


def column_in(columns: Columns, name: str) -> Array:
    """Return the column with the given name. Raises DataError if the table lacks the column."""
    if name not in columns:
        raise DataError(
            f"there is no column `{name}`", f"the columns are: {', '.join(columns) or 'none'}"
        )
    return columns[name]


def columns_at(columns: Columns, rows: slice | IntArray | BoolArray) -> dict[str, Array]:
    """Return every column with only the given rows."""
    return {name: values[rows] for name, values in columns.items()}


def root_mean_square(values: Array) -> float:
    """Return `sqrt(mean(x^2))` of all values; NaN without values."""
    return float(np.sqrt(np.mean(values**2))) if values.size else math.nan


ROWS, WIDE = 1 << 14, 1 << 17
"""Numbers of samples in a block. A column of `ROWS` numbers has 128 KB, so that values computed
from it stay in the processor's cache. `WIDE` is for work in which each call has a high cost,
whatever the number of samples, for example the calls of a model.
"""


def row_blocks(size: int, rows: int = ROWS) -> Iterator[slice]:
    """Yield consecutive slices that cover `size` rows. Each slice has `rows` rows; the last slice
    may have fewer. If `size` is 0, yield a single empty slice.
    """
    return (slice(start, min(start + rows, size)) for start in range(0, max(size, 1), rows))


def in_blocks(*columns: Any, overlap: int = 0, rows: int = ROWS) -> Iterator[tuple[Any, ...]]:
    """Yield blocks of consecutive rows of columns of equal length, shape (n, ...) each. Every block
    is a tuple with the same rows of each column. Empty columns give a single empty block.

    Every block except the first begins with the last `overlap` rows of the block before.
    """
    for part in row_blocks(len(columns[0]), rows):
        yield tuple(column[max(0, part.start - overlap) : part.stop] for column in columns)
        if part.stop % WIDE == 0 or part.stop == len(columns[0]):
            for column in columns:
                give_back(column)


def extremes(column: Array, mask: BoolArray | None = None) -> Ends:
    """Return the smallest and the largest value of a column, (n,), or of its rows in `mask`; NaN if
    a value is NaN. Raises ValueError if there is no value.
    """
    if len(column) <= ROWS:  # for a short column, a computation without blocks is faster
        values = column if mask is None else column[mask]
        return float(values.min()), float(values.max())
    if mask is not None and not mask.all():
        return _ends_of(blocks_where(column, mask))
    # The extremes of a column in a file are remembered, because the file does not change.
    of = _map_of(column)
    known = {} if of is None else _mapped.setdefault(of, {})
    place = (column.__array_interface__["data"][0], column.shape, column.strides)
    if place not in known:
        known[place] = _ends_of(x for (x,) in in_blocks(column, rows=WIDE))
    return known[place]


def _ends_of(blocks: Iterable[Array]) -> Ends:
    ends = np.array([(x.min(), x.max()) for x in blocks if x.size]).reshape(-1, 2)
    return float(ends[:, 0].min()), float(ends[:, 1].max())


def blocks_where(column: Array, mask: BoolArray) -> Iterator[Array]:
    """Yield the values of a column at the rows in which `mask` is True, block by block."""
    return (values[where] for values, where in in_blocks(column, mask))


LONG = 8_000_000
"""Smallest size, in bytes, of a column that is kept in a file: a million numbers."""

MOST = 200
"""Largest number of columns in files at the same time, because each keeps a file open. Further
columns stay in memory.
"""

SCRATCH: ContextVar[str | None] = ContextVar("SCRATCH", default=None)
"""Folder of the files that hold long columns; None for the temporary folder of the system. The
files have no name, and disappear with their columns or with the program.
"""

_mapped: WeakKeyDictionary[mmap.mmap, dict[Any, Ends]] = WeakKeyDictionary()
"""Smallest and largest values that were already computed, for columns that are in files."""


def stacked(blocks: Iterable[Sequence[Any]]) -> list[Any]:
    """Join blocks into whole columns. Each block has a part of every column, (b,) or (b, k), and
    there must be at least one block. Long columns are written to files. Raises OSError if the disk
    is full.
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
    """Write the columns to files, block by block, and return them as arrays mapped from these
    files. The columns have the data types, and the numbers of values per row, of the parts in the
    block `like`.
    """
    with ExitStack() as opened:
        files = [opened.enter_context(tempfile.TemporaryFile(dir=SCRATCH.get())) for _ in like]
        for block in blocks:
            for file, part in zip(files, block, strict=True):
                file.write(np.ascontiguousarray(part).data)
        for file in files:
            file.flush()
        contents = [mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) for file in files]
    _mapped.update((content, {}) for content in contents)
    return [
        np.frombuffer(content, block.dtype).reshape(-1, *block.shape[1:])
        for content, block in zip(contents, like, strict=True)
    ]


def by_blocks(function: Callable[..., Any], *columns: Any, rows: int = ROWS) -> Any:
    """Return `function(*columns)`, computed in blocks. Each row of the result may depend only on
    the same row of the columns.
    """
    if len(columns[0]) <= rows:  # for a short column, a computation without blocks is faster
        return function(*(column[:rows] for column in columns))
    return stacked([function(*block)] for block in in_blocks(*columns, rows=rows))[0]


def row_by_row(function: Callable[[dict[str, Any]], Any], columns: Mapping[str, Any]) -> Any:
    """Return `function(columns)`, (n,), computed in blocks, where `columns` is a mapping from names
    to columns. Each row of the result may depend only on the same row of the columns.
    """
    return by_blocks(
        lambda *block: function(dict(zip(columns, block, strict=True))),
        *columns.values(),
        rows=WIDE,
    )


def picked(values: Any, rows: Rows | BoolArray) -> Any:
    """Return the values at some rows, (n,). The rows are given as row numbers or as a mask.
    `values` may be a range of row numbers; the result then consists of row numbers. A long column
    is read in small parts.
    """
    if isinstance(rows, range):
        return values[rows.start : rows.stop]
    if len(values) <= ROWS:  # for a short column, a computation without blocks is faster
        return row_numbers(values)[rows]
    if rows.dtype == np.bool_:
        return by_blocks(lambda part, here: row_numbers(part)[here], values, rows)

    def parts() -> Iterator[list[Any]]:
        for part in np.array_split(rows, -(-len(values) // WIDE) or 1):
            yield [values[part]]
            give_back(values)
            give_back(rows)

    return stacked(parts())[0]


def joined(columns: Sequence[Any]) -> Any:
    """Concatenate columns into a single column, (n,)."""
    blocks = (block for column in columns for block in in_blocks(column))
    return columns[0] if len(columns) == 1 else stacked(blocks)[0]


def row_numbers(rows: Rows) -> IntArray:
    """Return row numbers as an array, (n,). A range is converted; an array is returned
    unchanged.
    """
    return np.arange(rows.start, rows.stop, rows.step) if isinstance(rows, range) else rows


def rows_where(mask: BoolArray) -> Rows:
    """Return the numbers of the rows on which `mask`, (n,), is True."""
    first, count = int(mask.argmax()), int(np.count_nonzero(mask))
    if mask[first : first + count].all():
        return range(first, first + count)
    rows: IntArray = picked(range(len(mask)), mask)
    return rows


def give_back(column: object) -> None:
    """Release the memory of a column that is mapped from a file. When values of the column are
    needed again, they are read from the file.
    """
    if (owner := _map_of(column)) is not None and hasattr(mmap, "MADV_DONTNEED"):
        owner.madvise(mmap.MADV_DONTNEED)


def _map_of(column: object) -> mmap.mmap | None:
    """Return the file from which a column is mapped; None for a column in memory."""
    while isinstance(column, np.ndarray):
        column = column.base
    column = column.obj if isinstance(column, memoryview) else column
    return column if isinstance(column, mmap.mmap) else None
