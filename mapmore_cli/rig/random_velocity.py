"""A motor moves a muscle at random velocities (H section II.A); H's outlook has a tendon in series, and controlled valves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.declared import Positive, Settings
from mapmore_cli.rig.air import ATMOSPHERE, ClosedMuscle, Regulator
from mapmore_cli.rig.sensors import clock, integrate, low_pass
from mapmore_cli.rig.static_muscles import volume

TOLERANCE = 1e-5
"""Of each step of the integration, relative to a state and to its scale."""


@dataclass(frozen=True)
class Tendon(Settings):
    """A spring in series with the muscle: it pulls with `k x + c x'` at a stretch of x."""

    stiffness: Positive  # k, N/m
    damping: Positive  # c, N s/m


@dataclass(frozen=True)
class Course:
    """Smooth moves of a wanted pressure to random places, in random times."""

    between: tuple[float, float]  # Pa
    pace: tuple[float, float]  # shortest and longest move, s

    def drawn(self, start: float, end: float, rng: np.random.Generator) -> CubicHermiteSpline:
        """Return the pressure over time from `start` (Pa) to the time `end` (s): cubic moves, at rest at both ends."""
        times, places = [0.0], [start]
        while times[-1] <= end:
            places.append(float(rng.uniform(*self.between)))
            times.append(times[-1] + float(rng.uniform(*self.pace)))
        return CubicHermiteSpline(times, places, np.zeros(len(places)))


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
    tendon: Tendon | None = None  # between muscle and motor
    regulator: Regulator | None = None  # that drives the pressure, where the valves are not closed
    course: Course | None = None  # that it is asked for


SHORTEST_MOVE = 0.05
"""s."""


def random_velocity(muscle: ClosedMuscle, motion: RandomMotion, pressure: float, rng: np.random.Generator) -> Columns:
    """Truth of one record at an initial `pressure` (Pa), `(n,)` each.

    `time` (s), `pressure` (Pa), `length` (m, of elongation from the rest length), `velocity` (m/s, shortening positive), `force` (N);
    with a regulator its `input` (V). Length and velocity are those of muscle and tendon together.
    """
    length = muscle.muscle.length
    soft = 0.0 if motion.tendon is None else 1.0 / (motion.tendon.stiffness * length)
    start = muscle.taut_strain(pressure, motion.taut)
    time = clock(motion.duration, motion.sample_time)
    path = _path(start - soft * motion.taut, motion, length, time[-1], rng)
    if motion.tendon is None and motion.regulator is None:
        moved = muscle.move(np.asarray(path(time)), pressure, motion.sample_time, motion.load_cell)
    else:
        asked = None if motion.course is None else motion.course.drawn(pressure, time[-1], rng.spawn(1)[0])
        moved = _moved(muscle, motion, path, start, pressure, time, asked)
    rest = muscle.taut_strain(*motion.rest) - soft * motion.rest[1]
    columns = {"time": time, **moved, "length": (rest - path(time)) * length, "velocity": path(time, 1) * length}
    return {name: values[:: motion.every] for name, values in columns.items()}


def _moved(
    muscle: ClosedMuscle,
    motion: RandomMotion,
    path: CubicHermiteSpline,
    start: float,
    pressure: float,
    time: Array,
    asked: CubicHermiteSpline | None,
) -> Columns:
    """`pressure` (Pa), `force` (N) and a regulator's `input` (V), along a `path` of the strain of muscle and tendon together.

    `F = k L0 (e_muscle - e) + c L0 (e_muscle' - e')`; the first state is the muscle's strain.
    """
    length, tendon, regulator = muscle.muscle.length, motion.tendon, motion.regulator
    shut_in = (pressure + ATMOSPHERE) * (float(volume(muscle.muscle, np.asarray(start))) + muscle.air.dead_volume)

    def strain_at(at: float, states: Array) -> float:
        return float(path(at)) if tendon is None else float(states[0])

    def rates(at: float, states: Array) -> Array:
        strain, rate = strain_at(at, states), float(path(at, 1))
        if tendon is not None:
            pulled = tendon.stiffness * length * (strain - float(path(at)))
            rate += (muscle.pull(states[1:], strain) - pulled) / (tendon.damping * length)
        return np.array([rate, *muscle.rates(states[1:], strain, rate, regulator, shut_in if asked is None else float(asked(at)))])

    states = integrate(rates, np.array([start, *muscle.at_rest(pressure)]), time, np.array([0.1, *muscle.scales]), TOLERANCE)
    force = np.array([muscle.pull(row[1:], strain_at(at, row)) for at, row in zip(time.tolist(), states, strict=True)])
    moved = {"pressure": states[:, 2], "force": low_pass(force, motion.load_cell, motion.sample_time)}
    return moved if asked is None or regulator is None else {"input": regulator.command(asked(time)), **moved}


def _path(start: float, motion: RandomMotion, length: float, end: float, rng: np.random.Generator) -> CubicHermiteSpline:
    """Strain over time: cubic moves, at rest at both ends, between places drawn over the whole stroke."""
    times, places = [0.0], [start]
    while times[-1] <= end:
        place = float(rng.uniform(motion.drawn_out, start))
        speed = float(rng.uniform(*motion.speeds)) / length
        times.append(times[-1] + max(1.5 * abs(place - places[-1]) / speed, SHORTEST_MOVE))
        places.append(place)
    return CubicHermiteSpline(times, places, np.zeros(len(places)))
