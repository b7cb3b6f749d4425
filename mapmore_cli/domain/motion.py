"""Piecewise state-space models of motion (P) as data: what a model file holds and what predicts on a recording that nobody has seen."""

from __future__ import annotations

import cmath
from dataclasses import dataclass

from mapmore_cli.domain.arrays import Array

HARD, CARRIED, BUMPLESS = "hard", "carried", "bumpless"
"""How a model changes from section to section."""

REST, ZERO = "rest", "zero"
"""Where a run begins: in the steady state of its first input, or at an output of zero."""

ALL, RISE, FALL = "all", "rise", "fall"
"""Directions of the input in which a section holds."""


@dataclass(frozen=True)
class MotionSection:
    """One linear section, in discrete time: `x1[k+1] = x2[k]`, `x2[k+1] = P1 x1[k] + P2 x2[k] + sum_m w_m d_m[k]`, output `x1`.

    P eq 10, whose `x2` is the output one sample ahead. The drives d are the model's; the first is the input, so that `w_1` is P3.
    """

    id: str  # 1, rise 2
    place: int  # along the input, from 1
    direction: str  # all | rise | fall
    p1: float
    p2: float
    weights: Array  # (m,), in the output's unit over that of the drive

    @property
    def p3(self) -> float:
        """Weight of the input."""
        return float(self.weights[0])

    @property
    def poles(self) -> tuple[complex, complex]:
        """Roots of `z^2 - P2 z - P1`, the larger modulus first."""
        half, root = 0.5 * self.p2, cmath.sqrt(0.25 * self.p2**2 + self.p1)
        first, second = half + root, half - root
        return (first, second) if abs(first) >= abs(second) else (second, first)

    @property
    def radius(self) -> float:
        """Largest modulus of a pole; the section is stable below 1."""
        return abs(self.poles[0])

    @property
    def gain(self) -> float:
        """Steady output for one unit of the input, `P3/(1 - P1 - P2)`."""
        return self.p3 / (1.0 - self.p1 - self.p2)


@dataclass(frozen=True)
class Motion:
    """Sections along the input, each for one direction of it or for both (P eq 14-17).

    Attributes
    ----------
    step
        Time between samples, s.
    switching
        `hard`: every section runs on the whole input, the active one's output is taken. `carried`: one state passes from section to
        section. `bumpless`: the same, with sections whose steady outputs meet at their boundaries.
    boundaries
        Inputs at which sections meet, ascending; one fewer than there are sections along the input.
    directed
        Whether sections differ between a rising and a falling input.
    dead_band
        How far the input has to turn back before its direction changes, in its unit. It is 0 without bumpless switching: the input then
        falls unless it rises.
    drives
        Texts of the terms that drive every section, the input first: as `input`, `1`, `load`, `input*load`.
    sections
        In order along the input, `rise` before `fall`.
    limits
        Training range of the input.
    start
        `rest`: a run begins in the steady state of its first input. `zero`: it begins at an output of zero (P, on each reference).
    """

    input: str
    output: str
    step: float
    switching: str
    boundaries: tuple[float, ...]
    directed: bool
    dead_band: float
    drives: tuple[str, ...]
    sections: tuple[MotionSection, ...]
    limits: tuple[float, float]
    start: str = REST


@dataclass(frozen=True)
class SectionSearch:
    """How one section's parameters were found: `history` is the lowest RMSE so far, (iterations + 1,) from the start on."""

    section: str
    samples: int
    rmse: float  # over the section's own samples, in the output's unit
    evaluations: int  # simulations of its samples
    history: Array


@dataclass(frozen=True)
class MotionFit:
    """A model of motion, and how each of its sections was found by the `solver` of that name."""

    model: Motion
    solver: str
    searches: tuple[SectionSearch, ...]
    notes: tuple[str, ...] = ()
