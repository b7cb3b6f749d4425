"""A regulator's input follows a waveform, and a hanging muscle lifts its lower end (P section 2.4, table 2).

Between input and motion stand the regulator's lag, its valve, the air in the muscle, friction, rubber and the mass that hangs on it. The
displacement counts from where the muscle rests without load and input.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import ceil

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.rig.chamber import ATMOSPHERE, GRAVITY, valve_flow
from mapmore_cli.rig.mckibben import McKibben, volume, volume_slope
from mapmore_cli.rig.muscle import Hysteresis, stop_rates, zero_force_strain
from mapmore_cli.rig.wet_muscle import Rubber, integrate

STATES = 5
"""Wanted pressure, pressure (Pa, gauge), strain, strain rate (1/s), rubber (N); the states of the stop operators follow them."""

SCALES = (1e5, 1e5, 0.1, 1.0, 10.0)
"""Size of each, for the tolerance of the integration."""


@dataclass(frozen=True)
class Waveform:
    """Input of the regulator over time: rest, then wavelengths that begin at the low end (a square wave at the high one)."""

    shape: str  # sine | triangle | square
    low: float  # V
    high: float
    frequency: float  # Hz
    wavelengths: int
    rest: float  # before them, s
    rest_input: float  # V
    sample_time: float  # s

    @property
    def clock(self) -> Array:
        """Sample times (n,), s, from the beginning of the rest to the end of the last wavelength."""
        return self.sample_time * np.arange(round((self.rest + self.wavelengths / self.frequency) / self.sample_time) + 1, dtype=np.float64)

    def command(self, time: Array) -> Array:
        """Input (n,), V, at times in s. Of the phase p, from 0 to 1 in each wavelength:

        sine `(1 - cos 2 pi p)/2`, triangle `1 - |1 - 2p|`, square `1` for p < 1/2, else `0`, as a share of the way from low to high.
        """
        # A sample belongs to the wavelength that begins with it, however its time is rounded.
        phase = np.mod((time - self.rest) * self.frequency + 1e-9, 1.0)
        share = {
            "sine": 0.5 - 0.5 * np.cos(2.0 * np.pi * phase),
            "triangle": 1.0 - np.abs(1.0 - 2.0 * phase),
            "square": 1.0 * (phase < 0.5),
        }
        moving = self.low + (self.high - self.low) * share[self.shape]
        u: Array = np.where(time < self.rest - 1e-9, self.rest_input, moving)
        return u


@dataclass(frozen=True)
class Regulator:
    """Proportional pressure regulator: its wanted pressure lags the input, its ISO 6358 valve opens in proportion to what is missing."""

    slope: float  # of the wanted pressure, Pa/V
    offset: float  # at no input, Pa
    lag: float  # of the wanted pressure, s
    band: float  # missing pressure at which the valve is fully open, Pa
    supply: float  # gauge, Pa
    supply_conductance: float  # m3/(s Pa)
    exhaust_conductance: float
    critical_ratio: float

    def wanted(self, command: Array | float) -> Array:
        """Pressure that an input (V) asks for once it has settled, Pa: `max(slope u + offset, 0)`."""
        return np.maximum(self.slope * np.asarray(command) + self.offset, 0.0)

    def command(self, wanted: Array) -> Array:
        """Input (V) that asks for a pressure (Pa)."""
        return np.asarray((wanted - self.offset) / self.slope)

    def inflow(self, wanted: float, pressure: float) -> float:
        """Air flow into the muscle at p0, m3/s."""
        opening = min(max((wanted - pressure) / self.band, -1.0), 1.0)
        if opening > 0.0:
            return opening * valve_flow(self.supply_conductance, self.critical_ratio, self.supply + ATMOSPHERE, pressure + ATMOSPHERE)
        return opening * valve_flow(self.exhaust_conductance, self.critical_ratio, pressure + ATMOSPHERE, ATMOSPHERE)


@dataclass(frozen=True)
class WaveformRig:
    """The rig of P's figure 2; `(k,)` states are those of `STATES`, then the m stop operators."""

    muscle: McKibben
    hysteresis: Hysteresis
    rubber: Rubber
    regulator: Regulator
    polytropic: float  # n of the air
    dead_volume: float  # of hose and fittings, m3
    end_mass: float  # of the muscle's lower end and the encoder's slide, kg

    def resting_strain(self, pressure: float, load: float) -> float:
        """Strain at which the muscle holds its end and a `load` (kg), with relaxed friction and rubber, at `pressure` (Pa)."""
        weight = (self.end_mass + load) * GRAVITY
        return zero_force_strain(lambda strain: float(self.muscle.force(pressure, strain)) - weight)

    def at_rest(self, command: float, load: float) -> Array:
        """States under an input (V) that has lasted for ever."""
        pressure = float(self.regulator.wanted(command))
        moving = [pressure, pressure, self.resting_strain(pressure, load), 0.0, 0.0]
        return np.concatenate([moving, np.zeros(len(self.hysteresis.yield_strains))])

    def rates(self, time: float, states: Array, waveform: Waveform, load: float) -> Array:
        """Rates of the states.

        `p_w' = (wanted(u) - p_w)/lag`; `p' = n/V (q p0 - (p + p0) V'(e) e')`; `m L0 e'' = F(p, e) - h - s - m g`.
        """
        wanted, pressure, strain, strain_rate, rubber = states[:STATES].tolist()
        stops = np.clip(states[STATES:], -1.0, 1.0)  # the integration may overstep by its tolerance
        settled = float(self.regulator.wanted(waveform.command(np.asarray(time))))
        chamber, swept = float(volume(self.muscle, np.asarray(strain))), float(volume_slope(self.muscle, np.asarray(strain)))
        filling = self.regulator.inflow(wanted, pressure) * ATMOSPHERE - (pressure + ATMOSPHERE) * swept * strain_rate
        driving = max(pressure, 0.0)
        friction = float(self.hysteresis.half_width(driving) * (stops @ self.hysteresis.shares))
        pull = float(self.muscle.force(driving, strain)) - friction - rubber
        mass = self.end_mass + load
        moving = [
            (settled - wanted) / self.regulator.lag,
            self.polytropic / (chamber + self.dead_volume) * filling,
            strain_rate,
            (pull - mass * GRAVITY) / (mass * self.muscle.length),
            self.rubber.stiffness * strain_rate - rubber / self.rubber.relaxation_time,
        ]
        return np.concatenate([moving, stop_rates(stops, self.hysteresis.yield_strains, strain_rate)])


TOLERANCE = 1e-5
"""Of each step of the integration, relative to a state and to its scale: it moves the displacement by less than a sensor's step."""


def waveform_response(rig: WaveformRig, waveform: Waveform, load: float, tolerance: float = TOLERANCE) -> Columns:
    """Truth of one recording with a `load` (kg) on the muscle's end, each `(n,)`.

    `time` (s), `input` (V), `pressure` in the muscle (Pa), `displacement` of its lower end (m, upwards), `load` on it (N, as a load cell
    between end and load feels it: `m (g + L0 e'')`).
    """
    clock, motion = waveform.clock, partial(rig.rates, waveform=waveform, load=load)
    scales = np.concatenate([SCALES, np.ones(len(rig.hysteresis.yield_strains))])
    states = _piecewise(motion, rig.at_rest(waveform.rest_input, load), clock, waveform, scales, tolerance)
    accelerations = np.array([motion(float(time), state)[3] for time, state in zip(clock, states, strict=True)])
    length = rig.muscle.length
    zero = rig.resting_strain(float(rig.regulator.wanted(0.0)), 0.0)
    return {
        "time": clock,
        "input": waveform.command(clock),
        "pressure": states[:, 1],
        "displacement": length * (states[:, 2] - zero),
        "load": load * (GRAVITY + length * accelerations),
    }


def _piecewise(motion: partial[Array], start: Array, clock: Array, waveform: Waveform, scales: Array, tolerance: float) -> Array:
    """States `(n, k)` along the clock, integrated anew from every half wavelength: there the input may jump or have a corner."""
    half = 0.5 / waveform.frequency
    corners = waveform.rest + half * np.arange(ceil(2 * waveform.wavelengths))
    starts = np.searchsorted(clock, corners - 1e-9)
    path = [start[np.newaxis]]
    for first, last in zip([0, *starts], [*starts, len(clock) - 1], strict=True):
        if last > first:
            path.append(integrate(motion, path[-1][-1], clock[first : last + 1], scales, tolerance)[1:])
    return np.concatenate(path)
