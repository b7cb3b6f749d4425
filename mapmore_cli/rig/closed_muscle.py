"""A muscle whose valves are closed while something else moves it: the pressure follows the volume (H sections II.A and II.D).

Air is compressed while the muscle is drawn out, warms up, and gives the warmth to the wall.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval
from scipy.interpolate import CubicHermiteSpline
from scipy.signal import lfilter

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.declared import NonNegative, Positive, Settings
from mapmore_cli.rig.chamber import ATMOSPHERE
from mapmore_cli.rig.mckibben import McKibben, volume
from mapmore_cli.rig.muscle import SLACK_WIDTH, Hysteresis, softplus, zero_force_strain
from mapmore_cli.rig.sensors import low_pass
from mapmore_cli.rig.wet_muscle import Rubber


@dataclass(frozen=True)
class Air(Settings):
    """The air in a muscle and its hose."""

    heat_ratio: Annotated[float, Interval(ge=1, le=1.67)]  # gamma
    cooling_time: Positive  # in which the air takes on the wall's temperature, s
    dead_volume: NonNegative  # of hose and fittings, m3


@dataclass(frozen=True)
class ClosedMuscle:
    """A McKibben muscle with its air, its friction and its rubber."""

    muscle: McKibben
    hysteresis: Hysteresis
    rubber: Rubber
    air: Air

    def taut_strain(self, pressure: float, force: float) -> float:
        """Strain at which the muscle at `pressure` (Pa) pulls with `force` (N), friction and rubber relaxed."""
        return zero_force_strain(lambda strain: float(self.muscle.force(pressure, strain)) - force)

    def move(self, strain: Array, pressure: float, sample_time: float, cut_off: float) -> Columns:
        """Return True `pressure` (Pa) and `force` (N) along a path of strains `(n,)` from where the valves were closed at `pressure`.

        `F = softplus(F_static(P, e) - h(P, e) - s)`, with a Maxwell element s of rubber, behind the load cell's filter of `cut_off` (Hz).
        """
        gas = self.closed_pressure(strain, pressure, sample_time)
        driving = np.maximum(gas, 0.0)
        pull = self.muscle.force(driving, strain) - self.hysteresis.force(driving, strain) - self._rubber(strain, sample_time)
        return {"pressure": gas, "force": low_pass(softplus(pull, SLACK_WIDTH), cut_off, sample_time)}

    def closed_pressure(self, strain: Array, pressure: float, sample_time: float) -> Array:
        """Gauge pressure `(n,)`, Pa, of a fixed mass of air.

        Energy, `V p' + gamma p V' = (gamma - 1) k (T_w - T)`, is linear in `u = p V^gamma` (p absolute), with `tau = m c_v/k`:
        `u' = (p_0 V_0 V^(gamma-1) - u)/tau`. So u follows by a first-order filter: adiabatic while fast, isothermal while slow.
        """
        chamber = volume(self.muscle, strain) + self.air.dead_volume
        gamma, absolute = self.air.heat_ratio, pressure + ATMOSPHERE
        settled = absolute * chamber[0] * chamber ** (gamma - 1.0)
        memory = np.exp(-sample_time / self.air.cooling_time)
        mean = np.concatenate([settled[:1], 0.5 * (settled[1:] + settled[:-1])])
        u = settled[0] + lfilter([1.0 - memory], [1.0, -memory], mean - settled[0])
        return np.asarray(u / chamber**gamma - ATMOSPHERE)

    def _rubber(self, strain: Array, sample_time: float) -> Array:
        """`s' = K e' - s/tau`, N, `(n,)`: positive in contraction, where it takes from the pull."""
        memory = np.exp(-sample_time / self.rubber.relaxation_time)
        gain = self.rubber.stiffness * self.rubber.relaxation_time * (1.0 - memory) / sample_time
        return np.asarray(lfilter([gain], [1.0, -memory], np.diff(strain, prepend=strain[:1])))


@dataclass(frozen=True)
class RandomMotion:
    """What the motor does: smooth moves to random places at random speeds."""

    duration: float  # s
    sample_time: float  # of the simulation, s
    every: int  # samples that the logger keeps one of
    speeds: tuple[float, float]  # slowest and fastest peak of a move, m/s
    rest: tuple[float, float]  # pressure (Pa) and force (N) of the muscle at its rest length, from which its length is measured
    taut: float  # force at which the rope is taut when the valves are closed, N
    drawn_out: float  # strain at the far end of the stroke
    load_cell: float  # cut-off of its amplifier, Hz


SHORTEST_MOVE = 0.05
"""s."""


def random_velocity(muscle: ClosedMuscle, motion: RandomMotion, pressure: float, rng: np.random.Generator) -> Columns:
    """Truth of one record at an initial `pressure` (Pa), `(n,)` each.

    `time` (s), `pressure` (Pa), `length` (m, of elongation from the rest length), `velocity` (m/s, shortening positive), `force` (N).
    """
    length = muscle.muscle.length
    start = muscle.taut_strain(pressure, motion.taut)
    samples = round(motion.duration / motion.sample_time) + 1
    time = motion.sample_time * np.arange(samples, dtype=np.float64)
    strain, strain_rate = _path(start, motion, length, time, rng)
    moved = muscle.move(strain, pressure, motion.sample_time, motion.load_cell)
    rest = muscle.taut_strain(*motion.rest)
    columns = {"time": time, **moved, "length": (rest - strain) * length, "velocity": strain_rate * length}
    return {name: values[:: motion.every] for name, values in columns.items()}


def _path(start: float, motion: RandomMotion, length: float, time: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Strain and strain rate `(n,)`: cubic moves, at rest at both ends, between places drawn over the whole stroke."""
    times, places = [0.0], [start]
    while times[-1] <= time[-1]:
        place = float(rng.uniform(motion.drawn_out, start))
        speed = float(rng.uniform(*motion.speeds)) / length
        times.append(times[-1] + max(1.5 * abs(place - places[-1]) / speed, SHORTEST_MOVE))
        places.append(place)
    spline = CubicHermiteSpline(times, places, np.zeros(len(places)))
    return np.asarray(spline(time)), np.asarray(spline(time, 1))
