"""Rows sorted by the region that they lie in, so that what is the same within a region is decided once for all of its rows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import inf, prod

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray

Axis = tuple[Array, Array]
"""Values of the rows along one direction, (n,), and the edges across it, ascending: interval i has i edges at or below its values."""


def interval(edges: Array, number: int) -> tuple[float, float]:
    """First value of an interval, and the first one beyond it."""
    ends = [-inf, *edges.tolist(), inf]
    return ends[number], ends[number + 1]


def regions(axes: Sequence[Axis], n: int) -> Iterator[tuple[tuple[int, ...], IntArray]]:
    """Every region that holds some of the n rows: the number of its interval on each axis, and its rows.

    Rows that are NaN on an axis count as below its lowest edge. With fewer than 65536 regions the sort is a radix sort, whose time does not
    depend on how the rows lie.
    """
    shape = [len(edges) + 1 for _, edges in axes]
    number = np.zeros(n, dtype=np.min_scalar_type(prod(shape)))
    above = np.empty(n, dtype=bool)
    for (x, edges), count in zip(axes, shape, strict=True):
        number *= number.dtype.type(count)
        for edge in edges:
            number += np.greater_equal(x, edge, out=above).view(np.uint8)
    order = np.argsort(number, kind="stable")
    number = number[order]
    ends = [*(np.flatnonzero(number[1:] != number[:-1]) + 1).tolist(), n]
    for start, end in zip([0, *ends], ends, strict=False):
        if end > start:
            yield tuple(int(i) for i in np.unravel_index(number[start], shape)), order[start:end]
