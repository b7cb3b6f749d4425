"""Running a model of motion along recordings. Sections are linear filters: no loop passes over samples. And P's errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns, IntArray
from mapmore_cli.domain.errors import FitError
from mapmore_cli.domain.models import HARD, REST, Motion
from mapmore_cli.modelling.expressions import evaluate, parse
from mapmore_cli.modelling.memory.records import uninterrupted
from mapmore_cli.modelling.motion.sections import active, unstable_sections


def simulate(motion: Motion, columns: Columns) -> Array:
    """Output (n,) along a recording with its `time`, or along one piece of a record without.

    Every piece begins as `motion.start` says: in the steady state of its first input, or at zero. The measured output is not needed.

    Raises FitError where a section is unstable; AtSample where the stamps are neither the model's step apart nor a gap.
    """
    loose = unstable_sections(motion)
    if loose:
        raise FitError(
            f"section {loose[0]} of the model of `{motion.output}` is unstable: a pole lies at "
            f"{next(section.radius for section in motion.sections if section.id == loose[0]):.6g}, outside of the unit circle",
            "fit it again: every solver gives stable sections",
        )
    n = len(columns[motion.input])
    parts = uninterrupted(columns["time"], motion.step) if "time" in columns else [slice(0, n)]
    values = np.empty(n)
    for part in parts:
        values[part] = _along({name: column[part] for name, column in columns.items()}, motion)
    return values


def driven(drives: tuple[str, ...], columns: Columns) -> Array:
    """Values (n, m) of the drives."""
    n = len(next(iter(columns.values())))
    return np.column_stack([np.broadcast_to(evaluate(parse(text), columns, n), n) for text in drives])


def _along(columns: Columns, motion: Motion) -> Array:
    drives, holds = driven(motion.drives, columns), active(motion, columns[motion.input])
    if motion.switching != HARD:
        poles = np.array([(section.p1, section.p2) for section in motion.sections])
        weights = np.array([section.weights for section in motion.sections])
        return shared(poles, np.sum(drives * weights[holds], axis=1), holds, motion.start)
    values = np.empty(len(drives))
    for number in np.unique(holds):
        section, own = motion.sections[number], holds == number
        values[own] = response(section.p1, section.p2, drives @ section.weights, motion.start)[own]
    return values


def response(p1: float, p2: float, drive: Array, start: str = REST) -> Array:
    """Return the output x1 (n,) or (n, m) of one section: `x1[k+2] = P2 x1[k+1] + P1 x1[k] + d[k]`, from rest under d[0] or from zero."""
    from scipy.signal import lfilter

    origin = drive[0] if start == REST else np.zeros_like(drive[0])
    moved = lfilter([0.0, 0.0, 1.0], [1.0, -p2, -p1], drive - origin, axis=0)
    return np.asarray(moved + origin / (1.0 - p1 - p2))


def shared(poles: Array, drive: Array, holds: IntArray, start: str = REST) -> Array:
    """Return the output (n,) or (n, m) of sections that hand one state on, from rest under d[0] or from zero.

    - `poles`: P1 and P2 of every section, (s, 2).
    - `drive`: what drives the section that holds, (n,) or (n, m).
    - `holds`: (n,) number of the section that holds.
    """
    from scipy.signal import lfilter

    n = len(holds)
    states = np.empty((n + 2, *drive.shape[1:]))  # x1[k] stands at k, x2[k] at k + 1
    p1, p2 = poles[holds[0]] if n else (0.0, 0.0)
    states[:2] = drive[0] / (1.0 - p1 - p2) if start == REST else 0.0
    turns = np.flatnonzero(np.diff(holds)) + 1
    for first, last in zip([0, *turns], [*turns, n], strict=True):
        p1, p2 = poles[holds[first]]
        past = np.stack([p2 * states[first + 1] + p1 * states[first], p1 * states[first + 1]])
        states[first + 2 : last + 2], _ = lfilter([1.0], [1.0, -p2, -p1], drive[first:last], axis=0, zi=past)
    return states[:n]


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
