"""What the logger sees of a true quantity: noise and quantisation, from an explicit seed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns


@dataclass(frozen=True)
class Sensor:
    """White Gaussian noise, then rounding; both in the unit of what is sensed."""

    noise: float  # standard deviation
    resolution: float  # quantisation step, > 0

    def read(self, truth: Array, rng: np.random.Generator) -> Array:
        """Readings `(n,)`: whole multiples of `resolution`."""
        noisy = truth + self.noise * rng.standard_normal(len(truth))
        return np.asarray(np.round(noisy / self.resolution) * self.resolution + 0.0)  # + 0.0 turns -0 into 0


def recording_generator(seed: int, recording: str) -> np.random.Generator:
    """Random numbers of one recording, by its name: they stay the same whatever other recordings are made beside it."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=tuple(recording.encode())))


def measure(truth: Columns, sensors: Mapping[str, Sensor], rng: np.random.Generator) -> Columns:
    """The columns as logged, in the units of `truth`; a column without a sensor (the clock) is passed on."""
    return {name: sensors[name].read(values, rng) if name in sensors else values for name, values in truth.items()}
