"""The errors that P tables: of displacement and velocity over one wavelength (P table 3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array

REPEATS = 1e-3
"""Two wavelengths of an input are the same where they differ by less than this share of its range."""


@dataclass(frozen=True)
class MotionErrors:
    """Errors over the last wavelength, in the unit of the displacement and per second; `transient` is the largest before it."""

    displacement_rmse: float
    velocity_rmse: float
    max_displacement: float
    max_velocity: float
    transient: float
    samples: int


def last_wavelength(u: Array) -> int:
    """Return samples of the last wavelength of an input (n,), so many that it repeats itself before; n where it does not."""
    tolerance = REPEATS * float(np.ptp(u))
    moving = np.ptp(u) > 0
    for length in range(4, len(u) // 2 + 1):
        tail = u[-length:]
        if moving and np.ptp(tail) > tolerance and np.abs(tail - u[-2 * length : -length]).max() <= tolerance:
            return length
    return len(u)


def velocity(y: Array, step: float) -> Array:
    """Central differences (n,), per second."""
    return np.gradient(y, step) if len(y) > 1 else np.zeros(len(y))


def motion_errors(measured: Array, predicted: Array, u: Array, step: float) -> MotionErrors:
    """Errors of one recording, samples (n,) at every `step` (s)."""
    tail = last_wavelength(u)
    error = predicted - measured
    faster = velocity(predicted, step) - velocity(measured, step)
    before = np.abs(error[:-tail])
    return MotionErrors(
        displacement_rmse=float(np.sqrt(np.mean(error[-tail:] ** 2))),
        velocity_rmse=float(np.sqrt(np.mean(faster[-tail:] ** 2))),
        max_displacement=float(np.abs(error[-tail:]).max()),
        max_velocity=float(np.abs(faster[-tail:]).max()),
        transient=float(before.max()) if len(before) else float("nan"),
        samples=tail,
    )
