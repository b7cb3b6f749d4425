"""What instruments are exposed to, and what the logger sees of it: noise and quantisation, from an explicit seed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.rig.wet_muscle import STOPS, Water, WetMuscle


def observe(muscle: WetMuscle, time: Array, strain: Array, wet: Array, cut_off: float) -> Columns:
    """Columns `(n,)` along the muscle's states `wet` `(n, k)`, evenly spaced in time.

    `time` (s), `pressure` at the sensor before the tube (Pa), `strain`, `force` behind the load cell's amplifier of `cut_off` (Hz) (N),
    `flow` through the tube (m3/s, positive towards the muscle), `muscle_pressure` in the muscle (Pa).
    """
    pull = np.array([muscle.respond(states, 0.0, at, 0.0)[0] for states, at in zip(wet, strain.tolist(), strict=True)])
    water = Water(*wet.T[:STOPS])
    return {
        "time": time,
        "pressure": np.asarray(muscle.sensor_pressure(water)),
        "strain": strain,
        "force": low_pass(pull, cut_off, float(time[1] - time[0])),
        "flow": np.asarray(water.tube_flow),
        "muscle_pressure": np.asarray(water.pressure),
    }


def low_pass(force: Array, cut_off: float, sample_time: float) -> Array:
    """Force `(n,)` behind a second-order low-pass with `cut_off` Hz at -3 dB, which had settled on the first sample.

    Its two poles are real and equal, so that it neither rings nor turns a pull into a push:
    `y[k] = a y[k-1] + (1 - a) x[k]`, twice, `a = exp(-2 pi f dt)`, `f = cut_off/sqrt(sqrt(2) - 1)`.
    """
    memory = np.exp(-2.0 * np.pi * cut_off / np.sqrt(np.sqrt(2.0) - 1.0) * sample_time)
    poles = [1.0, -2.0 * memory, memory**2]
    return np.asarray(force[0] + lfilter([(1.0 - memory) ** 2], poles, force - force[0]))


@dataclass(frozen=True)
class Sensor:
    """White Gaussian noise, then rounding; both in the unit of what is sensed."""

    noise: float  # standard deviation
    resolution: float  # quantisation step, > 0

    def read(self, truth: Array, rng: np.random.Generator) -> Array:
        """Return readings `(n,)`: whole multiples of `resolution`."""
        noisy = truth + self.noise * rng.standard_normal(len(truth))
        return np.asarray(np.round(noisy / self.resolution) * self.resolution + 0.0)  # + 0.0 turns -0 into 0


def recording_generator(seed: int, recording: str) -> np.random.Generator:
    """Random numbers of one recording, by its name: they stay the same whatever other recordings are made beside it."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=tuple(recording.encode())))


def measure(truth: Columns, sensors: Mapping[str, Sensor], rng: np.random.Generator) -> Columns:
    """Return the columns as logged, in the units of `truth`; a column without a sensor (the clock) is passed on."""
    return {name: sensors[name].read(values, rng) if name in sensors else values for name, values in truth.items()}
