"""Two muscles against each other on a joint (H section II.D): moved by a motor at closed valves, or driven through their valves.

Muscle 1, the flexor, shortens with the angle; muscle 2, the extensor, is drawn out.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.rig.chamber import ATMOSPHERE
from mapmore_cli.rig.closed_muscle import ClosedMuscle
from mapmore_cli.rig.mckibben import volume, volume_slope
from mapmore_cli.rig.muscle import SLACK_WIDTH, softplus, stop_rates
from mapmore_cli.rig.sensors import low_pass
from mapmore_cli.rig.waveform import Regulator
from mapmore_cli.rig.wet_muscle import integrate

SIGNS = (1.0, -1.0)
"""Of the change of strain with the angle: flexor, extensor."""

MUSCLE_STATES = 3
"""Wanted pressure, pressure (Pa), rubber (N); the stop operators follow them."""

TOLERANCE = 1e-5


@dataclass(frozen=True)
class Joint:
    """The joint and what moves on it."""

    muscles: tuple[ClosedMuscle, ClosedMuscle]
    radius: float  # of the pulleys, m
    inertia: float  # kg m2
    damping: float  # N m s
    load_cell: float  # cut-off of the amplifiers, Hz
    rest: tuple[float, float]  # pressure (Pa) and force (N) of a muscle at its rest length
    upright: tuple[float, float]  # pressure (Pa) and force (N) of both muscles at the angle zero

    @cached_property
    def _upright(self) -> tuple[float, float]:
        """Strains at the angle zero."""
        first, second = (muscle.taut_strain(*self.upright) for muscle in self.muscles)
        return first, second

    def strain(self, which: int, angle: Array) -> Array:
        """Strain of a muscle at angles in rad."""
        length = self.muscles[which].muscle.length
        return np.asarray(self._upright[which] + SIGNS[which] * self.radius * angle / length)

    def observed(self, which: int, angle: Array, rate: Array, moved: Columns) -> Columns:
        """Columns of one muscle, its number behind their names: those of `random_velocity`."""
        muscle = self.muscles[which]
        length = (muscle.taut_strain(*self.rest) - self.strain(which, angle)) * muscle.muscle.length
        columns = {**moved, "length": length, "velocity": SIGNS[which] * self.radius * rate}
        return {f"{name}_{which + 1}": values for name, values in columns.items()}


@dataclass(frozen=True)
class Swing:
    """A sine."""

    duration: float  # s
    sample_time: float  # s
    frequency: float  # Hz

    @property
    def clock(self) -> Array:
        """Sample times, s."""
        return self.sample_time * np.arange(round(self.duration / self.sample_time) + 1, dtype=np.float64)


def swung(joint: Joint, swing: Swing, amplitude: float, pressure: float) -> Columns:
    """Truth while a motor swings the joint by `amplitude` (rad), valves closed at `pressure` (Pa) in both muscles."""
    time, turn = swing.clock, 2.0 * np.pi * swing.frequency
    angle, rate = amplitude * np.sin(turn * time), amplitude * turn * np.cos(turn * time)
    columns = {"time": time}
    for which, muscle in enumerate(joint.muscles):
        moved = muscle.move(joint.strain(which, angle), pressure, swing.sample_time, joint.load_cell)
        columns |= joint.observed(which, angle, rate, moved)
    return columns


def driven(joint: Joint, swing: Swing, regulator: Regulator, pressures: tuple[float, float]) -> Columns:
    """Truth while regulators drive the pressures between two values (Pa) as sines in antiphase, and the joint moves as it will.

    `p_w' = (wanted - p_w)/lag`; `p' = gamma/V (q p0 - (p + p0) V' e')`; `J a'' = r (F_1 - F_2) - d a'`.
    """
    low, high = pressures
    middle, reach, turn = 0.5 * (low + high), 0.5 * (high - low), 2.0 * np.pi * swing.frequency
    sizes = [MUSCLE_STATES + len(muscle.hysteresis.yield_strains) for muscle in joint.muscles]

    def parts(states: Array) -> list[Array]:
        return np.split(states[2:], np.cumsum(sizes)[:-1])

    def rates(time: float, states: Array) -> Array:
        angle, rate = states[:2].tolist()
        pulls, changes = [], []
        for which, own in enumerate(parts(states)):
            asked = middle + SIGNS[which] * reach * np.sin(turn * time)
            pull, change = _muscle_rates(joint, which, own, regulator, asked, angle, rate)
            pulls.append(pull)
            changes.append(change)
        turning = joint.radius * (pulls[0] - pulls[1]) - joint.damping * rate
        return np.concatenate([[rate, turning / joint.inertia], *changes])

    start = np.concatenate([[0.0, 0.0], *([middle, middle, 0.0, *np.zeros(size - MUSCLE_STATES)] for size in sizes)])
    scales = np.concatenate([[0.1, 1.0], *([1e5, 1e5, 10.0, *np.ones(size - MUSCLE_STATES)] for size in sizes)])
    states = integrate(rates, start, swing.clock, scales, TOLERANCE)
    columns = {"time": swing.clock}
    for which, muscle in enumerate(joint.muscles):
        own = np.array([parts(row)[which] for row in states])
        force = np.array([_pull(muscle, row, float(e)) for row, e in zip(own, joint.strain(which, states[:, 0]), strict=True)])
        moved = {"pressure": own[:, 1], "force": low_pass(force, joint.load_cell, swing.sample_time)}
        columns |= joint.observed(which, states[:, 0], states[:, 1], moved)
    return columns


def _pull(muscle: ClosedMuscle, own: Array, strain: float) -> float:
    """Pull, N, from a muscle's states."""
    pressure, rubber, stops = max(float(own[1]), 0.0), float(own[2]), np.clip(own[MUSCLE_STATES:], -1.0, 1.0)
    friction = float(muscle.hysteresis.half_width(pressure) * (stops @ muscle.hysteresis.shares))
    return float(softplus(float(muscle.muscle.force(pressure, strain)) - friction - rubber, SLACK_WIDTH))


def _muscle_rates(
    joint: Joint, which: int, own: Array, regulator: Regulator, asked: float, angle: float, rate: float
) -> tuple[float, Array]:
    """Pull (N) and rates of a muscle's states."""
    muscle = joint.muscles[which]
    wanted, pressure, rubber = own[:MUSCLE_STATES].tolist()
    strain = float(joint.strain(which, np.asarray(angle)))
    strain_rate = SIGNS[which] * joint.radius * rate / muscle.muscle.length
    chamber = float(volume(muscle.muscle, np.asarray(strain))) + muscle.air.dead_volume
    swept = float(volume_slope(muscle.muscle, np.asarray(strain)))
    filling = regulator.inflow(wanted, pressure) * ATMOSPHERE - (pressure + ATMOSPHERE) * swept * strain_rate
    moving = [
        (asked - wanted) / regulator.lag,
        muscle.air.heat_ratio / chamber * filling,
        muscle.rubber.stiffness * strain_rate - rubber / muscle.rubber.relaxation_time,
    ]
    stops = np.clip(own[MUSCLE_STATES:], -1.0, 1.0)
    return _pull(muscle, own, strain), np.concatenate([moving, stop_rates(stops, muscle.hysteresis.yield_strains, strain_rate)])
