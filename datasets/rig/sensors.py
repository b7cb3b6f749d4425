"""What every experiment needs: names of its recordings, its clock, the integration of its
equations, instruments and logger.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from annotated_types import Len
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from datasets.rig.marks import After, NonNegative, Positive
from datasets.rig.muscle import Pressure
from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.declared import Settings
from mapmore_cli.domain.errors import SpecError


def pressure_label(pressure: float) -> str:
    """Name of a pressure (Pa) in file names, in kPa: `080`, `350`, `82.5`."""
    return f"{pressure / 1e3:03g}"


def distinct(
    label: Callable[[Any], str], mistake: str = "each pressure makes one recording: name it once"
) -> After:
    """Refuse a list in which two items would give files of one name."""

    def refuse_twins(items: Sequence[Any]) -> Sequence[Any]:
        if len(set(map(label, items))) != len(items):
            raise ValueError(mistake)
        return items

    return After(refuse_twins)


Pressures = Annotated[Sequence[Pressure], Len(1), distinct(pressure_label)]
"""A recording each, Pa."""


def clock(duration: float, sample_time: float) -> Array:
    """Sample times, s, from zero to the end of a duration."""
    return sample_time * np.arange(round(duration / sample_time) + 1, dtype=np.float64)


TOLERANCE = 1e-6
"""Of each step of the integration, relative to a state and to its scale."""

Rates = Callable[[float, Array], Array]
"""Of states `(k,)` at a time, s."""

LONGEST_STEP = 0.01
"""s; so that no step of the integration passes over a short motion."""


def integrate(
    rates: Rates, start: Array, time: Array, scales: Array, tolerance: float = TOLERANCE
) -> Array:
    """States `(n, k)` at the times `(n,)`, from `start` `(k,)` at the first of them.

    Raises `SpecError` where the equations cannot be solved.
    """
    solution = solve_ivp(
        rates,
        (time[0], time[-1]),
        start,
        method="RK45",
        t_eval=time,
        rtol=tolerance,
        atol=tolerance * scales,
        max_step=LONGEST_STEP,
    )
    if not solution.success or not np.all(np.isfinite(solution.y)):
        raise SpecError(
            f"the simulated rig's equations could not be solved: {solution.message}",
            "bring the parameters of `muscle` and `rig` nearer to their defaults",
        )
    return np.asarray(solution.y.T)


def integrate_phases(
    phases: Iterable[tuple[Rates, Array]], start: Array, scales: Array, tolerance: float = TOLERANCE
) -> Array:
    """States `(n, k)` at the times of all phases, rates and times each: one begins with the last
    time of the one before.
    """
    path = [start[np.newaxis]]
    for rates, time in phases:
        path.append(integrate(rates, path[-1][-1], time, scales, tolerance)[1:])
    return np.concatenate(path)


def low_pass(force: Array, cut_off: float, sample_time: float) -> Array:
    """Force `(n,)` behind a second-order low-pass with `cut_off` Hz at -3 dB, which had settled on
    the first sample.

    Its two poles are real and equal, so that it neither rings nor turns a pull into a push:
    `y[k] = a y[k-1] + (1 - a) x[k]`, twice, `a = exp(-2 pi f dt)`, `f = cut_off/sqrt(sqrt(2) - 1)`.
    """
    memory = np.exp(-2.0 * np.pi * cut_off / np.sqrt(np.sqrt(2.0) - 1.0) * sample_time)
    poles = [1.0, -2.0 * memory, memory**2]
    return np.asarray(force[0] + lfilter([(1.0 - memory) ** 2], poles, force - force[0]))


@dataclass(frozen=True)
class Sensor(Settings):
    """White Gaussian noise, then rounding; both in the unit of the column."""

    noise: NonNegative  # standard deviation
    resolution: Positive  # quantisation step

    def read(self, truth: Array, rng: np.random.Generator) -> Array:
        """Return readings `(n,)`: whole multiples of `resolution`."""
        noisy = truth + self.noise * rng.standard_normal(len(truth))
        # + 0.0 turns -0 into 0
        return np.round(noisy / self.resolution) * self.resolution + 0.0


def recording_generator(seed: int, recording: str) -> np.random.Generator:
    """Random numbers of one recording, by its name: they stay the same whatever other recordings
    are made beside it.
    """
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=tuple(recording.encode())))


def quantity(name: str) -> str:
    """Return the quantity of a column: `pressure` of `pressure_2`, which is the second muscle's."""
    return name.removesuffix("_1").removesuffix("_2")


def measure(truth: Columns, sensors: Mapping[str, Sensor], rng: np.random.Generator) -> Columns:
    """Return the columns as logged, in the units of `truth`; a column without a sensor (the clock)
    is passed on.
    """
    return {
        name: sensors[quantity(name)].read(values, rng) if quantity(name) in sensors else values
        for name, values in truth.items()
    }
