"""The plane of P1 and P2: where a section is stable, and coordinates in which it is easily searched.

A section `x2[k+1] = P1 x1 + P2 x2 + ...` has the poles of `z^2 - P2 z - P1`. It is stable in the triangle `|P1| < 1`, `|P2| < 1 - P1`.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.models import ALL, BUMPLESS, FALL, RISE, Motion
from mapmore_cli.modelling.expressions.operators.play import play

SLOWEST, FASTEST = 1e-4, 0.5
"""Natural frequencies that are looked for, in cycles per sample."""

LEAST_DAMPED, MOST_DAMPED = 0.02, 5.0
"""Damping ratios that are looked for."""

EDGE = 1.0 - 1e-9
"""Largest reflection coefficient: nearer to the edge, rounding decides whether a section is stable."""


def stable(p1: float, p2: float, reach: float = 1.0) -> bool:
    """Whether both poles lie within the circle of radius `reach`."""
    p1, p2 = p1 / reach**2, p2 / reach
    return abs(p1) < 1.0 and abs(p2) < 1.0 - p1


def radius(p1: float, p2: float) -> float:
    """Largest modulus of a pole."""
    root = cmath.sqrt(0.25 * p2 * p2 + p1)
    return max(abs(0.5 * p2 + root), abs(0.5 * p2 - root))


def of_oscillator(frequency: float, damping: float) -> tuple[float, float]:
    """P1 and P2 whose poles are those of `x'' + 2 d w x' + w^2 x`, sampled; `frequency` `w/(2 pi)` in cycles per sample.

    `P1 = -z1 z2`, `P2 = z1 + z2`, `z = exp(w (-d +- sqrt(d^2 - 1)))`. Such poles never lie on the negative axis but at the highest
    frequency, where P has some (`P1 > 0`): sampling has no oscillator for them.
    """
    w = 2.0 * math.pi * frequency
    root = cmath.sqrt(damping * damping - 1.0)
    first, second = cmath.exp(w * (-damping + root)), cmath.exp(w * (-damping - root))
    return -(first * second).real, (first + second).real


def of_reflections(k1: float, k2: float, reach: float) -> tuple[float, float]:
    """P1 and P2 of two reflection coefficients (Levinson's recursion): `P1 = -k2 r^2`, `P2 = -k1 (1 + k2) r`.

    The square `|k1|, |k2| < 1` is all sections with both poles within the circle of radius r, the `reach`.
    """
    return -k2 * reach**2, -k1 * (1.0 + k2) * reach


def reflections(p1: float, p2: float, reach: float) -> tuple[float, float]:
    """Return the inverse of `of_reflections`; a section with a pole outside of the circle comes to the nearest edge."""
    k2 = min(max(-p1 / reach**2, -EDGE), EDGE)
    return min(max(-p2 / reach / (1.0 + k2), -EDGE), EDGE), k2


def of_angles(angles: Array, reach: float) -> tuple[float, float]:
    """P1 and P2 of two coordinates that may have any value: `k = tanh(angle)`."""
    k1, k2 = (min(max(math.tanh(angle), -EDGE), EDGE) for angle in angles.tolist())
    return of_reflections(k1, k2, reach)


def angles(p1: float, p2: float, reach: float, inmost: float = EDGE) -> list[float]:
    """Return the inverse of `of_angles`, of a section whose reflection coefficients are brought to `inmost` at most."""
    return [math.atanh(min(max(k, -inmost), inmost)) for k in reflections(p1, p2, reach)]


def unstable_sections(motion: Motion) -> list[str]:
    """Ids of the sections whose output grows without bound."""
    return [section.id for section in motion.sections if not stable(section.p1, section.p2)]


def spread(u: Array, count: int) -> tuple[float, ...]:
    """Boundaries between `count` sections with equal shares of the samples u (n,).

    Raises DataError where the input dwells so long at one value that a section would have no width.
    """
    boundaries = np.quantile(u, np.arange(1, count) / count)
    edges = np.array([u.min(), *boundaries, u.max()])
    if np.any(np.diff(edges) <= 0):
        raise DataError(
            f"{count} sections with equal shares of the samples have no width everywhere: the input dwells at "
            f"{edges[:-1][np.diff(edges) <= 0][0]:.6g}",
            "give the boundaries as a list, or ask for fewer sections",
        )
    return tuple(boundaries.tolist())


def rising(u: Array, dead_band: float, *, latched: bool) -> BoolArray:
    """Whether the input rises, (n,).

    P eq 16: where `u[k] > u[k-1]`; an input that stands still falls, and so does the first sample. `latched`: the direction holds until
    the input has turned back by more than the dead band, and rises before it has moved.
    """
    if not latched:
        return np.diff(u, prepend=u[:1]) > 0
    moves = np.diff(play(u, 0.5 * dead_band), prepend=u[:1])
    last = np.maximum.accumulate(np.where(moves != 0, np.arange(len(u)), -1))
    return (last < 0) | (moves[np.maximum(last, 0)] > 0)


def active(motion: Motion, u: Array, moving: Array | None = None) -> IntArray:
    """Return the number of the section that holds at each sample, (n,), from 0: section j from its lower boundary on (P eq 15).

    The direction is that of `moving` (n,), by default of the input u (n,).
    """
    place = np.searchsorted(np.asarray(motion.boundaries), u, side="right")
    if not motion.directed:
        return place.astype(np.int64)
    falls = ~rising(u if moving is None else moving, motion.dead_band, latched=motion.switching == BUMPLESS)
    return (2 * place + falls).astype(np.int64)


def named(count: int, *, directed: bool) -> list[tuple[str, int, str]]:
    """Id, place and direction of every section of a model, in its order."""
    if not directed:
        return [(str(place), place, ALL) for place in range(1, count + 1)]
    return [(f"{way} {place}", place, way) for place in range(1, count + 1) for way in (RISE, FALL)]


def extent(boundaries: Sequence[float], place: int) -> str:
    """Return the inputs of the section at a place, as `from 1.05 to 2.35`."""
    if not boundaries:
        return "any input"
    if place == 1:
        return f"below {boundaries[0]:.6g}"
    if place == len(boundaries) + 1:
        return f"from {boundaries[-1]:.6g} on"
    return f"from {boundaries[place - 2]:.6g} to {boundaries[place - 1]:.6g}"
