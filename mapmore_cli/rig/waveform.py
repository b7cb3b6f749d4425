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
from mapmore_cli.rig.air import ClosedMuscle, Regulator
from mapmore_cli.rig.muscle import GRAVITY
from mapmore_cli.rig.sensors import clock, integrate


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
        return clock(self.rest + self.wavelengths / self.frequency, self.sample_time)

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
class WaveformRig:
    """The rig of P's figure 2; `(k,)` states are strain and strain rate (1/s), then the muscle's."""

    muscle: ClosedMuscle
    regulator: Regulator
    end_mass: float  # of the muscle's lower end and the encoder's slide, kg

    def resting_strain(self, pressure: float, load: float) -> float:
        """Strain at which the muscle holds its end and a `load` (kg), with relaxed friction and rubber, at `pressure` (Pa)."""
        return self.muscle.taut_strain(pressure, (self.end_mass + load) * GRAVITY)

    def at_rest(self, command: float, load: float) -> Array:
        """States under an input (V) that has lasted for ever."""
        pressure = float(self.regulator.wanted(command))
        return np.array([self.resting_strain(pressure, load), 0.0, *self.muscle.at_rest(pressure)])

    def rates(self, time: float, states: Array, waveform: Waveform, load: float) -> Array:
        """Rates of the states: `m L0 e'' = F(p, e) - h - s - m g`, and those of the muscle."""
        strain, strain_rate = states[:2].tolist()
        mass, own = self.end_mass + load, states[2:]
        acceleration = (self.muscle.tension(own, strain) - mass * GRAVITY) / (mass * self.muscle.muscle.length)
        settled = float(self.regulator.wanted(waveform.command(np.asarray(time))))
        return np.array([strain_rate, acceleration, *self.muscle.rates(own, strain, strain_rate, self.regulator, settled)])


TOLERANCE = 1e-5
"""Of each step of the integration, relative to a state and to its scale: it moves the displacement by less than a sensor's step."""


def waveform_response(rig: WaveformRig, waveform: Waveform, load: float, tolerance: float = TOLERANCE) -> Columns:
    """Truth of one recording with a `load` (kg) on the muscle's end, each `(n,)`.

    `time` (s), `input` (V), `pressure` in the muscle (Pa), `displacement` of its lower end (m, upwards), `load` on it (N, as a load cell
    between end and load feels it: `m (g + L0 e'')`).
    """
    time, motion = waveform.clock, partial(rig.rates, waveform=waveform, load=load)
    scales = np.array([0.1, 1.0, *rig.muscle.scales])
    states = _piecewise(motion, rig.at_rest(waveform.rest_input, load), time, waveform, scales, tolerance)
    accelerations = np.array([motion(float(at), state)[1] for at, state in zip(time, states, strict=True)])
    length = rig.muscle.muscle.length
    zero = rig.resting_strain(float(rig.regulator.wanted(0.0)), 0.0)
    return {
        "time": time,
        "input": waveform.command(time),
        "pressure": states[:, 3],
        "displacement": length * (states[:, 0] - zero),
        "load": load * (GRAVITY + length * accelerations),
    }


def _piecewise(motion: partial[Array], start: Array, time: Array, waveform: Waveform, scales: Array, tolerance: float) -> Array:
    """States `(n, k)` at the times, integrated anew from every half wavelength: there the input may jump or have a corner."""
    half = 0.5 / waveform.frequency
    corners = waveform.rest + half * np.arange(ceil(2 * waveform.wavelengths))
    starts = np.searchsorted(time, corners - 1e-9)
    path = [start[np.newaxis]]
    for first, last in zip([0, *starts], [*starts, len(time) - 1], strict=True):
        if last > first:
            path.append(integrate(motion, path[-1][-1], time[first : last + 1], scales, tolerance)[1:])
    return np.concatenate(path)
