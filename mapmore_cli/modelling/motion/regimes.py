"""Which section holds at a sample: by the input's place, and by its direction."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.motion import ALL, BUMPLESS, FALL, RISE, Motion
from mapmore_cli.modelling.terms.operators.play import play


def spread(u: Array, count: int) -> tuple[float, ...]:
    """Boundaries between `count` sections with equal shares of the samples u (n,).

    Raises
    ------
    DataError
        Where the input dwells so long at one value that a section would have no width.
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
    """The inputs of the section at a place, as `from 1.05 to 2.35`."""
    if not boundaries:
        return "any input"
    if place == 1:
        return f"below {boundaries[0]:.6g}"
    if place == len(boundaries) + 1:
        return f"from {boundaries[-1]:.6g} on"
    return f"from {boundaries[place - 2]:.6g} to {boundaries[place - 1]:.6g}"
