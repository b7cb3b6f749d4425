"""Descents from several starting values (W: ten), and how many of them end at the same place."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol, TypeVar

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.literature.problem import Nonlinear

STARTS = 10
SEED = 20170714  # any fixed number: the same data give the same fit
AGREEMENT = 1e-6  # relative difference between sums of squares that are called equal
RIVAL = 1.25  # times the least sum of squares (1.12 times the RMSE), up to which another minimum is told
DISTINCT = 1e-3  # relative difference between sums of squares of minima that are called different


class End(Protocol):
    """Where a descent ended."""

    @property
    def x(self) -> Array:
        """The place."""

    @property
    def cost(self) -> float:
        """Half of the sum of squares there, or all of it."""


Found = TypeVar("Found", bound=End)


def draw(nonlinear: tuple[Nonlinear, ...]) -> Iterator[Array]:
    """Return `STARTS` seeded places in the intervals, each `(k,)` and log-uniform in magnitude; a single empty one without parameters."""
    rng = np.random.default_rng(SEED)
    for _ in range(STARTS if nonlinear else 1):
        yield np.array([_place(parameter, rng) for parameter in nonlinear])


def lowest(ends: Sequence[Found], starts: int) -> tuple[Found, str]:
    """Return the end with the lowest cost of those that the `starts` have reached, and a note on how many came to it."""
    best = min(ends, key=lambda end: float(end.cost))
    agreeing = sum(end.cost <= (1 + AGREEMENT) * best.cost + 1e-20 for end in ends)
    return best, f"{agreeing} of {starts} starts agree on the sum of squares"


def rivals(converged: Sequence[Found], best: Found) -> list[Found]:
    """Return ends in other minima than the best that are nearly as deep, one of each, the deepest first."""
    found = [best]
    for end in sorted(converged, key=lambda end: float(end.cost)):
        if (1 + DISTINCT) * found[-1].cost < end.cost <= RIVAL * best.cost:
            found.append(end)
    return found[1:]


def _place(parameter: Nonlinear, rng: np.random.Generator) -> float:
    lower, upper = parameter.intervals[rng.integers(len(parameter.intervals))]
    return float(lower * (upper / lower) ** rng.random())
