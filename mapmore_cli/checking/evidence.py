"""What the numbers of recordings show: slack, rest, one signal in two units, what was set, levels
that tell of each other, and spikes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from mapmore_cli.domain.arrays import Array, IntArray, extremes
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Curve, Recording
from mapmore_cli.modelling.signals.cycles import bin_means
from mapmore_cli.modelling.signals.rates import rate
from mapmore_cli.modelling.signals.sampling import correlation, even_share
from mapmore_cli.spec.units import convert

GROUPS = 8  # of strain, where it is not held at fewer values
BINS = 24  # of pressure
FEWEST_BINS = 8  # that must hold samples: at a few held pressures no threshold can be seen
SLACK = 0.05  # of the largest force
WIDTH = 0.15  # of the pressure range, that a foot has at least
BEND = 3.0  # times the slope of the foot, which the force must rise by beyond it


def find_slack_foot(pressure: Array, strain: Array, force: Array) -> tuple[Array, Array] | None:
    """Return strains `(m,)` and threshold pressures `(m,)` of the slack foot of samples `(n,)` at
    many pressures; None where there is none.

    Samples are grouped by strain and averaged in bins of pressure. A group has a foot where the
    force stays within 5 % of its largest value from the lowest pressure over at least 15 % of the
    range, and rises three times as steeply beyond. (A plain formula that is linear in pressure
    crosses this band at a constant slope.) There is a foot where two groups have one and the
    threshold rises with strain.
    """
    span, full = float(np.ptp(pressure)), float(np.max(np.abs(force), initial=0.0))
    if not span or not full:
        return None
    feet = []
    for middle, members in _groups_of(strain):
        p, means = bin_means(
            (pressure[members] - pressure.min()) / span,
            {"f": force[members] / full},
            np.linspace(0, 1, BINS + 1),
        )
        end = _end_of_foot(p, means["f"])
        if end is not None:
            feet.append((middle, pressure.min() + span * end))
    if len(feet) < 2:
        return None
    at, threshold = np.array(feet).T
    rises = threshold[-1] > threshold[0] and correlation(at, threshold) > 0
    return (at, threshold) if rises else None


def _groups_of(strain: Array) -> list[tuple[float, IntArray]]:
    """Return the middle of each group of strains in ascending order, with the rows that belong to
    it.
    """
    low, span = float(strain.min()), float(np.ptp(strain)) or 1.0
    # strains within half a per cent of the range are one
    place = np.round((strain - low) / span * 200).astype(int)
    if len(np.unique(place)) > GROUPS:
        place = np.minimum((strain - low) / span * GROUPS, GROUPS - 1).astype(int)
    return [
        (float(np.median(strain[place == group])), np.flatnonzero(place == group))
        for group in np.unique(place)
    ]


def _end_of_foot(p: Array, f: Array) -> float | None:
    """Pressure at which the foot ends, given the binned force of one group; both relative to their
    ranges.
    """
    taut = np.flatnonzero(np.abs(f) > SLACK)
    if len(p) < FEWEST_BINS or not taut.size:
        return None
    end = int(taut[0]) - 1
    if end < 1 or p[end] - p[0] < WIDTH:
        return None
    slope_of_foot = abs(f[end] - f[0]) / (p[end] - p[0])
    slope_beyond = (f[-1] - f[end]) / (p[-1] - p[end])
    return float(p[end]) if slope_beyond > BEND * slope_of_foot else None


SLOW = 0.04  # of the pressure range per second
SHORTEST = 0.1  # s, width of the window in which the rate is found
SAMPLES = 8  # that the window must hold
MIDDLE = (0.1, 0.9)  # of the pressure range


@dataclass(frozen=True)
class Settling:
    """How a pressure settles.

    A sample counts as settled below the rate `limit` per second, a round number, found in a
    `window` in s. That is a `share` of all samples, and `share_between` of those in the middle of
    the pressure range: staircases rest there, and sweeps do not.
    """

    limit: float
    share: float
    share_between: float
    window: float


def settling(recordings: Sequence[Recording], unit: str = "s") -> Settling | None:
    """Find which share of the samples is settled, of recordings with a pressure and a time in
    `unit`.

    None where the pressure does not move, or the time stamps do not let a rate be found.
    """
    records = [
        (convert(one.columns["time"], unit, "s"), one.columns["pressure"])
        for one in recordings
        if one.rows_kept
    ]
    pressures = np.concatenate([pressure for _, pressure in records])
    steps = np.concatenate([np.diff(time) for time, _ in records])
    if not np.ptp(pressures) or not (steps > 0).any() or (steps < 0).any():
        return None
    window = max(SHORTEST, two_digits(SAMPLES * float(np.mean(steps))))
    limit = two_digits(SLOW * float(np.ptp(pressures)))
    try:
        rates = np.concatenate(
            [rate(time, pressure, window, order=2) for time, pressure in records]
        )
    except DataError:  # gaps that are wider than the window
        return None
    settled = np.abs(rates) < limit
    low, high = (pressures.min() + place * np.ptp(pressures) for place in MIDDLE)
    between = settled[(pressures > low) & (pressures < high)]
    return Settling(
        limit, float(np.mean(settled)), float(np.mean(between)) if between.size else 0.0, window
    )


def two_digits(value: float) -> float:
    """Return a positive number, rounded to two digits, as a person would choose it."""
    return float(f"{round(value, 1 - math.floor(math.log10(value))):.6g}")


# One signal in two units
# --------------------------------------------------------------------------------------------------

SAME = 0.9999  # correlation, from which two columns are one signal
FEWEST_SAME = 30  # samples, below which a straight line may be chance


def same_signals(columns: Sequence[Array]) -> list[list[int]]:
    """Return the places of columns `(n,)` that are one another times a constant, plus one, a list
    for each repeated signal.

    Columns of different lengths, as where one lacks values, are not compared.
    """
    families: list[list[int]] = []
    shares: dict[int, Array] = {}
    for place, column in enumerate(columns):
        if len(column) < FEWEST_SAME or not np.ptp(extremes(column)):
            continue
        shares[place] = even_share(column)
        same = [one for one in families if len(columns[one[0]]) == len(column)]
        alike = [one for one in same if abs(correlation(shares[one[0]], shares[place])) >= SAME]
        alike[0].append(place) if alike else families.append([place])
    return [family for family in families if len(family) > 1]


# What was set
# --------------------------------------------------------------------------------------------------

# of the steps from sample to sample, that are one step up or down where a quantity was set
EVEN = 0.8
ALIKE = 0.02  # of the step, that these may differ


def set_in_steps(records: Sequence[Array]) -> float | None:
    """Return the step by which a quantity was set from sample to sample, given `(n,)` of each
    recording; None where it was measured.

    A logger's resolution makes values even as well, but not the way from one sample to the next.
    """
    steps = np.abs(np.concatenate([np.empty(0), *(np.diff(values) for values in records)]))
    steps = steps[steps > 0]
    if steps.size < FEWEST_BINS:
        return None
    step = float(np.median(steps))
    return step if np.mean(np.abs(steps - step) <= ALIKE * step) >= EVEN else None


# Levels that tell of each other
# ----------------------------------------------------------------------------------------------

PLACES = 100  # along a curve, at which levels are compared
FEWEST_LEVELS = 4


def neighbourhood(curves: Sequence[Curve], along: str, target: str) -> tuple[float, float] | None:
    """Leave each inner level out, and return the RMSE there of what lies between its neighbours,
    and of the mean of all others, relative to the largest value; None with fewer than four levels.

    Each curve is averaged in 100 bins and interpolated between them, and held beyond its ends;
    there is no model in it.
    """
    courses = {}
    for curve in curves:
        x, y = curve.columns[along], curve.columns[target]
        edges = np.linspace(x.min(), x.max(), PLACES + 1)
        places, means = bin_means(x, {"y": y}, edges)
        courses[curve.level] = places, means["y"]
    levels = sorted(level for level in courses if level is not None)
    largest = max((float(np.abs(y).max()) for _, y in courses.values()), default=0.0)
    if len(levels) < FEWEST_LEVELS or not largest:
        return None
    near, far = [], []
    for i in range(1, len(levels) - 1):
        x, y = courses[levels[i]]
        said = np.array([np.interp(x, *courses[level]) for level in levels])
        part = (levels[i] - levels[i - 1]) / (levels[i + 1] - levels[i - 1])
        near.append((1 - part) * said[i - 1] + part * said[i + 1] - y)
        far.append(np.delete(said, i, axis=0).mean(axis=0) - y)
    between, mean = (
        float(np.sqrt(np.mean(np.concatenate(off) ** 2))) / largest for off in (near, far)
    )
    return between, mean


# Single samples
# --------------------------------------------------------------------------------------------------

FEWEST_IN_A_ROW = 30  # samples: a table of fewer has no neighbours
AROUND = 12  # samples on each side, whose scatter a spike stands out of
STANDS_OUT = 10.0  # times this scatter (by the median, as of a normal distribution)
JUMPS = 2.0  # times any other change from sample to sample
APART = 0.25  # of its height, that the samples before and after a spike differ at most
FAR_OUT = 0.2  # of the range of all other samples


def spikes(values: Array) -> IntArray:
    """Return the numbers of the samples of a record, `(n,)`, that stand alone far from their
    neighbours.

    Such a sample lies to one side of both neighbours, which agree, ten times further than the
    scatter around it, and at least twice as far as the record changes from one sample to the next
    anywhere else: steps, and signals of two values, have no such sample.
    """
    none = np.zeros(0, dtype=np.int64)
    if len(values) < FEWEST_IN_A_ROW:
        return none
    height = np.abs(values - median_filter(values, size=3, mode="nearest"))
    apart = np.abs(np.pad(values[2:] - values[:-2], 1))
    lone = np.flatnonzero(
        (height > 0) & (apart <= APART * height) & (height >= height.max() / (2 * JUMPS))
    )
    span = float(np.ptp(np.delete(values, lone))) if lone.size < len(values) / AROUND else 0.0
    if span == 0:  # nothing says what is far
        return none
    steps = np.delete(np.abs(np.diff(values)), np.union1d(lone - 1, lone))
    usual = max(JUMPS * float(steps.max(initial=0.0)), FAR_OUT * span)
    return np.array(
        [
            one
            for one in lone[~np.isin(lone, [lone - 1, lone + 1])]
            if height[one] > usual and height[one] > STANDS_OUT * _scatter(values, lone, one)
        ],
        dtype=np.int64,
    )


def _scatter(values: Array, lone: IntArray, place: int) -> float:
    """Return the standard deviation, by the median, of the samples around one about a line through
    their neighbours.
    """
    near = np.arange(max(0, place - AROUND), min(len(values), place + AROUND + 1))
    around = values[np.setdiff1d(near, lone)]
    if len(around) < AROUND:
        return math.inf
    return 1.4826 * float(np.median(np.abs(around[1:-1] - (around[:-2] + around[2:]) / 2)))
