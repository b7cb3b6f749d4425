"""Arrays of the samples that belong to one row of the score table, and sums over them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray


@dataclass(frozen=True)
class Normaliser:
    """What errors are divided by; a table always names it."""

    name: str
    value: float
    extent: float = math.nan  # range of the same samples

    def fraction(self, error: float) -> float:
        """Return the error as a fraction; NaN where there is nothing to divide by."""
        return error / self.value if self.value > 0 else math.nan


class SampleBlock(NamedTuple):
    """Samples, (n,) each, with what a model says of them; NaN where it says nothing, or nothing is
    known. `recorded` has in addition the history that a model with memory goes on from.
    """

    recorded: Array
    measured: Array
    predicted: Array
    one_step: Array  # predictions from the measured past
    half: Array  # half of the width of the interval
    sigma: Array  # uncertainty of what was measured

    @property
    def error(self) -> Array:
        """Return what the model says too much."""
        return self.predicted - self.measured


@dataclass(frozen=True)
class Compared:
    """All samples of a row of the score table; each call of `blocks` yields them, block by block.

    - `scale`: what errors are divided by.
    - `free`: the numbers that were fitted to these samples.
    """

    blocks: Callable[[], Iterable[SampleBlock]]
    scale: Normaliser
    free: int = 0

    def total(self, of: Callable[[SampleBlock], Array | BoolArray]) -> float:
        """Return the sum over all samples."""
        with np.errstate(over="ignore", invalid="ignore"):
            return float(sum(float(np.sum(of(block))) for block in self.blocks()))

    def spread(self, of: Callable[[SampleBlock], Array]) -> float:
        """Return the sum of squares about the mean."""
        mean = self.total(of) / max(self.total(lambda block: np.ones(len(of(block)))), 1)
        return self.total(lambda block: (of(block) - mean) ** 2)

    def median(self, of: Callable[[SampleBlock], Array]) -> float:
        """Return the median of the known values, of at most a million that are evenly taken; NaN if
        there are none.
        """
        every = 1 + self.n // MOST_VALUES
        values = np.concatenate([of(block)[::every] for block in self.blocks()])
        known = values[np.isfinite(values)]
        return float(np.median(known)) if len(known) else math.nan

    @cached_property
    def n(self) -> int:
        """Return the number of samples."""
        return sum(len(block.measured) for block in self.blocks())

    @cached_property
    def squared_error(self) -> float:
        """Return the sum of the squared errors."""
        return self.total(lambda block: block.error**2)

    @property
    def rmse(self) -> float:
        """Return the root of the mean squared error."""
        return math.sqrt(self.squared_error / self.n)

    @cached_property
    def worst(self) -> float:
        """Return the largest absolute error."""
        return float(np.max([np.abs(block.error).max(initial=0.0) for block in self.blocks()]))

    @cached_property
    def recorded_spread(self) -> float:
        """Return the sum of squares of what was recorded about its mean, the history included, as
        is usual for the RRSE.
        """
        return self.spread(lambda block: block.recorded)

    @cached_property
    def chi2(self) -> float:
        """Return the sum of squares of the errors over their uncertainty; NaN without one."""
        return self.total(lambda block: (block.error / block.sigma) ** 2)

    @property
    def correlation(self) -> float:
        """Return W's correlation index `sum y yhat / sqrt(sum y^2 sum yhat^2)`, not Pearson's; NaN
        where either is zero throughout.
        """
        products = self.total(lambda block: block.measured * block.predicted)
        squares = self.total(lambda block: block.measured**2)
        squares *= self.total(lambda block: block.predicted**2)
        return ratio(products, math.sqrt(squares))


MOST_VALUES = 1_000_000
"""Values that a median is of; of more, an even share."""


def ratio(above: float, below: float) -> float:
    """Return a quotient; NaN where there is nothing to divide by."""
    return above / below if below > 0 else math.nan
