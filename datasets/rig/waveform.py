"""A regulator's input follows a waveform, and a hanging muscle lifts its lower end (P section 2.4,
table 2).

Between input and motion stand the regulator's lag, its valve, the air in the muscle, friction,
rubber and the mass that hangs on it. The displacement counts from where the muscle rests without
load and input.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Interval, Len

from datasets.rig.air import TOLERANCE, Air, ClosedMuscle, Regulator
from datasets.rig.marks import NonNegative, Positive
from datasets.rig.muscle import GRAVITY, Hysteresis, Rubber
from datasets.rig.sensors import clock, distinct, integrate_phases
from datasets.rig.static_muscles import McKibben
from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.declared import Name, Settings

Command = Annotated[float, Interval(ge=0, le=10)]
"""V."""


@dataclass(frozen=True)
class Waveform(Settings):
    """One recording: rest, then so many wavelengths, which begin at the low end (a square wave at
    the high one).
    """

    name: Name
    shape: Literal["sine", "triangle", "square"]
    low: Command
    high: Command
    frequency: Positive  # Hz
    wavelengths: Annotated[int, Ge(1)]
    # input before the first wavelength, under which the muscle has come to rest
    rest_at: Command = 0.0
    load: NonNegative = 0.0  # that hangs on the muscle beside its own end, kg

    def __post_init__(self) -> None:
        """Refuse a waveform without a height."""
        if self.low >= self.high:
            raise ValueError("`low` must lie below `high`")

    def command(self, time: Array) -> Array:
        """Input (n,), V, at times in s from the first wavelength on. Of the phase p, from 0 to 1 in
        each wavelength:

        sine `(1 - cos 2 pi p)/2`, triangle `1 - |1 - 2p|`, square `1` for p < 1/2, else `0`, as a
        share of the way from low to high.
        """
        # A sample belongs to the wavelength that begins with it, however its time is rounded.
        phase = np.mod(time * self.frequency + 1e-9, 1.0)
        share = {
            "sine": 0.5 - 0.5 * np.cos(2.0 * np.pi * phase),
            "triangle": 1.0 - np.abs(1.0 - 2.0 * phase),
            "square": 1.0 * (phase < 0.5),
        }
        moving = self.low + (self.high - self.low) * share[self.shape]
        u: Array = np.where(time < -1e-9, self.rest_at, moving)
        return u


@dataclass(frozen=True)
class Waveforms(Settings):
    """The input of a regulator follows waveforms, one recording each; a hanging McKibben muscle
    moves (P section 2.4, table 2).
    """

    type: Literal["waveforms"]
    waveforms: Annotated[
        Sequence[Waveform],
        Len(1),
        distinct(
            lambda waveform: waveform.name,
            "each waveform makes one recording: give it a name of its own",
        ),
    ]
    rest: Positive  # before the first wavelength, s
    sample_time: Positive  # s
    regulator: Regulator
    polytropic: Annotated[float, Interval(ge=1, le=1.4)]  # of the air in the muscle
    dead_volume: NonNegative  # of hose and fittings, m3
    end_mass: Positive  # of the muscle's lower end and the encoder's slide, kg
    rubber: Rubber

    def __post_init__(self) -> None:
        """Refuse too few samples."""
        if 10 * self.sample_time > min(1.0 / waveform.frequency for waveform in self.waveforms):
            raise ValueError(
                "each wavelength needs ten samples: shorten `sample_time` or lower `frequency`"
            )

    def hung(self, muscle: McKibben, hysteresis: Hysteresis) -> ClosedMuscle:
        """Return a muscle that hangs in the rig."""
        air = Air(self.polytropic, np.inf, self.dead_volume)
        return ClosedMuscle(muscle, hysteresis, self.rubber, air)

    def resting_strain(self, muscle: ClosedMuscle, pressure: float, load: float) -> float:
        """Strain at which a muscle holds its end and a `load` (kg), with relaxed friction and
        rubber, at `pressure` (Pa).
        """
        return muscle.taut_strain(pressure, (self.end_mass + load) * GRAVITY)


def waveform_response(setup: Waveforms, muscle: ClosedMuscle, waveform: Waveform) -> Columns:
    """Truth of one recording on the rig of P's figure 2, from the beginning of the rest to the end
    of the last wavelength, each `(n,)`; states are strain and strain rate (1/s), then the muscle's.

    `time` (s), `input` (V), `pressure` in the muscle (Pa), `displacement` of its lower end (m,
    upwards), `load` on it (N, as a load cell between end and load feels it: `m (g + L0 e'')`).
    """
    length, load, regulator = muscle.muscle.length, waveform.load, setup.regulator
    mass = setup.end_mass + load

    def rates(time: float, states: Array) -> Array:
        """Return `m L0 e'' = F(p, e) - h - s - m g`, and the rates of the muscle."""
        (strain, strain_rate), own = states[:2].tolist(), states[2:]
        acceleration = (muscle.tension(own, strain) - mass * GRAVITY) / (mass * length)
        settled = float(regulator.wanted(waveform.command(np.asarray(time - setup.rest))))
        changes = muscle.rates(own, strain, strain_rate, regulator, settled)
        return np.array([strain_rate, acceleration, *changes])

    time = clock(setup.rest + waveform.wavelengths / waveform.frequency, setup.sample_time)
    # Anew from every half wavelength: there the input may jump or have a corner.
    corners = setup.rest + 0.5 / waveform.frequency * np.arange(2 * waveform.wavelengths)
    ends = pairwise([0, *np.searchsorted(time, corners - 1e-9), len(time) - 1])
    phases = [(rates, time[first : last + 1]) for first, last in ends if last > first]
    pressure, none = (float(regulator.wanted(at)) for at in (waveform.rest_at, 0.0))
    begin = [setup.resting_strain(muscle, pressure, load), 0.0, *muscle.at_rest(pressure)]
    scales = np.array([0.1, 1.0, *muscle.scales])
    states = integrate_phases(phases, np.array(begin), scales, TOLERANCE)
    accelerations = [rates(float(at), state)[1] for at, state in zip(time, states, strict=True)]
    zero = setup.resting_strain(muscle, none, 0.0)
    return {
        "time": time,
        "input": waveform.command(time - setup.rest),
        "pressure": states[:, 3],
        "displacement": length * (states[:, 0] - zero),
        "load": load * (GRAVITY + length * np.array(accelerations)),
    }
