"""A motor moves a muscle at random velocities (H section II.A); H's outlook has a tendon in series,
and controlled valves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Interval
from scipy.interpolate import CubicHermiteSpline

from datasets.rig.air import ATMOSPHERE, TOLERANCE, Air, ClosedMuscle, Regulator
from datasets.rig.marks import Positive
from datasets.rig.muscle import PositiveKpa, Pressure, Rubber
from datasets.rig.sensors import Pressures, clock, integrate, low_pass
from datasets.rig.static_muscles import volume
from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.declared import ListToo, Settings


@dataclass(frozen=True)
class Tendon(Settings):
    """A spring in series with the muscle: it pulls with `k x + c x'` at a stretch of x."""

    stiffness: Positive  # k, N/m
    damping: Positive  # c, N s/m


@dataclass(frozen=True)
class RestLength(Settings):
    """The muscle's state at the length that its elongation is measured from."""

    pressure: PositiveKpa  # Pa
    force: Positive  # N


@dataclass(frozen=True)
class PressureCourse(Settings):
    """Smooth moves of a wanted pressure to random places, in random times."""

    between: Annotated[tuple[Pressure, Pressure], ListToo()]  # Pa
    pace: Annotated[tuple[Positive, Positive], ListToo()]  # shortest and longest move, s

    def drawn(self, start: float, end: float, rng: np.random.Generator) -> CubicHermiteSpline:
        """Return the pressure over time from `start` (Pa) to the time `end` (s): cubic moves, at
        rest at both ends.
        """
        times, places = [0.0], [start]
        while times[-1] <= end:
            places.append(float(rng.uniform(*self.between)))
            times.append(times[-1] + float(rng.uniform(*self.pace)))
        return CubicHermiteSpline(times, places, np.zeros(len(places)))


@dataclass(frozen=True)
class Valves(Settings):
    """A regulator drives the pressure along random moves, which begin at the initial pressure."""

    regulator: Regulator
    course: PressureCourse


@dataclass(frozen=True)
class RandomVelocity(Settings):
    """A motor moves the muscle at random velocities for a while, valves closed at an initial
    pressure (H section II.A), or controlled.
    """

    type: Literal["random_velocity"]
    pressures: Pressures  # initial ones
    duration: Positive  # s
    sample_time: Positive  # of the simulation, s
    every: Annotated[int, Ge(1)]  # samples that the file has one of
    # slowest and fastest peak of a move, m/s
    speeds: Annotated[tuple[Positive, Positive], ListToo()]
    rest: RestLength
    taut: Positive  # force with which the rope is drawn taut before the valves close, N
    drawn_out: Annotated[float, Interval(ge=-0.01, le=0.3)]  # strain at the far end of the stroke
    air: Air
    rubber: Rubber
    load_cell: Positive  # cut-off of its amplifier, Hz
    tendon: Tendon | None = None  # in series; lengths are then those of both
    valves: Valves | None = None  # controlled; else closed

    def __post_init__(self) -> None:
        """Refuse speeds in the wrong order, and too few samples."""
        if self.speeds[0] > self.speeds[1]:
            raise ValueError("`speeds` needs the slower one first: [0.02, 0.2]")
        if 100 * self.sample_time * self.every > self.duration:
            raise ValueError(
                "fewer than 100 samples: shorten `sample_time`, keep more of them, or "
                "lengthen `duration`"
            )


SHORTEST_MOVE = 0.05
"""s."""


def random_velocity(
    muscle: ClosedMuscle, motion: RandomVelocity, pressure: float, rng: np.random.Generator
) -> Columns:
    """Truth of one record at an initial `pressure` (Pa), `(n,)` each.

    `time` (s), `pressure` (Pa), `length` (m, of elongation from the rest length), `velocity` (m/s,
    shortening positive), `force` (N); with a regulator its `input` (V). Length and velocity are
    those of muscle and tendon together.
    """
    length = muscle.muscle.length
    soft = 0.0 if motion.tendon is None else 1.0 / (motion.tendon.stiffness * length)
    start = muscle.taut_strain(pressure, motion.taut)
    time = clock(motion.duration, motion.sample_time)
    path = _random_path(start - soft * motion.taut, motion, length, time[-1], rng)
    if motion.tendon is None and motion.valves is None:
        moved = muscle.move(np.asarray(path(time)), pressure, motion.sample_time, motion.load_cell)
    else:
        moved = _moved(muscle, motion, path, start, pressure, time, rng)
    rest = muscle.taut_strain(motion.rest.pressure, motion.rest.force) - soft * motion.rest.force
    columns = {
        "time": time,
        **moved,
        "length": (rest - path(time)) * length,
        "velocity": path(time, 1) * length,
    }
    return {name: values[:: motion.every] for name, values in columns.items()}


def _moved(
    muscle: ClosedMuscle,
    motion: RandomVelocity,
    path: CubicHermiteSpline,
    start: float,
    pressure: float,
    time: Array,
    rng: np.random.Generator,
) -> Columns:
    """`pressure` (Pa), `force` (N) and a regulator's `input` (V), along a `path` of the strain of
    muscle and tendon together.

    `F = k L0 (e_muscle - e) + c L0 (e_muscle' - e')`; the first state is the muscle's strain.
    """
    length, tendon, valves = muscle.muscle.length, motion.tendon, motion.valves
    shut_in = (pressure + ATMOSPHERE) * (
        float(volume(muscle.muscle, np.asarray(start))) + muscle.air.dead_volume
    )
    regulator = None if valves is None else valves.regulator
    asked = None if valves is None else valves.course.drawn(pressure, time[-1], rng.spawn(1)[0])

    def strain_at(at: float, states: Array) -> float:
        return float(path(at)) if tendon is None else float(states[0])

    def rates(at: float, states: Array) -> Array:
        strain, rate = strain_at(at, states), float(path(at, 1))
        if tendon is not None:
            pulled = tendon.stiffness * length * (strain - float(path(at)))
            rate += (muscle.pull(states[1:], strain) - pulled) / (tendon.damping * length)
        told = shut_in if asked is None else float(asked(at))
        return np.array([rate, *muscle.rates(states[1:], strain, rate, regulator, told)])

    begin, scales = np.array([start, *muscle.at_rest(pressure)]), np.array([0.1, *muscle.scales])
    states = integrate(rates, begin, time, scales, TOLERANCE)
    places = zip(time.tolist(), states, strict=True)
    force = np.array([muscle.pull(row[1:], strain_at(at, row)) for at, row in places])
    moved = {
        "pressure": states[:, 2],
        "force": low_pass(force, motion.load_cell, motion.sample_time),
    }
    if asked is None or regulator is None:
        return moved
    return {"input": regulator.command(asked(time)), **moved}


def _random_path(
    start: float, motion: RandomVelocity, length: float, end: float, rng: np.random.Generator
) -> CubicHermiteSpline:
    """Strain over time: cubic moves, at rest at both ends, between places drawn over the whole
    stroke.
    """
    times, places = [0.0], [start]
    while times[-1] <= end:
        place = float(rng.uniform(motion.drawn_out, start))
        speed = float(rng.uniform(*motion.speeds)) / length
        times.append(times[-1] + max(1.5 * abs(place - places[-1]) / speed, SHORTEST_MOVE))
        places.append(place)
    return CubicHermiteSpline(times, places, np.zeros(len(places)))
