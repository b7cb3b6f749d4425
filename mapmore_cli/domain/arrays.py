"""Array types that every layer speaks, and columns taken block by block."""

from __future__ import annotations

import mmap
from collections.abc import Iterator, Mapping
from typing import Annotated, Any

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

BoolArray = np.ndarray[_Shape, np.dtype[np.bool_]]
"""Masks over samples."""

Value = Array | np.float64
"""One number for every row, or one for all."""

Columns = Mapping[QuantityName, Array]
"""Quantities by canonical name, each `(n,)`, row for row of one table."""

Ranges = Mapping[QuantityName, Span]
"""Least and greatest value of each quantity."""


ROWS = 1 << 17
"""Samples of a block: one megabyte of a column."""


def row_blocks(size: int) -> Iterator[slice]:
    """Slices that follow each other over `size` rows, at least one."""
    return (slice(start, min(start + ROWS, size)) for start in range(0, max(size, 1), ROWS))


def in_blocks(*columns: Any, overlap: int = 0) -> Iterator[tuple[Any, ...]]:
    """Blocks of columns of one length, `(n, ...)` each, at least one.

    Every block but the first begins with the last `overlap` rows of the one before.
    """
    for part in row_blocks(len(columns[0])):
        yield tuple(column[max(0, part.start - overlap) : part.stop] for column in columns)
        for column in columns:
            give_back(column)


def extremes(column: Array, mask: BoolArray | None = None) -> tuple[float, float]:
    """Return the least and the largest value of a column, (n,), or of those where `mask`; NaN where
    one is NaN. Raises ValueError where there is no value.
    """
    blocks = blocks_where(column, mask)
    ends = np.array([(x.min(), x.max()) for x in blocks if x.size]).reshape(-1, 2)
    return float(ends[:, 0].min()), float(ends[:, 1].max())


def blocks_where(column: Array, mask: BoolArray | None = None) -> Iterator[Array]:
    """Yield the values of a column where `mask`, all without one, block by block."""
    columns = (column,) if mask is None else (column, mask)
    return (values[where[0]] if where else values for values, *where in in_blocks(*columns))


def give_back(column: Any) -> None:
    """Let go of the memory that a column mapped from a file takes; its values are read from the
    file again where they are needed.
    """
    owner = column
    while isinstance(owner, np.ndarray):
        owner = owner.base
    owner = owner.obj if isinstance(owner, memoryview) else owner
    if isinstance(owner, mmap.mmap) and hasattr(mmap, "MADV_DONTNEED"):
        owner.madvise(mmap.MADV_DONTNEED)
