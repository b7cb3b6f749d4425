"""Find the levels at which a quantity was held constant. In a step response, find the plateau
between rise and fall (M2 section 3, eq 1).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray, extremes
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Curve

BINS = 128


def find_levels(values: Array) -> Array:
    """Return the levels at which a quantity was held constant, `(m,)`, in ascending order.

    The samples are counted in 128 bins over the range of the values, without 0.1 % of the samples
    at either end. The quantity dwells in a bin if the bin, or the mean of the bin and its two
    neighbours, holds more than twice the number of samples that an even spread would give. Such
    bins with fewer than two other bins between them are one level, so that levels closer than about
    2 % of the range are not distinguished. Ramps between holds are sparse and give no level. A
    level is the median of its samples, rounded to the power of ten below their standard deviation
    (149.73 +- 1.6 gives 150), and exact if they are all equal. If the values vary by at most 5 % of
    the largest magnitude, there is one level.

    The result is empty if the quantity never dwells, for example in a steady sweep.
    """
    low, high = np.quantile(values, [0.001, 0.999], method="closest_observation")
    # Values that vary little have one level.
    # For an extremely small range, the bins of the histogram would have no width.
    if high - low <= max(0.05 * max(-low, high), BINS * np.finfo(float).tiny):
        return np.array([_representative(values)])
    counts, edges = np.histogram(values, bins=BINS, range=(low, high))
    density = np.maximum(counts, np.convolve(counts, np.ones(3) / 3, mode="same"))
    dense = np.flatnonzero((density > 2 * len(values) / BINS) & (counts > 0))
    runs = np.split(dense, np.flatnonzero(np.diff(dense) > 2) + 1)
    members = [
        values[(values >= edges[run[0]]) & (values <= edges[run[-1] + 1])]
        for run in runs
        if run.size
    ]
    return np.unique([_representative(group) for group in members if group.size > 1])


def _representative(group: Array) -> float:
    spread, middle = float(np.std(group)), float(np.median(group))
    # all values are equal, apart from rounding errors
    if spread <= 1e-12 * abs(middle):
        return middle
    return round(middle, -math.floor(math.log10(spread)))


def default_within(levels: Array) -> float:
    """Return half the smallest distance between two levels; infinity if there is only one level."""
    return float(np.diff(np.sort(levels)).min()) / 2 if len(levels) > 1 else math.inf


def match_levels(values: Array, levels: Array, within: float) -> IntArray:
    """Return for each value, (n,), the index of the nearest level, (m,), or -1 if no level lies
    within `within`.

    For a value in the middle between two levels, the result is the index of the lower level.
    """
    order = np.argsort(levels, kind="stable")
    middles = (levels[order][1:] + levels[order][:-1]) / 2
    nearest = order[np.searchsorted(middles, values, side="left")]
    # a tolerance is added, because a value at exactly the distance `within` has a rounding error
    reach = within * (1 + 1e-9) + 1e-12 * np.abs(values)
    return np.where(np.abs(values - levels[nearest]) <= reach, nearest, -1)


# a signal has settled when it stays within this fraction of its range around its final value
BAND = 0.05
RISEN = 0.9  # a rise of the pressure ends when it has reached this fraction of its range
NOISE_SPANS = 20  # the pressure has risen only if its range is above this multiple of the noise
# shortest plateau as a fraction of the rise time, so that the top of a triangle is no plateau
SHORTEST = 0.5

REMEDY = "give the plateau, for example `plateau: [2 s, 3 s]`, or leave the recording out"


def find_plateau(time: Array, pressure: Array, others: Mapping[str, Array]) -> tuple[float, float]:
    """Return the times at which the plateau of a step response starts and ends.

    On the plateau, the pressure and all `others` (for example the strain) stay in bands around
    their final values. The plateau begins when the last of these signals has settled, and ends when
    the first of them leaves its band. The final value of a signal is its median over the later half
    of the high pressure.

    - `pressure`, `others`: `(n,)` each; the pressure rises once and may fall again.

    Raises DataError if the pressure never rises, or if no plateau follows the rise.
    """
    low, high_end = extremes(pressure)
    upper = pressure > (low + high_end) / 2
    noise = float(np.median(np.abs(np.diff(pressure)))) if len(pressure) > 1 else 0.0
    # Medians are used, because the pressure overshoots after its rise and after its fall.
    base = float(np.median(pressure[~upper]))
    span = float(np.median(pressure[upper])) - base if upper.any() else 0.0
    if span <= NOISE_SPANS * noise:
        raise DataError(
            f"the pressure never rises; it stays between {low:g} and {high_end:g}", REMEDY
        )
    high = np.flatnonzero(pressure >= base + RISEN * span)
    later = high[len(high) // 2 :]
    inside = _settled(pressure, later, span)
    for signal in others.values():
        inside &= _settled(signal, later, float(np.ptp(signal)))
    end = later[0] + _first(~inside[later[0] :]) - 1
    start = _last(~inside[: end + 1]) + 1
    low_end = max(_last(pressure[: high[0]] < base + (1 - RISEN) * span), 0)
    rise = time[high[0]] - time[low_end]
    if start >= end or time[end] - time[start] < SHORTEST * rise:
        rest = max(0.0, float(time[end] - time[min(start, end)]))
        names = " and ".join(["pressure", *others])
        raise DataError(
            f"no plateau was found: {names} must stay constant for {rest:.3g} s after a "
            f"rise that takes {rise:.3g} s",
            REMEDY,
        )
    return float(time[start]), float(time[end])


def _settled(signal: Array, later: IntArray, span: float) -> BoolArray:
    """Return a mask that is True if a signal differs from its final value by at most `BAND * span`.
    The final value is the median of the samples with the indices `later`.
    """
    return np.abs(signal - np.median(signal[later])) <= BAND * span


def _first(mask: BoolArray) -> int:
    """Return the index of the first True in a mask; its length if no element is True."""
    return int(np.argmax(np.append(mask, True)))


def _last(mask: BoolArray) -> int:
    """Return the index of the last True in a mask; -1 if no element is True."""
    return len(mask) - 1 - _first(mask[::-1])


def without_steady_state(component: Array, plateau: BoolArray) -> Array:
    """Return a component of the force minus its mean over the plateau, `F_d = F_d' - F_d,ssv` (M2
    eq 1). The subtraction removes the error that the static model has at rest.
    """
    return component - float(component[plateau].mean())


def damping_component(rest: Array, curve: Curve) -> Array:
    """Return the residual of a static model minus its mean over the plateau of each recording of
    the curve, shape (n,). This is `F_d = F_d' - F_d,ssv` (M2 eq 1).
    """
    if curve.at_rest is None:
        return rest
    at_rest = curve.at_rest
    return curve.together(
        [without_steady_state(rest[rows], at_rest[rows]) for rows in curve.stretches]
    )
