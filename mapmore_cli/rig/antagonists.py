"""Two muscles against each other on a joint (H section II.D): moved by a motor at closed valves, or driven through their valves.

Muscle 1, the flexor, shortens with the angle; muscle 2, the extensor, is drawn out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.rig.air import ClosedMuscle, Regulator
from mapmore_cli.rig.random_velocity import TOLERANCE
from mapmore_cli.rig.sensors import clock, integrate, low_pass

SIGNS = (1.0, -1.0)
"""Of the change of strain with the angle: flexor, extensor."""

Asked = Callable[[float], float]
"""A wanted pressure over time, Pa."""


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
        return clock(self.duration, self.sample_time)


def swung(joint: Joint, swing: Swing, amplitude: float, pressure: float) -> Columns:
    """Truth while a motor swings the joint by `amplitude` (rad), valves closed at `pressure` (Pa) in both muscles."""
    time, turn = swing.clock, 2.0 * np.pi * swing.frequency
    angle, rate = amplitude * np.sin(turn * time), amplitude * turn * np.cos(turn * time)
    columns = {"time": time}
    for which, muscle in enumerate(joint.muscles):
        moved = muscle.move(joint.strain(which, angle), pressure, swing.sample_time, joint.load_cell)
        columns |= joint.observed(which, angle, rate, moved)
    return columns


def driven(joint: Joint, swing: Swing, regulator: Regulator, asked: tuple[Asked, Asked]) -> Columns:
    """Truth while regulators are asked for two pressures (Pa) over time, and the joint moves as it will; their `input` in V.

    `J a'' = r (F_1 - F_2) - d a'`; the muscles as `ClosedMuscle.rates` has them.
    """
    starts = [muscle.at_rest(float(wanted(0.0))) for muscle, wanted in zip(joint.muscles, asked, strict=True)]
    cut = 2 + len(starts[0])

    def parts(states: Array) -> tuple[Array, Array]:
        return states[2:cut], states[cut:]

    def rates(time: float, states: Array) -> Array:
        angle, rate = states[:2].tolist()
        pulls, changes = [], []
        for which, (muscle, own) in enumerate(zip(joint.muscles, parts(states), strict=True)):
            strain = float(joint.strain(which, np.asarray(angle)))
            strain_rate = SIGNS[which] * joint.radius * rate / muscle.muscle.length
            pulls.append(muscle.pull(own, strain))
            changes.append(muscle.rates(own, strain, strain_rate, regulator, float(asked[which](time))))
        turning = joint.radius * (pulls[0] - pulls[1]) - joint.damping * rate
        return np.concatenate([[rate, turning / joint.inertia], *changes])

    scales = np.concatenate([[0.1, 1.0], *(muscle.scales for muscle in joint.muscles)])
    states = integrate(rates, np.concatenate([[0.0, 0.0], *starts]), swing.clock, scales, TOLERANCE)
    columns = {"time": swing.clock}
    for which, muscle in enumerate(joint.muscles):
        own = np.array([parts(row)[which] for row in states])
        force = np.array([muscle.pull(row, float(e)) for row, e in zip(own, joint.strain(which, states[:, 0]), strict=True)])
        moved = {"input": regulator.command(np.array([asked[which](time) for time in swing.clock.tolist()])), "pressure": own[:, 1]}
        moved["force"] = low_pass(force, joint.load_cell, swing.sample_time)
        columns |= joint.observed(which, states[:, 0], states[:, 1], moved)
    return columns


def sines(swing: Swing, low: float, high: float) -> tuple[Asked, Asked]:
    """Return two pressures over time, sines between two values (Pa) in antiphase."""
    middle, reach, turn = 0.5 * (low + high), 0.5 * (high - low), 2.0 * np.pi * swing.frequency
    return lambda time: middle + reach * np.sin(turn * time), lambda time: middle - reach * np.sin(turn * time)
