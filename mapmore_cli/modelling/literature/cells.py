"""Cells of the inputs: means over a grid for long searches, levels that were held, and regions with parameters of their own."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns
from mapmore_cli.domain.errors import DataError

_COMPARISONS: Mapping[str, Callable[[Array, float], BoolArray]] = {">": operator.gt, "<": operator.lt, "<=": operator.le}


@dataclass(frozen=True)
class Condition:
    """`quantity comparison value`, with `>`, `<` or `<=`."""

    quantity: str
    comparison: str
    value: float

    def __str__(self) -> str:
        return f"{self.quantity} {self.comparison} {self.value:g}"

    def holds(self, columns: Columns) -> BoolArray:
        """Rows on which it holds, `(n,)`; False where the quantity is NaN."""
        return _COMPARISONS[self.comparison](needed(self.quantity, columns), self.value)


@dataclass(frozen=True)
class Region:
    """Rows on which all `conditions` hold; `label` ends the names of its parameters."""

    label: str
    conditions: tuple[Condition, ...]

    def __and__(self, other: Region) -> Region:
        return Region(f"{self.label}_{other.label}", (*self.conditions, *other.conditions))

    def __str__(self) -> str:
        return ", ".join(map(str, self.conditions))

    def parameter(self, name: str) -> str:
        """Return what the parameter `name` is called in this region, as `B0_rise`."""
        return f"{name}_{self.label}"

    def rows(self, columns: Columns) -> BoolArray:
        """Return True on the rows in the region, `(n,)`."""
        return np.asarray(np.all([condition.holds(columns) for condition in self.conditions], axis=0))


DIRECTIONS = (Region("rise", (Condition("direction", ">", 0.0),)), Region("fall", (Condition("direction", "<", 0.0),)))
"""Rise and fall of the pressure, `direction` +1 and -1 (M2 eq 16); where it is 0 the muscle has not moved yet, which is neither."""


LIMIT = 4096
"""Most cells; tables of no more rows are left as they are."""

FINEST = 512
"""Cells along the range of an input, halved until there are no more than `LIMIT` in all."""


@dataclass(frozen=True)
class Cells:
    """Mean inputs and mean target of every occupied cell, each `(cells,)`, and the number of rows that each stands for."""

    columns: Columns
    y: Array
    counts: Array


def condensed(columns: Columns, y: Array) -> Cells:
    """`columns` and `y`, each `(n,)`, averaged over the finest grid that leaves at most `LIMIT` cells.

    A sum of squares weighted by the counts is that of the rows, less their scatter within the cells, up to the curvature of the model
    over a cell: a hinge of slope one and width w is missed by 1/(96 w 512^2) of the full scale, 4e-6 where w = 0.01.
    """
    if len(y) <= LIMIT:
        return Cells(columns, y, np.ones(len(y)))
    places = [_place(column) for column in columns.values()]
    bins = FINEST
    while True:
        keys = np.zeros(len(y), dtype=np.int64)
        for place in places:
            keys = keys * (bins + 1) + np.floor(place * bins).astype(np.int64)
        cells, cell, counts = np.unique(keys, return_inverse=True, return_counts=True)
        if len(cells) <= LIMIT:
            break
        bins //= 2
    means = {name: np.bincount(cell, column) / counts for name, column in columns.items()}
    return Cells(means, np.bincount(cell, y) / counts, counts.astype(float))


SCATTER = 0.1
"""Of the smallest distance between two levels: how far values may lie apart that are nominally one."""

VALUES_A_LEVEL = 5
"""Distinct values for every level, from which on they are scatter about it; fewer may be levels of their own."""


def nominal(column: Array) -> Array:
    """Return the column, `(n,)`, with every value replaced by the level that it scatters about; unchanged where there are no such levels.

    Levels are groups of values that lie nearer together than `SCATTER` times the smallest distance between two groups, `VALUES_A_LEVEL`
    or more in a group on the average; the finest such partition is taken.
    """
    values, place = np.unique(column, return_inverse=True)
    gaps = np.diff(values)
    sizes = np.sort(gaps)[::-1]
    for parting in sizes[:-1][sizes[1:] <= SCATTER * sizes[:-1]][::-1]:
        starts = np.concatenate([[0], np.flatnonzero(gaps >= parting) + 1])
        lowest, highest = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
        if len(values) >= VALUES_A_LEVEL * len(starts) and float((highest - lowest).max()) <= SCATTER * float(parting):
            group = np.searchsorted(starts, np.arange(len(values)), side="right") - 1
            return np.asarray(((lowest + highest) / 2)[group[place]])
    return column


def _place(column: Array) -> Array:
    """Place of every row within the range of the column, 0 to 1."""
    return np.asarray((column - column.min()) / (float(np.ptp(column)) or 1.0))


def needed(name: str, columns: Columns) -> Array:
    """Return the column `name`; raises `DataError` where it is absent."""
    if name not in columns:
        raise DataError(f"there is no column `{name}` among the inputs", "declare it under `columns` or `derive`")
    return np.asarray(columns[name], dtype=float)


def finite(name: str, column: Array) -> Array:
    """Return the column; raises `DataError` with the first row in which it is not finite."""
    values = np.asarray(column, dtype=float)
    if not np.isfinite(values).all():
        row = int(np.argmin(np.isfinite(values)))
        raise DataError(f"{name} is not finite in row {row}: {values[row]}", "drop the sample (`missing: drop`) or mend the recording")
    return values
