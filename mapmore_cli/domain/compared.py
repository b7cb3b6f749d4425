"""Define the samples that belong to one row of the score table, and compute sums over these
samples.
"""

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
    """Number by which errors are divided to obtain the NRMSE, and the name of this number, which
    every score table shows.
    """

    name: str
    value: float
    # range (maximum minus minimum) of the samples from which the normaliser is computed
    extent: float = math.nan

    def fraction(self, error: float) -> float:
        """Return the error as a fraction of the normaliser; NaN if the normaliser is zero or
        unknown.
        """
        return error / self.value if self.value > 0 else math.nan


class SampleBlock(NamedTuple):
    """Samples with the predictions of a model, (n,) each. A value is NaN if it is unknown or if
    there is no prediction. For a model with memory, `recorded` additionally has the measured values
    before the first prediction.
    """

    recorded: Array
    measured: Array
    predicted: Array
    one_step: Array  # one-step-ahead predictions, which are computed from measured outputs
    half: Array  # half the width of the prediction interval
    sigma: Array  # standard deviation of the measured values

    @property
    def error(self) -> Array:
        """Prediction minus measured value."""
        return self.predicted - self.measured


@dataclass(frozen=True)
class Compared:
    """All samples that belong to a row of the score table. Each call of `blocks` returns these
    samples, block by block.

    - `scale`: number by which errors are divided.
    - `free`: number of parameters that were fitted to these samples.
    """

    blocks: Callable[[], Iterable[SampleBlock]]
    scale: Normaliser
    free: int = 0

    def total(self, of: Callable[[SampleBlock], Array | BoolArray]) -> float:
        """Return the sum of `of(block)` over all samples."""
        return float(sum(float(of(block).sum()) for block in self.blocks()))

    def spread(self, of: Callable[[SampleBlock], Array]) -> float:
        """Return the sum of squares, over all samples, of the difference between `of(block)` and
        its mean.
        """
        mean = self.total(of) / max(sum(len(of(block)) for block in self.blocks()), 1)
        return self.total(lambda block: (of(block) - mean) ** 2)

    def median(self, of: Callable[[SampleBlock], Array]) -> float:
        """Return the median of the finite values of `of(block)`; NaN if there are none. Of more
        than a million values, only some that are evenly spread are used.
        """
        every = 1 + self.n // MOST_VALUES
        values = np.concatenate([of(block)[::every] for block in self.blocks()])
        known = values[np.isfinite(values)]
        return float(np.median(known)) if len(known) else math.nan

    @cached_property
    def known(self) -> set[str]:
        """Names of the columns of `SampleBlock` in which at least one sample has a finite value."""
        columns = (column for block in self.blocks() for column in block._asdict().items())
        return {name for name, values in columns if np.isfinite(values).any()}

    @cached_property
    def n(self) -> int:
        """Number of samples in this row of the score table."""
        return sum(len(block.measured) for block in self.blocks())

    @cached_property
    def squared_error(self) -> float:
        """Sum of the squared errors."""
        return self.total(lambda block: block.error**2)

    @property
    def rmse(self) -> float:
        """Root of the mean squared error."""
        return math.sqrt(self.squared_error / self.n)

    @cached_property
    def worst(self) -> float:
        """Largest absolute error."""
        return float(np.max([np.abs(block.error).max(initial=0.0) for block in self.blocks()]))

    @cached_property
    def recorded_spread(self) -> float:
        """Sum of squares of the recorded values about their mean. The measured history of a model
        with memory is included, as is usual for the RRSE.
        """
        return self.spread(lambda block: block.recorded)

    @cached_property
    def chi2(self) -> float:
        """Sum of squares of (error divided by uncertainty of the sample); NaN if the uncertainties
        are unknown.
        """
        return self.total(lambda block: (block.error / block.sigma) ** 2)

    @property
    def correlation(self) -> float:
        """Correlation without subtracting means, `sum y yhat / sqrt(sum y^2 sum yhat^2)`, which the
        paper about the wrist joint calls R (docs/references.md). It is not Pearson's correlation;
        NaN if either signal is zero throughout.
        """
        products = self.total(lambda block: block.measured * block.predicted)
        squares = self.total(lambda block: block.measured**2)
        squares *= self.total(lambda block: block.predicted**2)
        return ratio(products, math.sqrt(squares))


MOST_VALUES = 1_000_000
"""Largest number of values from which a median is computed; more are thinned evenly."""


def ratio(above: float, below: float) -> float:
    """Return the quotient of two numbers; NaN if the divisor is zero."""
    return above / below if below > 0 else math.nan
