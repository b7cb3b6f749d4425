"""Define the data of a state-space model of motion, as in Brown and Xie 2024, and of the search
that found it.
"""

from __future__ import annotations

import cmath
from dataclasses import dataclass
from typing import Annotated

from mapmore_cli.domain.arrays import ASCENDING, Array, Number, Numbers, Span
from mapmore_cli.domain.declared import Count, Label, Notes, QuantityName, TermName, one_of
from mapmore_cli.domain.fits import Fit, Step
from mapmore_cli.domain.models import Body
from mapmore_cli.domain.recording import CurveRange

HARD, CARRIED, BUMPLESS = "hard", "carried", "bumpless"
"""How a model switches from section to section."""

REST, ZERO = "rest", "zero"
"""Ways in which a run begins: in the steady state of its first input, or with an output of zero."""

ALL, RISE, FALL = "all", "rise", "fall"
"""Directions of the input for which a section is active."""


def poles(p1: float, p2: float) -> tuple[complex, complex]:
    """Return the roots of `z^2 - P2 z - P1`, the root with the larger modulus first."""
    half, root = 0.5 * p2, cmath.sqrt(0.25 * p2 * p2 + p1)
    first, second = half + root, half - root
    return (first, second) if abs(first) >= abs(second) else (second, first)


@dataclass(frozen=True)
class MotionSection:
    """A linear section with the states `x1[k+1] = x2[k]` and `x2[k+1] = P1 x1[k] + P2 x2[k] +
    sum_m w_m d_m[k]`, and with the output x1 (equation 10 of Brown and Xie 2024, in discrete time).

    `x2` is the output one sample ahead. The signals d drive the section (`drives` of the model).
    The first of them is the input, so that `w_1` is P3.
    """

    id: Annotated[Label, "identifier of the section, such as `2` or `rise 2`"]
    place: Annotated[int, "place along the input, from 1", "-"]
    direction: Annotated[
        str,
        "direction of the input in which it is active: `all`, `rise` or `fall`",
        one_of(ALL, RISE, FALL),
    ]
    p1: Annotated[Number, "P1"]
    p2: Annotated[Number, "P2"]
    weights: Annotated[
        Numbers, "(m) weights of the drives; the first is P3", "[target] over the unit of the drive"
    ]

    @property
    def p3(self) -> float:
        """Weight of the input, P3."""
        return float(self.weights[0])

    @property
    def poles(self) -> tuple[complex, complex]:
        """Roots of `z^2 - P2 z - P1`, the larger modulus first."""
        return poles(self.p1, self.p2)

    @property
    def radius(self) -> float:
        """Largest modulus of a pole. The section is stable if it is below 1."""
        return abs(self.poles[0])

    @property
    def gain(self) -> float:
        """Steady output per unit of the input, `P3/(1 - P1 - P2)`."""
        return self.p3 / (1.0 - self.p1 - self.p2)


@dataclass(frozen=True)
class Motion:
    """Linear models for sections of an input's range (Brown and Xie 2024, equations 14 to 17).

    With `hard` switching, every section is simulated with the whole input, and the output of the
    active section is used. With `carried` switching, a section that becomes active continues from
    the state of the section before it. With `bumpless` switching, sections continue in the same
    way, and neighbouring sections also have equal steady outputs at their boundary.

    The direction of the input matters if `directed` is True. With bumpless switching, the direction
    changes when the input has turned back by more than `dead_band`. With hard or carried switching,
    `dead_band` is 0, and the input is falling at each sample at which it is not larger than one
    sample before.
    """

    input: Annotated[QuantityName, "the input"]
    output: Annotated[QuantityName, "the predicted quantity"]
    step: Annotated[Step, "time between samples", "s"]
    switching: Annotated[
        str,
        "`hard`: sections run side by side; `carried`, `bumpless`: they share one state",
        one_of(HARD, CARRIED, BUMPLESS),
    ]
    boundaries: Annotated[
        tuple[Number, ...],
        "inputs at which sections meet, ascending",
        "that of the input",
        ASCENDING,
    ]
    directed: Annotated[bool, "1 if sections differ between a rising and a falling input"]
    dead_band: Annotated[
        Number, "how far the input turns back before its direction changes", "that of the input"
    ]
    drives: Annotated[tuple[TermName, ...], "(m) terms that drive every section, the input first"]
    sections: Annotated[tuple[MotionSection, ...], "in order along the input, `rise` before `fall`"]
    limits: Annotated[Span, "smallest and largest training input", "that of the input"]
    start: Annotated[
        str, "a run begins at `rest` under its first input, or at `zero`", one_of(REST, ZERO)
    ] = REST


@dataclass(frozen=True)
class SectionSearch:
    """Record of the search for the parameters of one section."""

    section: Annotated[Label, "identifier of the section"]
    samples: Annotated[Count, "number of training samples at which it is active"]
    rmse: Annotated[float, "error at these samples, before sections were joined", "[target]"]
    evaluations: Annotated[Count, "number of simulations"]
    history: Annotated[Array, "lowest error so far, from the start on", "[target]"]


@dataclass(frozen=True)
class MotionFit(Fit):
    """A model of motion, and how each of its sections was found."""

    model: Annotated[Motion, "the model"]
    solver: Annotated[Label, "name of the solver"]
    searches: Annotated[
        tuple[SectionSearch, ...], "the search of each section, in the order of sections"
    ]
    notes: Notes = ()


@dataclass(frozen=True)
class StateSpace(Body):
    """A model of motion: linear sections along an input, as in Brown and Xie 2024."""

    motion: Annotated[Motion, "the sections"]
    ranges: Annotated[tuple[CurveRange, ...], "training range of each curve"]
