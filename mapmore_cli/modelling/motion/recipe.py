"""What a model of motion is to be like, and how it is looked for."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mapmore_cli.domain.motion import HARD

QUARTER = 0.25


@dataclass(frozen=True)
class Box:
    """Where a swarm looks for P1, P2, P3; without `p3`, four times the span of the output over that of the input, either sign.

    The default holds every stable section: there P1 lies in -1..1 and P2 in -2..2, and `|1 - P1 - P2| < 4`.
    """

    p1: tuple[float, float] = (-1.0, 1.0)
    p2: tuple[float, float] = (-2.0, 2.0)
    p3: tuple[float, float] | None = None


@dataclass(frozen=True)
class MotionRecipe:
    """Settings of one fit.

    Attributes
    ----------
    step
        Time between samples, s.
    sections
        The inner boundaries in the input's unit, or how many sections with equal shares of the samples.
    direction
        Whether rise and fall of the input have sections of their own.
    offset, load
        Whether a section has a constant of its own; the quantity that P3 and the constant depend on, where there is one.
    solver
        A name of `solvers.NAMES`.
    slowest
        Longest time constant of a section, s; None for a quarter of the longest piece of a training record, which cannot tell a slower one
        from a drift. The swarm as published has no such bound.
    polish
        Whether `least_squares` goes on from what another solver has found.
    """

    input: str
    output: str
    step: float
    sections: int | tuple[float, ...] = 1
    direction: bool = False
    switching: str = HARD
    dead_band: float = 0.0
    offset: bool = False
    load: str | None = None
    solver: str = "least_squares"
    polish: bool = False
    particles: int = 50
    iterations: int = 20
    seed: int = 1
    slowest: float | None = None
    box: Box = Box()

    def reach(self, longest: int) -> float:
        """Largest modulus of a pole, `exp(-step/slowest)`, where the longest piece has so many samples."""
        return math.exp(-self.step / (QUARTER * longest * self.step if self.slowest is None else self.slowest))

    @property
    def drives(self) -> tuple[str, ...]:
        """Terms that drive every section, the input first. Sections that share a state need a constant each to meet at their boundaries."""
        constant = self.offset or self.switching != HARD
        on_load = () if self.load is None else (self.load, f"{self.input}*{self.load}")
        return (self.input, *(("1",) if constant or on_load else ()), *on_load)
