"""Fewer points for the eye, without hiding what is rare: no extreme sample is ever left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray

MOST_ON_A_LINE = 600
"""A line of more samples than this is drawn as the mean and the range over `STRETCHES` stretches of the axis."""

STRETCHES = 150
IN_A_STRETCH = 5


def envelope(y: Array, limit: int) -> IntArray:
    """Row numbers that draw a trace with at most `limit` points: the lowest and the highest sample of each of `limit // 2` runs.

    All rows where there are no more than `limit`.
    """
    n = len(y)
    if n <= limit:
        return np.arange(n)
    size = -(-n // (limit // 2))
    runs = -(-n // size)
    padded = np.concatenate([y, np.full(runs * size - n, np.nan)]).reshape(runs, size)
    missing = np.isnan(padded)
    first = np.arange(runs) * size
    lowest = first + np.argmin(np.where(missing, np.inf, padded), axis=1)
    highest = first + np.argmax(np.where(missing, -np.inf, padded), axis=1)
    return np.unique(np.concatenate([lowest, highest]))


def cloud(x: Array, y: Array, limit: int) -> IntArray:
    """Row numbers of at most `limit` dots: from each of `limit // 5` stretches of x, five samples of evenly spaced rank in y.

    All finite rows where there are no more than `limit`.
    """
    rows = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    if len(rows) <= limit:
        return rows
    stretch = _stretches(x[rows], max(limit // IN_A_STRETCH, 1))
    rows = rows[np.lexsort((y[rows], stretch))]
    ends = np.cumsum(np.bincount(stretch))
    chosen = [
        rows[start + i]
        for start, end in zip([0, *ends[:-1]], ends, strict=True)
        if end > start
        for i in spread(int(end - start), IN_A_STRETCH)
    ]
    return np.unique(np.array(chosen, dtype=np.int64))


@dataclass(frozen=True)
class Band:
    """A line over x with the range of the samples behind each of its points, each `(m,)`."""

    x: Array
    mean: Array
    low: Array
    high: Array

    @property
    def drawn_whole(self) -> bool:
        """True where every point of the line is a sample."""
        return self.low is self.mean


def band(x: Array, y: Array) -> Band:
    """`y` over sorted `x`, averaged over those equal stretches of x that hold any where there are more than `MOST_ON_A_LINE` samples."""
    if len(x) <= MOST_ON_A_LINE:
        return Band(x, y, y, y)
    rows = np.flatnonzero(np.isfinite(y))
    stretch = _stretches(x, STRETCHES)[rows]
    starts = np.flatnonzero(np.diff(stretch, prepend=-1))
    count = np.diff(starts, append=len(rows))
    x_mean, y_mean = (np.add.reduceat(values[rows], starts) / count for values in (x, y))
    return Band(x_mean, y_mean, np.minimum.reduceat(y[rows], starts), np.maximum.reduceat(y[rows], starts))


def _stretches(x: Array, count: int) -> IntArray:
    """Return number, from 0, of the stretch that each sample lies in."""
    low, high = float(x.min()), float(x.max())
    if high <= low:
        return np.zeros(len(x), dtype=np.int64)
    return np.clip(((x - low) * (count / (high - low))).astype(np.int64), 0, count - 1)


def spread(count: int, limit: int) -> list[int]:
    """At most `limit` of `count` numbers, evenly spread, the first and the last among them."""
    if count <= limit:
        return list(range(count))
    return sorted({int(i) for i in np.linspace(0, count - 1, limit).round()})
