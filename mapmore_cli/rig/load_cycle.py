"""The quasi-static load cycle at constant pressure (M1 section IV.A, M2 section 4.3).

The muscle is locked at its starting length (zero strain) and pressurised; it slowly contracts until its force is zero and is slowly drawn
out again. Recorded is the loop at constant pressure; pressurising before it and venting after it are not. With further turns the actuator
reverses inside of that loop, which M1 leaves as future work.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.declared import NonNegative, Positive, Settings
from mapmore_cli.rig.muscle import SLACK_WIDTH, Hysteresis, StaticMuscle, softplus, zero_force_strain


@dataclass(frozen=True)
class LoadCycle:
    """How the actuator moves."""

    duration: float  # of the recording, s
    sample_time: float  # s
    dwell: float  # rest before, between and after the moves, s
    least_stroke: float  # strain that is reached even by a muscle without any force
    turns: tuple[float, ...] = (1.0,)  # where it reverses, as fractions of the stroke; it begins and ends at zero


@dataclass(frozen=True)
class Regulation(Settings):
    """Slow wander of a regulated pressure about its set value, which the muscle really feels."""

    ripple: NonNegative  # standard deviation, as a fraction of the set pressure
    correlation_time: Positive  # s


def load_cycle(
    muscle: StaticMuscle, hysteresis: Hysteresis, cycle: LoadCycle, regulation: Regulation, pressure: float, rng: np.random.Generator
) -> Columns:
    """True `time` (s), `pressure` (Pa), `strain` and `force` (N) of one cycle at the set `pressure` (Pa), each `(n,)`.

    `F = softplus(F_static(P, e) - h(P, e))`: hysteresis takes from the pull in contraction and adds to it in extension.
    """
    samples = round(cycle.duration / cycle.sample_time) + 1
    time = cycle.sample_time * np.arange(samples, dtype=np.float64)
    strain = strain_path(cycle, turning_strain(muscle, hysteresis, cycle, pressure), time)
    actual = regulated_pressure(regulation, cycle.sample_time, pressure, rng.standard_normal(samples))
    pull = muscle.force(actual, strain) - hysteresis.force(actual, strain)
    return {"time": time, "pressure": actual, "strain": strain, "force": softplus(pull, SLACK_WIDTH)}


def turning_strain(muscle: StaticMuscle, hysteresis: Hysteresis, cycle: LoadCycle, pressure: float) -> float:
    """Strain at which the contracting muscle's force has fallen to zero, or the least stroke where that is further.

    Friction stops the muscle a little short of its static free strain.
    """

    def contracting(strain: float) -> float:
        path = np.array([0.0, strain])
        return float((muscle.force(pressure, path) - hysteresis.force(pressure, path))[-1])

    return max(zero_force_strain(contracting), cycle.least_stroke)


def strain_path(cycle: LoadCycle, stroke: float, time: Array) -> Array:
    """Strain `(n,)`: rest at zero, moves from turn to turn and back to zero at one speed, rests between them, rest."""
    ends = stroke * np.array([0.0, *cycle.turns, 0.0])
    distances = np.abs(np.diff(ends))
    moves = (cycle.duration - len(ends) * cycle.dwell) * distances / distances.sum()
    spans = np.full(2 * len(ends) - 1, cycle.dwell)
    spans[1::2] = moves
    return np.interp(time, np.cumsum([0.0, *spans]), np.repeat(ends, 2))


def regulated_pressure(regulation: Regulation, sample_time: float, pressure: float, shocks: Array) -> Array:
    """Pressure `(n,)`, Pa: `P (1 + ripple x)`, x a stationary first-order Gauss-Markov process of unit variance.

    `x[k] = a x[k-1] + sqrt(1 - a^2) shocks[k]`, `a = exp(-dt/tau)`, x[0] = shocks[0]. A vented muscle has no ripple.
    """
    memory = np.exp(-sample_time / regulation.correlation_time)
    driven = np.sqrt(1.0 - memory**2) * shocks
    driven[0] = shocks[0]
    return np.asarray(pressure * (1.0 + regulation.ripple * lfilter([1.0], [1.0, -memory], driven)))
