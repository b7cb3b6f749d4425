"""Levels: the values at which a quantity was held while others moved."""

from __future__ import annotations

import math

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray

BINS = 128
DENSE = 2.0  # times the density of evenly spread samples
STEADY = 0.05  # relative range below which there is a single level
TAIL = 0.001  # fraction of samples at each end that may be glitches


def find_levels(values: Array) -> Array:
    """Find the levels `(m,)`, ascending, at which a quantity dwells.

    The rule: over the range of the values (0.1 % of the samples at either end left out), count samples in 128 bins; where a bin, or
    the mean of three, holds more than twice what it would if the samples were spread evenly, the quantity dwells. Dense bins with
    fewer than two others between them are one level, so that levels closer than about 2 % of the range are not told apart. Ramps
    between holds are sparse and give no level. A level is the median of its samples, rounded to the power of ten below their
    standard deviation (149.73 +- 1.6 is 150), exact where they are all equal. Values which vary by less than 5 % of their size are
    one level.

    Empty where nothing dwells, as in a steady sweep.
    """
    low, high = np.quantile(values, [TAIL, 1 - TAIL], method="closest_observation")
    if high - low <= STEADY * max(abs(low), abs(high)):
        return np.array([_representative(values)])
    counts, edges = np.histogram(values, bins=BINS, range=(low, high))
    density = np.maximum(counts, np.convolve(counts, np.ones(3) / 3, mode="same"))
    dense = np.flatnonzero((density > DENSE * len(values) / BINS) & (counts > 0))
    runs = np.split(dense, np.flatnonzero(np.diff(dense) > 2) + 1)
    members = [values[(values >= edges[run[0]]) & (values <= edges[run[-1] + 1])] for run in runs if run.size]
    return np.unique([_representative(group) for group in members if group.size > 1])


def _representative(group: Array) -> float:
    spread, middle = float(np.std(group)), float(np.median(group))
    if spread <= 1e-12 * abs(middle):  # equal but for rounding in the mean
        return middle
    return round(middle, -math.floor(math.log10(spread)))


def default_within(levels: Array) -> float:
    """Return half the smallest distance between levels; infinite for a single one."""
    return float(np.diff(np.sort(levels)).min()) / 2 if len(levels) > 1 else math.inf


def match_levels(values: Array, levels: Array, within: float) -> IntArray:
    """Return for each value `(n,)` the index of the nearest level `(m,)`, -1 where none lies within `within`.

    Half way between two levels the lower level wins.
    """
    order = np.argsort(levels, kind="stable")
    middles = (levels[order][1:] + levels[order][:-1]) / 2
    nearest = order[np.searchsorted(middles, values, side="left")]
    # the tolerance lets a value that is exactly `within` away match, however it was rounded
    reach = within * (1 + 1e-9) + 1e-12 * np.abs(values)
    return np.where(np.abs(values - levels[nearest]) <= reach, nearest, -1)
