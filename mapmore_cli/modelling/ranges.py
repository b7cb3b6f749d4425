"""Where a model was trained, and what lies beyond."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns
from mapmore_cli.domain.models import CurveRange

OUTSIDE_TOLERANCE = 1e-9
"""Inputs within this fraction of a range beyond its end still count as inside: the end itself must not be flagged by rounding."""


class InputRange(NamedTuple):
    """Training range of one input: `low` to `high`, (L,) each; linear between `levels`, (L,), of the input `at` where that is not None."""

    name: str
    at: str | None
    levels: Array
    low: Array
    high: Array


def limits(ranges: Sequence[CurveRange], level: str | None) -> Iterator[InputRange]:
    """Yield the training range of every input, the level first: its own is that of its levels, (1,) each.

    That of any other input is interpolated linearly between the curves, since each curve has its own (free strain grows with pressure).
    """
    if not ranges:
        return
    levels = np.array([one.level for one in ranges], dtype=np.float64) if level is not None else np.empty(0)
    if level is not None:
        yield InputRange(level, None, levels, levels[:1], levels[-1:])
    for name in ranges[0].limits:
        if name != level:
            low, high = np.array([one.limits[name] for one in ranges]).T
            yield InputRange(name, level, levels, low, high)


def outside(ranges: Sequence[CurveRange], level: str | None, columns: Columns) -> BoolArray:
    """Return True where an input lies beyond its training range, (n,)."""
    found = np.zeros(len(next(iter(columns.values()))), dtype=np.bool_)
    for name, at, levels, low, high in limits(ranges, level):
        if name in columns:
            ends = (low[:1], high[:1]) if at is None else (np.interp(columns[at], levels, end) for end in (low, high))
            found |= _beyond(columns[name], *ends)
    return found


def _beyond(x: Array, low: Array, high: Array) -> BoolArray:
    margin = OUTSIDE_TOLERANCE * np.maximum(high - low, np.maximum(np.abs(low), np.abs(high)))
    return np.asarray((x < low - margin) | (x > high + margin))
