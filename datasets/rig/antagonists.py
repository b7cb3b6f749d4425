"""Two muscles against each other on a joint (H section II.D): moved by a motor at closed valves, or
driven through their valves.

Muscle 1, the flexor, shortens with the angle; muscle 2, the extensor, is drawn out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Len

from datasets.rig.air import TOLERANCE, Air, ClosedMuscle, Regulator
from datasets.rig.marks import NonNegative, Positive
from datasets.rig.muscle import Hysteresis, PositiveKpa, Pressure, Rubber
from datasets.rig.random_velocity import PressureCourse, RestLength
from datasets.rig.sensors import clock, integrate, low_pass
from datasets.rig.static_muscles import McKibben
from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.declared import ListToo, Settings

SIGNS = (1.0, -1.0)
"""Of the change of strain with the angle: flexor, extensor."""

Asked = Callable[[float], Any]
"""A wanted pressure over time, Pa."""


@dataclass(frozen=True, kw_only=True)
class Antagonists(Settings):
    """Two muscles on a joint (H section II.D): `closed` swings it by a motor at closed valves,
    `driven` drives the pressures in antiphase.

    `random` drives each pressure along a `course` of its own. The spec's `muscle` is the flexor.
    """

    type: Literal["antagonists"]
    extensor: McKibben
    recordings: Annotated[Sequence[Literal["closed", "driven", "random"]], Len(1)]
    duration: Positive  # s
    sample_time: Positive  # s
    frequency: Positive  # Hz
    amplitude: Positive  # of the closed swing, rad
    # at which the valves are closed, and at which both muscles are at angle zero, Pa
    pressure: PositiveKpa
    pressures: Annotated[tuple[Pressure, Pressure], ListToo()]  # between which they are driven, Pa
    taut: Positive  # force of both muscles at angle zero, N
    rest: RestLength
    radius: Positive  # of the pulleys, m
    inertia: Positive  # kg m2
    damping: NonNegative  # N m s
    air: Air
    rubber: Rubber
    regulator: Regulator
    course: PressureCourse | None = None  # of `random`
    load_cell: Positive  # cut-off of the amplifiers, Hz

    def __post_init__(self) -> None:
        """Refuse random pressures without their bounds."""
        if "random" in self.recordings and self.course is None:
            raise ValueError("`random` needs a `course`, as {between: [200, 500], pace: [0.2, 1]}")

    @property
    def clock(self) -> Array:
        """Sample times, s."""
        return clock(self.duration, self.sample_time)

    def asked(self, name: str, rng: np.random.Generator) -> list[Asked]:
        """Return two pressures over time: random, or sines in antiphase."""
        if name == "random" and self.course is not None:
            return [self.course.drawn(self.pressure, self.duration, own) for own in rng.spawn(2)]
        low, high = self.pressures
        middle, reach, turn = 0.5 * (low + high), 0.5 * (high - low), 2.0 * np.pi * self.frequency

        def sine(sign: float) -> Asked:
            return lambda time: middle + sign * reach * np.sin(turn * time)

        return [sine(sign) for sign in SIGNS]


@dataclass(frozen=True)
class Joint:
    """The joint and what moves on it."""

    flexor: McKibben
    hysteresis: Hysteresis
    setup: Antagonists

    @cached_property
    def muscles(self) -> list[ClosedMuscle]:
        """Flexor and extensor, full of air."""
        air, rubber = self.setup.air, self.setup.rubber
        return [
            ClosedMuscle(muscle, self.hysteresis, rubber, air)
            for muscle in (self.flexor, self.setup.extensor)
        ]

    @cached_property
    def _upright(self) -> list[float]:
        """Strains at the angle zero."""
        return [one.taut_strain(self.setup.pressure, self.setup.taut) for one in self.muscles]

    @cached_property
    def _at_rest(self) -> list[float]:
        """Strains at the rest lengths."""
        rest = self.setup.rest
        return [one.taut_strain(rest.pressure, rest.force) for one in self.muscles]

    def strain(self, which: int, angle: Array) -> Array:
        """Strain of a muscle at angles in rad."""
        length = self.muscles[which].muscle.length
        return np.asarray(self._upright[which] + SIGNS[which] * self.setup.radius * angle / length)

    def elongation(self, which: int, angle: Array) -> Array:
        """Length of a muscle beyond its rest length, m, at angles in rad."""
        return np.asarray(
            (self._at_rest[which] - self.strain(which, angle)) * self.muscles[which].muscle.length
        )

    def observed(self, which: int, angle: Array, rate: Array, moved: Columns) -> Columns:
        """Columns of one muscle, its number behind their names: those of `random_velocity`."""
        columns = {
            **moved,
            "length": self.elongation(which, angle),
            "velocity": SIGNS[which] * self.setup.radius * rate,
        }
        return {f"{name}_{which + 1}": values for name, values in columns.items()}


def swung(joint: Joint) -> Columns:
    """Truth while a motor swings the joint, valves closed in both muscles."""
    setup = joint.setup
    time, turn = setup.clock, 2.0 * np.pi * setup.frequency
    angle, rate = (
        setup.amplitude * np.sin(turn * time),
        setup.amplitude * turn * np.cos(turn * time),
    )
    columns = {"time": time}
    for which, muscle in enumerate(joint.muscles):
        moved = muscle.move(
            joint.strain(which, angle), setup.pressure, setup.sample_time, setup.load_cell
        )
        columns |= joint.observed(which, angle, rate, moved)
    return columns


def driven(joint: Joint, asked: Sequence[Asked]) -> Columns:
    """Truth while regulators are asked for two pressures (Pa) over time, and the joint moves as it
    will; their `input` in V.

    `J a'' = r (F_1 - F_2) - d a'`; the muscles as `ClosedMuscle.rates` has them.
    """
    setup, times = joint.setup, joint.setup.clock
    pairs = list(zip(joint.muscles, asked, strict=True))
    starts = [muscle.at_rest(float(wanted(0.0))) for muscle, wanted in pairs]

    def rates(time: float, states: Array) -> Array:
        angle, rate = states[:2].tolist()
        pulls, changes = [], []
        for which, (muscle, wanted) in enumerate(pairs):
            own = states[2:].reshape(2, -1)[which]
            strain = float(joint.strain(which, np.asarray(angle)))
            strain_rate = SIGNS[which] * setup.radius * rate / muscle.muscle.length
            pulls.append(muscle.pull(own, strain))
            changes.append(
                muscle.rates(own, strain, strain_rate, setup.regulator, float(wanted(time)))
            )
        turning = setup.radius * (pulls[0] - pulls[1]) - setup.damping * rate
        return np.concatenate([[rate, turning / setup.inertia], *changes])

    scales = np.concatenate([[0.1, 1.0], *(muscle.scales for muscle in joint.muscles)])
    states = integrate(rates, np.concatenate([[0.0, 0.0], *starts]), times, scales, TOLERANCE)
    columns = {"time": times}
    for which, (muscle, wanted) in enumerate(pairs):
        own, strains = np.split(states[:, 2:], 2, axis=1)[which], joint.strain(which, states[:, 0])
        force = np.array(
            [muscle.pull(row, at) for row, at in zip(own, strains.tolist(), strict=True)]
        )
        moved = {
            "input": setup.regulator.command(np.array([wanted(time) for time in times.tolist()])),
            "pressure": own[:, 1],
            "force": low_pass(force, setup.load_cell, setup.sample_time),
        }
        columns |= joint.observed(which, states[:, 0], states[:, 1], moved)
    return columns
