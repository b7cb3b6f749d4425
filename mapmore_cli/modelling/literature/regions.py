"""Regions of the inputs in which a formula has parameters of their own."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns
from mapmore_cli.modelling.literature.checks import needed

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
        """What the parameter `name` is called in this region, as `B0_rise`."""
        return f"{name}_{self.label}"

    def rows(self, columns: Columns) -> BoolArray:
        """True on the rows in the region, `(n,)`."""
        return np.asarray(np.all([condition.holds(columns) for condition in self.conditions], axis=0))


DIRECTIONS = (Region("rise", (Condition("direction", ">", 0.0),)), Region("fall", (Condition("direction", "<", 0.0),)))
"""Rise and fall of the pressure, `direction` +1 and -1 (M2 eq 16); where it is 0 the muscle has not moved yet, which is neither."""
