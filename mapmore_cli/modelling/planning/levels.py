"""The next level of a quantity that is held constant within a curve.

With RMS_i the error at the inner level v_i of a model that was made without it, a gap is expected to err, in its middle, by

    E_k (v_{k+1} - v_k)^.75,   E_k = mean over the inner ends i of gap k of RMS_i / (v_{i+1} - v_{i-1})^.75

and the next level is the middle of the gap with the largest. With two levels there is no RMS_i, and the next is the middle. On measured
muscles, this is as good as equal distances (docs/planning.md).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.models import LeftOut
from mapmore_cli.domain.results import Candidate, Picture, Until
from mapmore_cli.modelling.validation.intervals import INTERVAL, NORMAL, half_widths

POWER = 0.75  # how a model's error between two levels grows with their distance

ON_A_LINE = 241


def gap_errors(places: Array, errors: Array) -> Array:
    """Return the expected error in the middle of every gap, (K - 1,), of levels (K,) with the left-out `errors` (K - 2,) of the inner ones.

    NaN with two levels, of which none is an inner one.
    """
    if len(places) < 3:
        return np.full(len(places) - 1, np.nan)
    rates = errors / (places[2:] - places[:-2]) ** POWER
    ends = np.concatenate([[np.nan], rates, [np.nan]])
    return np.asarray(np.nanmean([ends[:-1], ends[1:]], axis=0) * np.diff(places) ** POWER)


def _cut(half: Array, parts: Array | float, left_out: LeftOut) -> Array:
    """Return the half widths in gaps that are cut into so many equal `parts`: as parts^-.75, but no less than the scatter at the levels."""
    return np.asarray(np.minimum(half, np.maximum(half * parts**-POWER, NORMAL * left_out.residual)))


def candidates(left_out: LeftOut, level: str, cost: float = 1.0) -> tuple[Candidate, ...]:
    """Return the middle of every gap, the largest expected error first; where repeatability limits, repeats come before them.

    It limits where no gap is expected to err more than the residual of the model at the levels themselves.
    """
    places = np.array(left_out.places)
    middles, expected = (places[:-1] + places[1:]) / 2, gap_errors(places, np.hypot(left_out.offset, left_out.scatter))
    halves = _half(left_out, middles)
    rows = np.column_stack([middles, halves, _cut(halves, 2.0, left_out), expected])[np.argsort(-expected, kind="stable")]
    found = [Candidate({level: middle}, "between", half, after, error, cost) for middle, half, after, error in rows.tolist()]
    if np.max(expected) > left_out.residual:
        return tuple(found)
    return (*(_repeat(left_out, level, number, cost) for number in np.argsort(left_out.repeats, kind="stable")), *found)


def _repeat(left_out: LeftOut, level: str, number: int, cost: float) -> Candidate:
    """One more recording at a level; its half width is unknown before there are two."""
    n, place = left_out.repeats[number], left_out.places[number]
    more = replace(left_out, repeats=tuple(count + (i == number) for i, count in enumerate(left_out.repeats)))
    before = float(_half(left_out, [place])[0]) if n > 1 else math.nan
    return Candidate({level: place}, "repeat", before, float(_half(more, [place])[0]), left_out.residual / math.sqrt(n), cost)


def first_levels(places: Array, level: str, cost: float = 1.0) -> tuple[Candidate, ...]:
    """Return the middles of the gaps of two levels, of which nothing is known."""
    return (Candidate({level: float(places.mean())}, "between", math.nan, math.nan, math.nan, cost),)


def until(left_out: LeftOut, wanted: float) -> Until:
    """Return how many more levels bring every gap to `wanted`: `ceil((half/wanted)^(1/.75)) - 1` in each."""
    places = np.array(left_out.places)
    halves = _half(left_out, (places[:-1] + places[1:]) / 2)
    widest = float(halves.max())
    least = min(widest, NORMAL * left_out.residual)
    parts = np.maximum(np.ceil((halves / wanted) ** (1 / POWER) * (1 - 1e-9)), 1)
    more = int((parts - 1).sum()) if wanted >= least else None
    return Until(wanted, widest, more, least if more is None else float(_cut(halves, parts, left_out).max()))


def picture(left_out: LeftOut, level: str, first: Candidate) -> Picture:
    """Return half widths between levels over their range, now and with the first candidate measured."""
    left_out = replace(left_out, repeats=(1,) * len(left_out.repeats))
    places = np.array(left_out.places)
    x = np.linspace(places[0], places[-1], ON_A_LINE)
    before = _half(left_out, x)
    gap = np.searchsorted(places, x) == np.searchsorted(places, first.at[level])
    within = gap if first.kind == "between" else np.zeros(len(x), dtype=np.bool_)
    return Picture({level: x}, before, np.where(within, _cut(before, 2.0, left_out), before), {level: places})


def _half(left_out: LeftOut, at: Sequence[float] | Array) -> Array:
    return half_widths(left_out, np.asarray(at, dtype=float), INTERVAL)
