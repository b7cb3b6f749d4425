"""Columns that are filled piece by piece, in hardly more memory than they take in the end."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from mapmore_cli.domain.arrays import Array, IntArray

T = TypeVar("T", np.int64, np.float64)

SPARE = 1.02
"""Room beyond what is expected, so that lines that get a little shorter make no copy necessary."""


class Growing:
    """Line numbers and values of the rows that have come so far; room is made for as many as the share that has been read lets expect."""

    def __init__(self, columns: int) -> None:
        self._size = 0
        self._rows: IntArray = np.empty(0, dtype=np.int64)
        self._columns: list[Array] = [np.empty(0) for _ in range(columns)]

    def add(self, rows: IntArray, values: Array, share: float) -> None:
        """Append rows, (b,), and their values, (b, columns); `share` of the file has been read with them."""
        start, end = self._size, self._size + len(rows)
        if end > len(self._rows):
            room = max(end, int(SPARE * end / share))
            self._rows = _moved(self._rows, start, room)
            for j, column in enumerate(self._columns):
                self._columns[j] = _moved(column, start, room)
        self._rows[start:end] = rows
        for column, added in zip(self._columns, values.T, strict=True):
            column[start:end] = added
        self._size = end

    @property
    def rows(self) -> IntArray:
        """All line numbers, (n,)."""
        return self._rows[: self._size]

    @property
    def columns(self) -> list[Array]:
        """All values, each (n,)."""
        return [column[: self._size] for column in self._columns]


def _moved(array: NDArray[T], start: int, room: int) -> NDArray[T]:
    larger = np.empty(room, dtype=array.dtype)  # pages that nothing is written to take no memory
    larger[:start] = array[:start]
    return larger
