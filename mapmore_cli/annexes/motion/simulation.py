"""Simulate sections along recordings, test their stability, find the active section at each sample,
and compute the error measures of Brown and Xie 2024.

A section `x2[k+1] = P1 x1 + P2 x2 + ...` has the poles of `z^2 - P2 z - P1`. It is stable in the
triangle `|P1| < 1`, `|P2| < 1 - P1`. Sections are linear filters, so no loop over samples is
needed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mapmore_cli.annexes.motion.body import BUMPLESS, HARD, REST, Motion
from mapmore_cli.domain.arrays import (
    Array,
    BoolArray,
    Columns,
    IntArray,
    columns_at,
    root_mean_square,
    row_count,
)
from mapmore_cli.domain.errors import DataError, FitError
from mapmore_cli.modelling.expressions import evaluate, parse
from mapmore_cli.modelling.expressions.operators.play import play
from mapmore_cli.modelling.memory.records import uninterrupted

# largest reflection coefficient; above it, rounding errors decide whether a section is stable
EDGE = 1.0 - 1e-9


def stable(p1: float, p2: float, reach: float = 1.0) -> bool:
    """Return True if the moduli of both poles are smaller than `reach`."""
    p1, p2 = p1 / reach**2, p2 / reach
    return abs(p1) < 1.0 and abs(p2) < 1.0 - p1


def of_angles(angles: Array, reach: float) -> tuple[float, float]:
    """Return P1 and P2 for two search coordinates, which may have any values. With `k =
    tanh(angle)`, the coordinates give the two reflection coefficients of Levinson's recursion, and
    `P1 = -k2 r^2`, `P2 = -k1 (1 + k2) r`, where r is the `reach`.

    Every section with both poles inside the circle of radius r corresponds to one point of the
    square `|k1|, |k2| < 1`.
    """
    k1, k2 = (min(max(math.tanh(angle), -EDGE), EDGE) for angle in angles.tolist())
    return -k2 * reach**2, -k1 * (1.0 + k2) * reach


def angles(p1: float, p2: float, reach: float, inmost: float = EDGE) -> list[float]:
    """Return the two coordinates that `of_angles` converts to P1 and P2. The absolute values of the
    reflection coefficients are limited to `inmost`. If a pole lies outside the circle of radius
    `reach`, the coordinates are those of a section near it whose poles lie inside.
    """
    k2 = min(max(-p1 / reach**2, -EDGE), EDGE)
    k1 = -p2 / reach / (1.0 + k2)
    return [math.atanh(min(max(k, -inmost), inmost)) for k in (k1, k2)]


def spread(u: Array, count: int) -> tuple[float, ...]:
    """Return the boundaries of `count` sections that contain equal numbers of the samples u, (n,).

    Raises DataError if a section would have no width, because the input stays at one value for too
    long.
    """
    boundaries = np.quantile(u, np.arange(1, count) / count)
    edges = np.array([u.min(), *boundaries, u.max()])
    if np.any(np.diff(edges) <= 0):
        raise DataError(
            f"{count} sections with equal shares of the samples are not possible, because "
            f"the input stays at {edges[:-1][np.diff(edges) <= 0][0]:.6g} for too many "
            "samples",
            "give the boundaries as a list, or use fewer sections",
        )
    return tuple(boundaries.tolist())


def rising(u: Array, dead_band: float, *, latched: bool) -> BoolArray:
    """Return a mask that is True for samples at which the input rises, (n,).

    Without `latched`, the input rises if `u[k] > u[k-1]` (equation 16 of Brown and Xie 2024). The
    mask is False at the first sample, and while the input is constant.

    With `latched`, the mask changes only when the input has turned back by more than the dead band.
    It is True before the first movement.
    """
    if not latched:
        return np.diff(u, prepend=u[:1]) > 0
    moves = np.diff(play(u, 0.5 * dead_band), prepend=u[:1])
    last = np.maximum.accumulate(np.where(moves != 0, np.arange(len(u)), -1))
    return (last < 0) | (moves[np.maximum(last, 0)] > 0)


def active(motion: Motion, u: Array, moving: Array | None = None) -> IntArray:
    """Return the index of the active section at each sample, (n,), counted from 0: section j is
    active from its lower boundary on (equation 15 of Brown and Xie 2024).

    The direction of motion is taken from `moving`, (n,), or by default from the input u, (n,).
    """
    place = np.searchsorted(np.asarray(motion.boundaries), u, side="right")
    if not motion.directed:
        return place.astype(np.int64)
    falls = ~rising(
        u if moving is None else moving, motion.dead_band, latched=motion.switching == BUMPLESS
    )
    return (2 * place + falls).astype(np.int64)


def extent(boundaries: Sequence[float], place: int) -> str:
    """Return the range of the input of one section as text, for example `from 1.05 to 2.35`."""
    if not boundaries:
        return "any input"
    if place == 1:
        return f"below {boundaries[0]:.6g}"
    if place == len(boundaries) + 1:
        return f"from {boundaries[-1]:.6g} on"
    return f"from {boundaries[place - 2]:.6g} to {boundaries[place - 1]:.6g}"


def simulate(motion: Motion, columns: Columns) -> Array:
    """Return the output, (n,), along a recording. If `columns` have no `time`, they are one piece
    without gaps.

    Every piece begins as `motion.start` says: in the steady state of its first input, or at zero.
    The measured output is not needed.

    Raises FitError if a section is unstable; AtSample if a time step is neither that of the model
    nor a gap.
    """
    for section in motion.sections:
        if not stable(section.p1, section.p2):
            raise FitError(
                f"section {section.id} of the model of `{motion.output}` is unstable: it "
                f"has a pole at {section.radius:.6g}, outside the unit circle",
                "repeat the run that made this model, because a fit gives stable sections only",
            )
    parts = uninterrupted(columns["time"], motion.step) if "time" in columns else [slice(None)]
    return np.concatenate([_along(columns_at(columns, part), motion) for part in parts])


def driven(drives: tuple[str, ...], columns: Columns) -> Array:
    """Return the values of the drives at every sample, (n, m)."""
    n = row_count(columns)
    return np.column_stack(
        [np.broadcast_to(evaluate(parse(text), columns, n), n) for text in drives]
    )


def _along(columns: Columns, motion: Motion) -> Array:
    drives, holds = driven(motion.drives, columns), active(motion, columns[motion.input])
    if motion.switching != HARD:
        poles = np.array([(section.p1, section.p2) for section in motion.sections])
        weights = np.array([section.weights for section in motion.sections])
        return shared(poles, np.sum(drives * weights[holds], axis=1), holds, motion.start)
    values = np.empty(len(drives))
    for number in np.unique(holds):
        section, rows = motion.sections[number], holds == number
        values[rows] = response(section.p1, section.p2, drives @ section.weights, motion.start)[
            rows
        ]
    return values


def response(p1: float, p2: float, drive: Array, start: str = REST) -> Array:
    """Return the output x1 (n,) or (n, m) of one section: `x1[k+2] = P2 x1[k+1] + P1 x1[k] + d[k]`,
    beginning at zero, or at rest under a constant drive d[0].
    """
    from scipy.signal import lfilter

    origin = drive[0] if start == REST else np.zeros_like(drive[0])
    moved = lfilter([0.0, 0.0, 1.0], [1.0, -p2, -p1], drive - origin, axis=0)
    return np.asarray(moved + origin / (1.0 - p1 - p2))


def shared(poles: Array, drive: Array, holds: IntArray, start: str = REST) -> Array:
    """Return the output, (n,) or (n, m), of sections that pass on a common state. The state begins
    at zero, or at rest under a constant drive d[0].

    `poles` holds P1 and P2 of every section, (s, 2); `drive` drives the active section, (n,) or (n,
    m); `holds`, (n,), is the index of the active section.
    """
    from scipy.signal import lfilter

    n = len(holds)
    # x1[k] is stored at index k, and x2[k] at index k + 1
    states = np.empty((n + 2, *drive.shape[1:]))
    p1, p2 = poles[holds[0]] if n else (0.0, 0.0)
    states[:2] = drive[0] / (1.0 - p1 - p2) if start == REST else 0.0
    turns = np.flatnonzero(np.diff(holds)) + 1
    for first, last in zip([0, *turns], [*turns, n], strict=True):
        p1, p2 = poles[holds[first]]
        past = np.stack([p2 * states[first + 1] + p1 * states[first], p1 * states[first + 1]])
        states[first + 2 : last + 2], _ = lfilter(
            [1.0], [1.0, -p2, -p1], drive[first:last], axis=0, zi=past
        )
    return states[:n]


# the input repeats if its last two wavelengths differ by at most this fraction of its range
REPEATS = 1e-3


class MotionErrors(NamedTuple):
    """Errors of the displacement and of the velocity over the last wavelength of the input. If the
    displacement is in mm, the errors of the velocity are in mm/s. `transient` is the largest error
    of the displacement before the last wavelength.
    """

    displacement_rmse: float
    velocity_rmse: float
    max_displacement: float
    max_velocity: float
    transient: float
    samples: int


def last_wavelength(u: Array) -> int:
    """Return the wavelength of a periodic input, (n,), as a number of samples: the shortest length,
    from four samples on, for which the last two stretches of this length are equal and the input
    moves within them. Return n if there is none.
    """
    tolerance = REPEATS * float(np.ptp(u))
    for length in range(4, len(u) // 2 + 1):
        tail = u[-length:]
        moving = np.ptp(tail) > tolerance
        if moving and np.abs(tail - u[-2 * length : -length]).max() <= tolerance:
            return length
    return len(u)


def motion_errors(measured: Array, predicted: Array, u: Array, step: float) -> MotionErrors:
    """Return the errors of one recording. All signals have n samples, at least two, at intervals of
    `step` (s).
    """
    tail, before = last_wavelength(u), predicted - measured
    error, before = before[-tail:], np.abs(before[:-tail])
    faster = (np.gradient(predicted, step) - np.gradient(measured, step))[-tail:]
    return MotionErrors(
        root_mean_square(error),
        root_mean_square(faster),
        float(np.abs(error).max()),
        float(np.abs(faster).max()),
        float(before.max()) if len(before) else float("nan"),
        tail,
    )
