"""A weight on a muscle in a PI loop, for the page on control: a pressure is fed forward, and the
error is fed back.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from datasets.rig.muscle import GRAVITY, Hysteresis, StaticMuscle
from mapmore_cli.domain.arrays import Array, Columns


@dataclass(frozen=True)
class Lift:
    """What hangs on the muscle, and what drives it."""

    mass: float  # kg
    length: float  # L0 of the muscle, m
    damping: float  # c, N s/m
    lag: float  # tau of the regulator, s
    highest: float  # pressure that it gives at most, Pa
    step: float  # of the integration, s


@dataclass(frozen=True)
class Loop:
    """The controller."""

    period: float  # between samples, s; a multiple of the step
    kp: float  # Pa per strain
    ki: float  # Pa per strain and s


def wanted_force(lift: Lift, strain: Array, period: float) -> Array:
    """Return what the muscle has to pull along a course of strain, N, `(n,)`: `m (g + L0 e'')`."""
    acceleration = np.gradient(np.gradient(strain, period), period)
    return np.asarray(lift.mass * (GRAVITY + lift.length * acceleration))


def closed_loop(
    muscle: StaticMuscle,
    hysteresis: Hysteresis,
    lift: Lift,
    loop: Loop,
    reference: Array,
    feed: Array,
) -> Columns:
    """`time`, `strain`, `pressure` (in the muscle) and `command`, `(n,)` each, at the samples of
    the loop.

    `reference` is the strain to follow, `(n,)`, and `feed` the pressure that is fed forward, Pa,
    `(n,)`. It begins at rest at the first of both.
    """
    substeps = round(loop.period / lift.step)
    strain, speed, pressure, total = float(reference[0]), 0.0, float(feed[0]), 0.0
    stops = np.zeros(len(hysteresis.yield_strains))
    strains, pressures, commands = (np.empty(len(reference)) for _ in range(3))
    for k, (aim, fed) in enumerate(zip(reference.tolist(), feed.tolist(), strict=True)):
        error = aim - strain
        asked = fed + loop.kp * error + loop.ki * total
        command = min(max(asked, 0.0), lift.highest)
        total += loop.period * error * (command == asked)
        strains[k], pressures[k], commands[k] = strain, pressure, command
        for _ in range(substeps):
            pressure += lift.step / lift.lag * (command - pressure)
            friction = float(hysteresis.half_width(pressure)) * float(stops @ hysteresis.shares)
            pull = float(muscle.force(pressure, strain)) - friction
            speed += (
                lift.step
                * (pull / lift.mass - GRAVITY - lift.damping * lift.length * speed / lift.mass)
                / lift.length
            )
            moved = lift.step * speed
            strain += moved
            stops = np.clip(stops + moved / hysteresis.yield_strains, -1.0, 1.0)
    time = loop.period * np.arange(len(reference), dtype=np.float64)
    return {"time": time, "strain": strains, "pressure": pressures, "command": commands}
