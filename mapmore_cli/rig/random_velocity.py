"""A motor draws a muscle out and lets it shorten at random velocities, at closed valves (H section II.A)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.rig.closed_muscle import ClosedMuscle


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
