"""What a model of motion is to be like: the keys of `model: {type: state_space}`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval, Len

from mapmore_cli.domain.declared import Contradiction, Either, Pair, Seconds, Settings, of_sibling

QUARTER = 0.25


@dataclass(frozen=True)
class Bounds(Settings):
    """Where `solver: swarm` looks for P1, P2, P3; without `p3`, four times the spans' ratio, either sign.

    The default holds every stable section: there P1 lies in -1..1 and P2 in -2..2, and `|1 - P1 - P2| < 4`.
    """

    p1: Pair = (-1.0, 1.0)
    p2: Pair = (-2.0, 2.0)
    p3: Pair | None = None

    def __post_init__(self) -> None:
        """Refuse bounds in the wrong order."""
        for name in ("p1", "p2", "p3"):
            ends = getattr(self, name)
            if ends is not None and ends[0] >= ends[1]:
                raise Contradiction(f"`{name}` goes from {ends[0]:g} to {ends[1]:g}", "put the lower bound first", name)


@dataclass(frozen=True, kw_only=True)
class MotionSettings(Settings):
    """The keys of a model of motion.

    Attributes
    ----------
    sections
        The inner boundaries in the input's unit, or how many sections with equal shares of the samples.
    direction
        Whether rise and fall of the input have sections of their own.
    offset, load
        Whether a section has a constant of its own; the quantity that P3 and the constant depend on, where there is one.
    slowest
        Longest time constant of a section, s; None for a quarter of the longest piece of a training record, which cannot tell a slower one
        from a drift. The swarm as published has no such bound.
    start
        Where a run begins: `rest` or `zero`.
    mask
        `input` or `displacement`: the quantity whose direction says which training samples are those of rise and of fall.
    seed
        Seed of the solver; every section draws numbers of its own from it.
    bounds, begin
        Where the published swarm looks, and where its particles begin; None for everywhere in the bounds.
    polish
        Whether `least_squares` goes on from what another solver has found.
    """

    input: str | None = None
    sections: Annotated[Annotated[Sequence[Annotated[float, of_sibling("input")]], Len(1)] | Annotated[int, Interval(ge=1)], Either()] = 1
    direction: bool = False
    switching: Literal["hard", "carried", "bumpless"] = "hard"
    start: Literal["rest", "zero"] = "rest"
    mask: Literal["input", "displacement"] = "input"
    dead_band: Annotated[float, Interval(ge=0), of_sibling("input")] = 0.0
    offset: bool = False
    load: str | None = None
    solver: Literal["least_squares", "differential_evolution", "swarm", "swarm_projected"] = "least_squares"
    polish: bool = False
    particles: Annotated[int, Interval(ge=2)] = 50
    iterations: Annotated[int, Interval(ge=1)] = 20
    seed: Annotated[int, Interval(ge=0)] = 1
    slowest: Seconds | None = None
    bounds: Bounds | None = None
    begin: Bounds | None = None


@dataclass(frozen=True, kw_only=True)
class MotionRecipe(MotionSettings):
    """The settings of one fit: the input is known, the `output` and the `step` between samples (s) are those of the records."""

    input: str
    output: str
    step: float

    def reach(self, longest: int) -> float:
        """Return the largest modulus of a pole, `exp(-step/slowest)`, where the longest piece has so many samples."""
        return math.exp(-self.step / (QUARTER * longest * self.step if self.slowest is None else self.slowest))

    @property
    def drives(self) -> tuple[str, ...]:
        """Terms that drive every section, the input first. Sections that share a state need a constant each to meet at their boundaries."""
        constant = self.offset or self.switching == "bumpless"
        on_load = () if self.load is None else (self.load, f"{self.input}*{self.load}")
        return (self.input, *(("1",) if constant or on_load else ()), *on_load)
