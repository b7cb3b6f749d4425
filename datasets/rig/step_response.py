"""The step response (M2 section 4.1): a weight rests on a stop, below a slightly tensioned muscle
that is suddenly put under pressure.

The muscle lifts the weight, holds it until it has come to rest, is exhausted, and the weight draws
it out again until it falls on the stop.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from annotated_types import Len

from datasets.rig.air import Reservoir
from datasets.rig.marks import NonNegative, Positive
from datasets.rig.muscle import GRAVITY, zero_force_strain
from datasets.rig.sensors import TOLERANCE, distinct, integrate_phases, pressure_label
from datasets.rig.water import DrivingPressure, WaterRig, WetMuscle, observe
from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.declared import Settings

ABOVE_WATER = (1e5, 0.1, 1.0)
"""Size of the states that stand before the wet muscle's: reservoir pressure (Pa), strain, strain
rate (1/s).
"""


@dataclass(frozen=True)
class Bumper(Settings):
    """Stop below the weight; Hunt and Crossley's contact."""

    stiffness: Positive  # k, N/m
    damping: NonNegative  # c, s/m
    pretension: Positive  # of the muscle while the weight rests on the stop, N

    def push(self, depth: float, speed: float) -> float:
        """Force on the weight, N: `k d (1 + c d')` at depth d > 0 (m) and speed d' (m/s) into the
        stop; it never holds the weight back.
        """
        return (
            max(self.stiffness * depth * (1.0 + self.damping * speed), 0.0) if depth > 0.0 else 0.0
        )


@dataclass(frozen=True)
class PressureStep(Settings):
    """One recording."""

    pressure: DrivingPressure  # of the supply, Pa
    weight: Positive  # that hangs on the muscle, N


@dataclass(frozen=True)
class StepResponses(Settings):
    """A weight is suddenly lifted and dropped again, once for each step (M2 section 4.1, table
    3).
    """

    type: Literal["step_responses"]
    steps: Annotated[
        Sequence[PressureStep], Len(1), distinct(lambda step: pressure_label(step.pressure))
    ]
    rest: Positive  # before the supply opens, s
    hold: Positive  # until the exhaust opens, s
    fall: Positive  # until the recording ends, s
    sample_time: Positive  # s
    reservoir: Reservoir
    bumper: Bumper
    rig: WaterRig

    def __post_init__(self) -> None:
        """Refuse weights that do not rest on their stop, and too few samples."""
        if any(step.weight <= self.bumper.pretension for step in self.steps):
            raise ValueError(
                "each weight must exceed the `pretension`, or it would hang free of its stop "
                "from the start"
            )
        if 10 * self.sample_time > min(self.rest, self.hold, self.fall):
            raise ValueError(
                "`rest`, `hold` and `fall` need ten samples each: shorten `sample_time` or "
                "lengthen them"
            )

    def clocks(self) -> list[Array]:
        """Sample times, s, of the three phases; each ends with the sample that begins the next."""
        switches = np.cumsum([0.0, self.rest, self.hold, self.fall])
        counts = np.round(switches / self.sample_time).astype(int)
        return [self.sample_time * np.arange(first, last + 1) for first, last in pairwise(counts)]


def step_response(setup: StepResponses, muscle: WetMuscle, step: PressureStep) -> Columns:
    """Truth of one recording on the rig of M2's figure 8, columns `(n,)` as those of `observe`; its
    states are those of `ABOVE_WATER`, then the wet muscle's.

    It begins without pressure: the muscle pulls with its pretension, the stop carries the rest of
    the weight.
    """
    bumper, reservoir, length = setup.bumper, setup.reservoir, muscle.muscle.length
    still = muscle.at_rest(0.0)
    begin = zero_force_strain(
        lambda strain: muscle.respond(still, 0.0, strain, 0.0)[0] - bumper.pretension
    )
    touch = begin + (step.weight - bumper.pretension) / (bumper.stiffness * length)

    def rates(_time: float, states: Array, supply: float | None) -> Array:
        """Return the rates with the valve on a `supply` pressure (Pa) or, None, on exhaust."""
        (pressure, strain, strain_rate), wet = states[:3].tolist(), states[3:]
        pull, wet_rates = muscle.respond(wet, pressure, strain, strain_rate)
        inflow = (
            reservoir.exhausted(pressure)
            if supply is None
            else reservoir.supplied(pressure, supply)
        )
        push = bumper.push(length * (touch - strain), -length * strain_rate)
        acceleration = (pull + push - step.weight) * GRAVITY / (step.weight * length)
        filling = reservoir.rate(pressure, float(wet[0]), inflow)
        return np.array([filling, strain_rate, acceleration, *wet_rates])

    clocks = setup.clocks()
    motions = [partial(rates, supply=supply) for supply in (None, step.pressure, None)]
    along = integrate_phases(
        zip(motions, clocks, strict=True),
        np.array([0.0, begin, 0.0, *still]),
        np.array([*ABOVE_WATER, *muscle.scales]),
        TOLERANCE,
    )
    time = np.concatenate([clocks[0][:1], *(clock[1:] for clock in clocks)])
    return observe(muscle, time, along[:, 1], along[:, 3:])
