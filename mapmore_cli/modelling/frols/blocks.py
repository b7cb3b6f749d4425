"""Row blocks: the only way in which a tall dictionary is read, so that it need not fit into memory.

`Z = [P y]` stands for the candidates with the dependent variable as one more column; arrays of `M + 1` values run over its columns.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.errors import DataError

Blocks = Callable[[], Iterable[tuple[Array, Array]]]
"""Starts a pass over the rows: yields `P (b, M)` and `y (b,)` of one block after the other."""

BLOCK = 4096
"""Rows at a time: a block of a common dictionary stays in the processor's cache between its products."""

SMALLEST, LARGEST = 1e-140, 1e140
"""Sums of squares between these can be multiplied with each other without overflow or loss by underflow."""


def row_blocks(P: Array, y: Array) -> Blocks:
    """The rows of arrays in memory, as views."""

    def blocks() -> Iterator[tuple[Array, Array]]:
        for start in range(0, len(y), BLOCK):
            yield P[start : start + BLOCK], y[start : start + BLOCK]

    return blocks


def gathered(blocks: Blocks) -> tuple[Array, Array]:
    """All rows as one `P` and one `y`."""
    P, y = zip(*blocks(), strict=True)
    return np.concatenate(P), np.concatenate(y)


def checked(blocks: Blocks) -> Blocks:
    """The blocks as arrays of double precision, cut to `BLOCK` rows.

    Raises ValueError where a block's shape does not fit.
    """

    def passed() -> Iterator[tuple[Array, Array]]:
        width = None
        for P, y in blocks():
            P, y = np.asarray(P, dtype=np.float64), np.asarray(y, dtype=np.float64)
            if P.ndim != 2 or y.ndim != 1 or len(P) != len(y) or P.shape[1] != (width or P.shape[1]):
                raise ValueError(f"a block must be P (b, M) and y (b,) with M as in the first; they are {P.shape} and {y.shape}")
            width = P.shape[1]
            yield from row_blocks(P, y)()

    return passed


def scaled(blocks: Blocks, scale: Array) -> Blocks:
    """The blocks with each column of `Z` divided by its `scale`, (M+1,)."""

    def divided() -> Iterator[tuple[Array, Array]]:
        for P, y in blocks():
            yield P / scale[:-1], y / scale[-1]

    return blocks if (scale == 1.0).all() else divided


def safe_scale(squares: Array, blocks: Blocks) -> Array:
    """Powers of two, (M+1,), that bring the columns of `Z` near one where their sums of squares left the safe range; one elsewhere.

    Parameters
    ----------
    squares
        Sums of squares as they came out, (M+1,): infinite or NaN where a value is not finite or its square overflows, zero where all
        values are zero or their squares vanish. That is where values have to be looked at one by one.

    Raises
    ------
    DataError
        Where a value is not finite, with its column and row.
    """
    scale = np.ones(len(squares))
    unsafe = np.flatnonzero(~((squares > SMALLEST) & (squares < LARGEST)))
    if len(unsafe):
        scale[unsafe] = power_of_two(_largest(blocks, unsafe))
    return scale


def power_of_two(positive: Array) -> Array:
    """The power of two next above each value; one where the value is zero. Division by it is exact."""
    return np.ldexp(1.0, np.where(positive > 0, np.frexp(positive)[1], 0))


def _largest(blocks: Blocks, columns: IntArray) -> Array:
    """Largest absolute value of some columns of `Z`, (columns,)."""
    largest = np.zeros(len(columns))
    start = 0
    for P, y in blocks():
        M = P.shape[1]
        values = np.column_stack([y if column == M else P[:, column] for column in columns])
        if not np.isfinite(values).all():
            row, place = np.argwhere(~np.isfinite(values))[0]
            raise _not_finite(int(columns[place]), start + int(row), M)
        np.maximum(largest, np.abs(values).max(axis=0), out=largest)
        start += len(y)
    return largest


def _not_finite(column: int, row: int, M: int) -> DataError:
    if column == M:
        return DataError(f"y is not finite at row {row}", "drop or mend the sample before the fit")
    return DataError(f"candidate {column} is not finite at row {row}", "drop or mend the sample, or leave the term out")
