"""The middle of more values than memory holds, exactly: they are counted by their leading bits, sixteen at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from mapmore_cli.domain.arrays import Array

DIGIT = 16
"""Bits that are told apart in one pass over the values; a double has four such digits."""

_SIGN = np.uint64(1 << 63)


def middle(values: Callable[[], Iterator[Array]], count: int) -> float:
    """The median of `count` finite values, which `values` goes through block by block each time that it is called."""
    low = ranked(values, (count - 1) // 2)
    high = low if count % 2 else ranked(values, count // 2)
    return (low + high) / 2


def ranked(values: Callable[[], Iterator[Array]], rank: int) -> float:
    """The value before which `rank` others come in ascending order."""
    leading = 0
    for shift in range(64 - DIGIT, -1, -DIGIT):
        counts = np.zeros(1 << DIGIT, dtype=np.int64)
        for block in values():
            digits = _keys(block) >> np.uint64(shift)
            here = digits[digits >> np.uint64(DIGIT) == leading] & np.uint64((1 << DIGIT) - 1)
            counts += np.bincount(here.astype(np.int64), minlength=1 << DIGIT)  # NumPy 1 counts no unsigned numbers
        digit = int(np.searchsorted(np.cumsum(counts), rank, side="right"))
        rank -= int(counts[:digit].sum())
        leading = leading << DIGIT | digit
    return float(_values(np.array([leading], dtype=np.uint64))[0])


def _keys(values: Array) -> NDArray[np.uint64]:
    """Whole numbers in the order of the values: their bits, with the sign turned round, and all bits of negative ones."""
    bits = np.ascontiguousarray(values).view(np.uint64)
    return np.where(bits & _SIGN, ~bits, bits | _SIGN)


def _values(keys: NDArray[np.uint64]) -> Array:
    bits = np.where(keys & _SIGN, keys & ~_SIGN, ~keys)
    return bits.view(np.float64)
