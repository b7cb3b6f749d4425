"""A muscle that something else moves (H sections II.A and II.D): its valves are closed, or a regulator drives its pressure.

Behind closed valves the pressure follows the volume: air is compressed while the muscle is drawn out, warms up, and gives the warmth to the
wall. H's outlook has a tendon in series, and controlled valves.
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
from mapmore_cli.rig.mckibben import McKibben, volume, volume_slope
from mapmore_cli.rig.muscle import SLACK_WIDTH, Hysteresis, softplus, stop_rates, zero_force_strain
from mapmore_cli.rig.sensors import low_pass
from mapmore_cli.rig.waveform import Regulator
from mapmore_cli.rig.wet_muscle import Rubber, integrate

STATES = 3
"""Wanted pressure, pressure (Pa), rubber (N); the stop operators follow them."""

TOLERANCE = 1e-5


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

    def at_rest(self, pressure: float) -> Array:
        """States at a pressure (Pa) that has lasted, friction and rubber relaxed: those of `STATES`, then the stop operators."""
        return np.array([pressure, pressure, 0.0, *np.zeros(len(self.hysteresis.yield_strains))])

    @property
    def scales(self) -> Array:
        """Size of each state."""
        return np.array([1e5, 1e5, 10.0, *np.ones(len(self.hysteresis.yield_strains))])

    def pull(self, states: Array, strain: float) -> float:
        """Pull, N, at a strain."""
        pressure, rubber, stops = max(float(states[1]), 0.0), float(states[2]), np.clip(states[STATES:], -1.0, 1.0)
        friction = float(self.hysteresis.half_width(pressure) * (stops @ self.hysteresis.shares))
        return float(softplus(float(self.muscle.force(pressure, strain)) - friction - rubber, SLACK_WIDTH))

    def rates(self, states: Array, strain: float, strain_rate: float, regulator: Regulator | None, asked: float) -> Array:
        """Rates of the states while a regulator is `asked` for a pressure (Pa); without one, `asked` is the air shut in, `p V` at the wall.

        `p_w' = (asked - p_w)/lag`; `p' = gamma/V (q p0 - p V' e')` (p absolute), and shut in `p' = -gamma/V p V' e' + (asked/V - p)/tau`.
        """
        wanted, pressure, rubber = states[:STATES].tolist()
        absolute = pressure + ATMOSPHERE
        chamber = float(volume(self.muscle, np.asarray(strain))) + self.air.dead_volume
        work = absolute * float(volume_slope(self.muscle, np.asarray(strain))) * strain_rate
        if regulator is None:
            filled = [0.0, -self.air.heat_ratio / chamber * work + (asked / chamber - absolute) / self.air.cooling_time]
        else:
            inflow = regulator.inflow(wanted, pressure) * ATMOSPHERE
            filled = [(asked - wanted) / regulator.lag, self.air.heat_ratio / chamber * (inflow - work)]
        relaxing = self.rubber.stiffness * strain_rate - rubber / self.rubber.relaxation_time
        stops = np.clip(states[STATES:], -1.0, 1.0)
        return np.array([*filled, relaxing, *stop_rates(stops, self.hysteresis.yield_strains, strain_rate)])

    def _rubber(self, strain: Array, sample_time: float) -> Array:
        """`s' = K e' - s/tau`, N, `(n,)`: positive in contraction, where it takes from the pull."""
        memory = np.exp(-sample_time / self.rubber.relaxation_time)
        gain = self.rubber.stiffness * self.rubber.relaxation_time * (1.0 - memory) / sample_time
        return np.asarray(lfilter([gain], [1.0, -memory], np.diff(strain, prepend=strain[:1])))


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
    samples = round(motion.duration / motion.sample_time) + 1
    time = motion.sample_time * np.arange(samples, dtype=np.float64)
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
