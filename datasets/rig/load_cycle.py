"""The quasi-static load cycle at constant pressure (M1 section IV.A, M2 section 4.3).

The muscle is locked at its starting length (zero strain) and pressurised; it slowly contracts until
its force is zero and is slowly drawn out again. Recorded is the loop at constant pressure;
pressurising before it and venting after it are not. With further turns the actuator reverses inside
of that loop, which M1 leaves as future work.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Interval, Len
from scipy.interpolate import CubicHermiteSpline
from scipy.signal import lfilter

from datasets.rig.marks import NonNegative, Positive
from datasets.rig.muscle import (
    GRAVITY,
    SLACK_WIDTH,
    Hysteresis,
    NonNegativeKpa,
    StaticMuscle,
    softplus,
    zero_force_strain,
)
from datasets.rig.sensors import Pressures, clock, distinct, integrate, pressure_label
from datasets.rig.water import DrivingPressure, WaterRig, WetMuscle, observe
from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.declared import Pair, Settings


@dataclass(frozen=True)
class Regulation(Settings):
    """Slow wander of a regulated pressure about its set value, which the muscle really feels."""

    ripple: NonNegative  # standard deviation, as a fraction of the set pressure
    correlation_time: Positive  # s


@dataclass(frozen=True, kw_only=True)
class LoadCycles(Settings):
    """One slow contraction and extension at each pressure (M1 section IV.A); with more `turns`,
    reversals inside of that loop.
    """

    type: Literal["load_cycles"]
    pressures: Pressures
    duration: Positive  # of each recording, s
    sample_time: Positive  # s
    dwell: NonNegative  # rest before, between and after the moves, s
    # of the stroke, which begins and ends at zero
    turns: Annotated[Sequence[Annotated[float, Interval(ge=0, le=1)]], Len(1)] = (1.0,)
    # strain reached even where the muscle has no force
    least_stroke: Annotated[float, Interval(gt=0, le=0.2)]
    regulation: Regulation

    def __post_init__(self) -> None:
        """Refuse moves without a time or a way, and too few samples."""
        rests = len(self.turns) + 2
        if rests * self.dwell >= self.duration:
            raise ValueError(f"{rests} rests of `dwell` leave no time to move: lengthen `duration`")
        if any(after == before for before, after in pairwise([0.0, *self.turns, 0.0])):
            raise ValueError(
                "the actuator must move from each of `turns` to the next, beginning and "
                "ending at zero"
            )
        if 100 * self.sample_time > self.duration:
            raise ValueError("fewer than 100 samples: shorten `sample_time` or lengthen `duration`")


def load_cycle(
    muscle: StaticMuscle,
    hysteresis: Hysteresis,
    cycle: LoadCycles,
    pressure: float,
    rng: np.random.Generator,
) -> Columns:
    """Return True `time` (s), `pressure` (Pa), `strain` and `force` (N) of one cycle at the set
    `pressure` (Pa), each `(n,)`.

    `F = softplus(F_static(P, e) - h(P, e))`: hysteresis takes from the pull in contraction and adds
    to it in extension.
    """
    time = clock(cycle.duration, cycle.sample_time)
    strain = strain_path(cycle, turning_strain(muscle, hysteresis, cycle, pressure), time)
    actual = regulated_pressure(
        cycle.regulation, cycle.sample_time, pressure, rng.standard_normal(len(time))
    )
    pull = muscle.force(actual, strain) - hysteresis.force(actual, strain)
    return {
        "time": time,
        "pressure": actual,
        "strain": strain,
        "force": softplus(pull, SLACK_WIDTH),
    }


def turning_strain(
    muscle: StaticMuscle, hysteresis: Hysteresis, cycle: LoadCycles, pressure: float
) -> float:
    """Strain at which the contracting muscle's force has fallen to zero, or the least stroke where
    that is further.

    Friction stops the muscle a little short of its static free strain.
    """

    def contracting(strain: float) -> float:
        path = np.array([0.0, strain])
        return float((muscle.force(pressure, path) - hysteresis.force(pressure, path))[-1])

    return max(zero_force_strain(contracting), cycle.least_stroke)


def strain_path(cycle: LoadCycles, stroke: float, time: Array) -> Array:
    """Strain `(n,)`: rest at zero, moves from turn to turn and back to zero at one speed, rests
    between them, rest.
    """
    ends = stroke * np.array([0.0, *cycle.turns, 0.0])
    distances = np.abs(np.diff(ends))
    moves = (cycle.duration - len(ends) * cycle.dwell) * distances / distances.sum()
    spans = np.full(2 * len(ends) - 1, cycle.dwell)
    spans[1::2] = moves
    return np.interp(time, np.cumsum([0.0, *spans]), np.repeat(ends, 2))


def regulated_pressure(
    regulation: Regulation, sample_time: float, pressure: float, shocks: Array
) -> Array:
    """Pressure `(n,)`, Pa: `P (1 + ripple x)`, x a stationary first-order Gauss-Markov process of
    unit variance.

    `x[k] = a x[k-1] + sqrt(1 - a^2) shocks[k]`, `a = exp(-dt/tau)`, x[0] = shocks[0]. A vented
    muscle has no ripple.
    """
    memory = np.exp(-sample_time / regulation.correlation_time)
    driven = np.sqrt(1.0 - memory**2) * shocks
    driven[0] = shocks[0]
    return pressure * (1.0 + regulation.ripple * lfilter([1.0], [1.0, -memory], driven))


@dataclass(frozen=True)
class ContractionTable(Settings):
    """Contraction at each pressure under each load, repeated and averaged (W section II): a table
    for each pressure.
    """

    type: Literal["contraction_table"]
    pressures: Pressures
    masses: Annotated[Sequence[NonNegative], Len(1)]  # kg, in the order in which they are hung on
    repeats: Annotated[int, Ge(1)]
    # standard deviation of the pressure from one repeat to the next, Pa
    regulator_error: NonNegativeKpa


def contraction_table(
    muscle: StaticMuscle,
    hysteresis: Hysteresis,
    table: ContractionTable,
    pressure: float,
    rng: np.random.Generator,
) -> Columns:
    """Return True `pressure` (Pa), `strain` and `force` (N) of one repeat, each `(n,)` for n
    masses.

    The regulator keeps what it happens to settle on; the force is the weight alone. Friction holds
    a muscle that has contracted a little short of its free strain, and one that is drawn out a
    little less far than without it.
    """
    actual = max(pressure + table.regulator_error * float(rng.standard_normal()), 0.0)
    weights = GRAVITY * np.asarray(table.masses, dtype=np.float64)
    return {
        "pressure": np.full(len(weights), actual),
        "strain": resting_strains(muscle, hysteresis, actual, weights),
        "force": weights,
    }


def resting_strains(
    muscle: StaticMuscle, hysteresis: Hysteresis, pressure: float, weights: Array
) -> Array:
    """Strains `(n,)` at which the pull balances each weight in turn, along the path that begins
    relaxed at zero strain.

    `F(P, e) - h = w`, with the stop operators carried along: from the strain before, each moves
    straight to the next.
    """
    strains, at, stops = [], 0.0, np.zeros(len(hysteresis.yield_strains))
    half_width = float(hysteresis.half_width(pressure))
    for weight in weights:

        def carried(strain: float, at: float = at, stops: Array = stops) -> Array:
            return np.clip(stops + (strain - at) / hysteresis.yield_strains, -1.0, 1.0)

        def unbalanced(strain: float, weight: float = float(weight)) -> float:
            return (
                float(muscle.force(pressure, strain))
                - half_width * float(carried(strain) @ hysteresis.shares)
                - weight
            )

        strain = zero_force_strain(unbalanced, STRETCHED)
        stops, at = carried(strain), strain
        strains.append(strain)
    return np.array(strains)


STRETCHED = -0.08
"""Strain from which on an equilibrium is looked for: a weight may draw the muscle out beyond its
length at rest.
"""


@dataclass(frozen=True)
class Perturbations(Settings):
    """The muscle is stretched and released at constant pressure, at several speeds, smoothly, with
    rests between (M2 section 6.2).
    """

    type: Literal["perturbation"]
    pressures: Annotated[Sequence[DrivingPressure], Len(1), distinct(pressure_label)]
    between: Pair  # stretched and contracted end, as fractions of the free strain
    # duration of each stretch, and of the release after it, s
    moves: Annotated[Sequence[Positive], Len(1)]
    dwell: Positive  # before, between and after the moves, s
    sample_time: Positive  # s
    rig: WaterRig

    def __post_init__(self) -> None:
        """Refuse ends in the wrong order, and too few samples."""
        if not 0.0 <= self.between[0] < self.between[1] <= 1.0:
            raise ValueError(
                "`between` needs two fractions of the free strain, the stretched end first: "
                "[0.2, 0.8]"
            )
        if 10 * self.sample_time > min(self.dwell, *self.moves):
            raise ValueError(
                "each move and `dwell` need ten samples: shorten `sample_time` or lengthen them"
            )

    def corners(self, free: float) -> tuple[Array, Array]:
        """Return times (s) and strains, `(4 m + 2,)` for m moves, at which rests begin and end;
        `free` is the free strain.
        """
        spans = [
            self.dwell,
            *(span for move in self.moves for span in (move, self.dwell, move, self.dwell)),
        ]
        ends = np.resize([free * end for end in reversed(self.between)], 2 * len(self.moves) + 1)
        return np.cumsum([0.0, *spans]), np.repeat(ends, 2)


def perturbation(muscle: WetMuscle, strokes: Perturbations, pressure: float) -> Columns:
    """Truth of one recording, columns `(n,)` as those of `observe`, at a constant `pressure` (Pa)
    of the reservoir.

    It begins with still water, and with friction and rubber relaxed.
    """
    free = zero_force_strain(lambda strain: muscle.muscle.respond(pressure, strain).tension)
    times, ends = strokes.corners(free)
    strain = CubicHermiteSpline(times, ends, np.zeros_like(ends))
    strain_rate = strain.derivative()

    def rates(time: float, states: Array) -> Array:
        return muscle.respond(states, pressure, float(strain(time)), float(strain_rate(time)))[1]

    at = clock(times[-1], strokes.sample_time)[:-1]
    wet = integrate(rates, muscle.at_rest(pressure), at, muscle.scales)
    return observe(muscle, at, np.asarray(strain(at)), wet)
