"""Process time stamps: find repeated stamps, gaps and resets of the clock, resample records, and
join logs with different clocks.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from mapmore_cli.domain.arrays import (
    Array,
    BoolArray,
    Columns,
    IntArray,
    give_back,
    in_blocks,
    picked,
)

T = TypeVar("T", bound=np.ndarray[Any, Any])


def correlation(first: Array, second: Array) -> float:
    """Return the correlation of two signals, (n,) each; 0 if one of them is constant. The signals
    are scaled first, because squares of values such as 1e-300 would underflow.
    """
    ranges = np.ptp(first), np.ptp(second)
    if not all(ranges):
        return 0.0
    return float(
        np.corrcoef((first - first[0]) / ranges[0], (second - second[0]) / ranges[1])[0, 1]
    )


def average_repeated(time: Array, columns: Columns) -> tuple[Array, dict[str, Array]]:
    """Return one sample for each different stamp, with the mean of every quantity over the samples
    that share the stamp.

    `time`, `(n,)`, never decreases. The results have the shape `(m,)`, where m is the number of
    different stamps.
    """
    stamps, first, counts = np.unique(time, return_index=True, return_counts=True)
    return stamps, {
        name: np.add.reduceat(values, first) / counts for name, values in columns.items()
    }


def spread_repeated(time: Array) -> Array:
    """Return the stamps, (n,), with equal stamps spread evenly up to the next different stamp.

    Samples that share the last stamp are spread over a step of the same length as the previous
    step. If all stamps are equal, they are unchanged.
    """
    stamps, place, counts = np.unique(time, return_inverse=True, return_counts=True)
    if len(stamps) == 1:
        return time
    steps = np.diff(stamps, append=2 * stamps[-1] - stamps[-2])
    first = np.cumsum(counts) - counts
    return time + steps[place] * (np.arange(len(time)) - first[place]) / counts[place]


# largest deviation of evenly spaced samples from an even grid, as a fraction of a time step
UNEVEN = 1e-3

MANY = 20_000  # number of samples that represent a long record if not all samples are needed


def even_share(values: T, most: int = MANY) -> T:
    """Return at most `most` rows of a record, evenly spread from the first to the last."""
    if len(values) <= most:
        return values
    share: T = picked(values, np.linspace(0, len(values) - 1, most).round().astype(int))
    return share


ROUNDING = 1e-9  # relative tolerance, so that a step of exactly the limit is no gap


@dataclass(frozen=True)
class Gaps:
    """Gaps in a record of n samples: `after`, (g,), is the index of the sample before each gap, and
    `lengths`, (g,), are the time steps.

    `samples_missing` is the number of samples that the gaps lack, at the median step of the record.
    """

    after: IntArray
    lengths: Array
    samples_missing: int

    def __len__(self) -> int:
        return len(self.after)


def find_gaps(time: Array, longer_than: float) -> Gaps:
    """Return the gaps between the stamps `time`, `(n,)`, that are longer than `longer_than`. Both
    have the same unit, and the stamps never decrease.
    """
    largest = float(np.abs(time[[0, -1]]).max()) if len(time) else 0.0
    limit = longer_than + ROUNDING * longer_than + 4 * np.finfo(float).eps * largest
    after = steps_where(time, lambda steps: steps > limit)
    lengths = time[after + 1] - time[after]
    usual = typical_step(time)
    missing = int(np.round(lengths / usual - 1).clip(0).sum())
    return Gaps(after, lengths, missing)


# number of parts of a long record, and number of samples per part, for estimating the time step
PARTS = 8
PART = 1 << 17


def even_parts(n: int) -> list[slice]:
    """Return evenly spread parts of a record of n samples; a short record is a single part."""
    if n <= PARTS * PART:
        return [slice(0, n)]
    return [slice(start, start + PART) for start in np.linspace(0, n - PART, PARTS).astype(int)]


def typical_step(time: Array) -> float:
    """Return the median of the positive time steps, computed from at most a million samples; zero
    if the time is constant.
    """
    steps = np.concatenate([np.diff(time[part]) for part in even_parts(len(time))])
    positive = steps[steps > 0]
    return float(np.median(positive)) if len(positive) else 0.0


def find_resets(time: Array) -> IntArray:
    """Return the indices of the samples after which the time runs backwards."""
    return steps_where(time, lambda steps: steps < 0)


def find_repeats(time: Array) -> IntArray:
    """Return the indices of the samples that have the same stamp as the next sample."""
    return steps_where(time, lambda steps: steps == 0)


def steps_where(time: Array, condition: Callable[[Array], BoolArray]) -> IntArray:
    """Return the indices of the samples after which the time step satisfies the `condition`."""
    places: list[IntArray] = [np.zeros(0, dtype=np.int64)]
    start = 0
    for (block,) in in_blocks(time, overlap=1):
        steps = np.diff(block)
        places.append(start + np.flatnonzero(condition(steps)))
        start += len(steps)
    return np.concatenate(places)


def cut_after(n: int, breaks: IntArray) -> list[slice]:
    """Cut n samples after each index in `breaks`, and return the pieces. The indices are in
    ascending order.
    """
    edges = [0, *(int(place) + 1 for place in breaks), n]
    return [slice(begin, end) for begin, end in pairwise(edges)]


DECIMATION = 1.5  # if a new step contains at least this many samples, they are averaged
# a stamp nearer to the edge of a block than this fraction of a step is treated as on the edge
ON_EDGE = 1e-6


def resample(time: Array, columns: Columns, step: float) -> tuple[Array, dict[str, Array]]:
    """Resample a record without gaps. Return m stamps that are `step` apart, shape (m,), and every
    quantity at these stamps, shape (m,). If several samples are averaged and the record is shorter
    than a step, m is 0.

    If a step contains several samples, they are replaced by their mean, with the stamp of their
    middle. This average has no delay, and it attenuates frequencies above the new sampling rate.
    Sample i belongs to block `floor((t_i - t_0)/step)`; with `dt` the median step of the record,
    block k is stamped `t_0 + k step + (step - dt)/2`, the mean of the stamps of an evenly sampled
    block. The block means are interpolated linearly to these stamps, so that jitter of the stamps
    does no harm and straight lines stay straight. The last block is left out if the record does not
    fill it. If a step holds one sample or less, the record is interpolated linearly at `t_0 + k
    step`.

    - `time`: `(n,)`, increasing, in the unit of `step`; `columns`: each `(n,)`; a `time` among them
      is left out.
    """
    dt = typical_step(time)
    span = time[-1] - time[0]
    values = {name: column for name, column in columns.items() if name != "time"}
    if step < DECIMATION * dt or dt == 0:
        stamps = time[0] + step * np.arange(int(span / step + ON_EDGE) + 1)
        return stamps, {name: np.interp(stamps, time, column) for name, column in values.items()}
    blocks = int((span + dt) / step + ON_EDGE)
    stamps = time[0] + step * np.arange(blocks) + (step - dt) / 2
    if blocks == 0:
        return stamps, {name: np.zeros(0) for name in values}
    block = np.floor((time - time[0]) / step + ON_EDGE).astype(np.int64)
    first = np.flatnonzero(np.diff(block, prepend=-1))
    counts = np.diff(first, append=len(time))
    middle = np.add.reduceat(time, first) / counts
    return stamps, {
        name: np.interp(stamps, middle, np.add.reduceat(column, first) / counts)
        for name, column in values.items()
    }


def align(stamps: Array, time: Array, values: Array, max_gap: float | None) -> Array:
    """Interpolate a log linearly at `stamps`, `(n,)`, which may be in any order. The log has
    `values`, `(m,)`, at the increasing stamps `time`, `(m,)`.

    The result is NaN for a stamp that is NaN or lies outside the log. It is also NaN between two
    samples of the log that are more than `max_gap` apart (None allows any distance). At a stamp of
    the log, the result is the logged value.
    """
    after = np.searchsorted(time, stamps, side="left").clip(0, len(time) - 1)
    before = np.where(time[after] == stamps, after, (after - 1).clip(0))
    aligned: Array = np.interp(stamps, time, values)
    with np.errstate(invalid="ignore"):
        outside = ~((stamps >= time[0]) & (stamps <= time[-1]))
    too_far = (
        np.zeros(len(stamps), dtype=np.bool_)
        if max_gap is None
        else time[after] - time[before] > max_gap * (1 + ROUNDING)
    )
    aligned[outside | too_far] = np.nan
    return aligned


def longest_ascent(time: Array) -> BoolArray:
    """Return a mask, (n,), of the longest subsequence of stamps that never decreases. As few stamps
    as possible are left out.

    The algorithm is patience sorting, which needs O(n log n) operations (M. L. Fredman, Discrete
    Math. 11 (1975) 29).
    """
    ends: list[float] = []  # for each length of a subsequence, its smallest possible last stamp
    at: list[int] = []
    before = np.full(len(time), -1)
    for place, stamp in enumerate(time.tolist()):
        length = bisect_right(ends, stamp)
        before[place] = at[length - 1] if length else -1
        ends[length : length + 1], at[length : length + 1] = [stamp], [place]
    kept = np.zeros(len(time), dtype=np.bool_)
    place = at[-1] if at else -1
    while place >= 0:
        kept[place], place = True, int(before[place])
    return kept


def envelope(y: Array, limit: int, less: Array | None = None) -> IntArray:
    """Return the row numbers of at most `limit` samples with which a figure shows a long curve.
    They are the lowest and the highest sample in each of `limit // 2` consecutive parts. With
    `less`, the lowest and the highest values of `y - less` are used.

    If there are at most `limit` rows, all rows are returned.
    """
    if len(y) <= limit:
        return np.arange(len(y))
    rows: list[int] = []
    edges = np.linspace(0, len(y), limit // 2 + 1).astype(int)
    for number, (start, end) in enumerate(pairwise(edges.tolist())):
        run = y[start:end] if less is None else y[start:end] - less[start:end]
        known = np.flatnonzero(~np.isnan(run))
        if len(known):
            rows += [start + int(known[place(run[known])]) for place in (np.argmin, np.argmax)]
        else:  # a gap in the curve remains a gap
            rows.append(start)
        if number % 100 == 0:
            for column in (y, less):
                give_back(column)
    return np.unique(rows)
