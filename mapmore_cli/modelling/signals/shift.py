"""Estimate the time shift between the clocks of two logs, by cross-correlation of two records of
the same quantity or of the same event.

Both records are interpolated on a common even grid. They are converted to changes, `u[i] =
mean(y[i..i+w]) - mean(y[i-w..i])`, so that slow drift has no influence and noise is averaged over w
samples. The correlation r(lag) uses the samples in which the records overlap. Among several widths
w, the width is used whose peak stands out most from the noise. The ratio of the best to the second
best peak is not used for this choice, because the second peak may be small by chance at one of the
widths. A peak is certain if noise would not cause it and no other peak comes near it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.signals.sampling import typical_step

# possible numbers w of samples in the means before and after each place
WIDTHS = (1, 2, 4, 8, 16, 32, 64)
# smallest overlap of both records, as a fraction of the shorter record
LEAST_OVERLAP = 0.5
# smallest fraction of the squared changes of each record that must lie in the overlap
LEAST_EVENTS = 0.3
RATIO = 1.15  # smallest ratio of the best peak to the second best peak
# smallest Fisher's z of the best peak, in standard deviations of noise
# The limit is high because noise has a high peak too, if it is the highest of thousands of lags.
SIGMAS = 7.0
MOST = 2_000_000  # largest number of grid points of the longer record
FEWEST = 8  # smallest number of samples of a record whose shift is estimated


@dataclass(frozen=True)
class Shift:
    """Time that must be added to the clock of the second log, with half the width of its interval.

    - `value`, `half_width`: in the unit of the stamps. The interval contains the true shift with a
      probability of 95 %. The half width combines the error by noise and half a time step of each
      record, as the root of the sum of squares.
    - `step`: typical time step of the record with the longer steps.
    - `correlation`: correlation of the changes in both records at this shift; negative if one falls
      when the other rises.
    - `next_best`: absolute correlation at the second best peak, and `rival`: the shift there. They
      are 0 and None if there is only one peak.
    - `sigmas`: height of the peak above the noise, in standard deviations.
    """

    value: float
    half_width: float
    step: float
    correlation: float
    next_best: float
    rival: float | None
    sigmas: float

    @property
    def ratio(self) -> float:
        """Ratio of the height of the best peak to the height of the second best peak; infinite if
        there is only one peak.
        """
        return abs(self.correlation) / self.next_best if self.next_best > 0 else math.inf

    @property
    def ambiguous(self) -> bool:
        """Return True if the correlation at another shift is nearly as high as at this shift."""
        return self.ratio < RATIO

    @property
    def lost_in_noise(self) -> bool:
        """Return True if noise alone could cause a peak of this height."""
        return self.sigmas < SIGMAS


def find_shift(
    time: Array,
    first: Array,
    other_time: Array,
    second: Array,
    *,
    same_sign: bool = False,
) -> Shift | None:
    """Return the shift of the clock of a second log; None if nothing changes in one of the records,
    or if the records overlap at no shift.

    - `time`, `first`: stamps, `(n,)`, strictly increasing, and values, `(n,)`, of the first log.
      `other_time`, `second`: those of the second log, `(m,)`.
    - `same_sign`: True if both records must rise at the same time. If it is False, one record may
      fall while the other rises.
    """
    if min(len(time), len(other_time)) < FEWEST:
        return None
    steps = typical_step(time), typical_step(other_time)
    step = max(min(steps), max(float(np.ptp(time)), float(np.ptp(other_time))) / MOST)
    first_even, second_even = (
        np.interp(np.arange(t[0], t[-1], step), t, y)
        for t, y in ((time, first), (other_time, second))
    )
    offset = float(time[0] - other_time[0])
    peaks = [
        peak
        for width in WIDTHS
        if (peak := _peak(first_even, second_even, width, offset, step, same_sign)) is not None
    ]
    if not peaks:
        return None
    best = max(peaks, key=lambda peak: peak.sigmas)
    # a jump may lie anywhere between two samples, so half a time step is added to the half width
    half_width = math.hypot(best.half_width, 0.5 * sum(steps))
    return replace(best, half_width=half_width, step=max(steps))


def _peak(
    first: Array,
    second: Array,
    width: int,
    offset: float,
    step: float,
    same_sign: bool,
) -> Shift | None:
    """Return the best shift for changes over `width` samples; None if the records are too short for
    this width, or if no correlation is positive.
    """
    if min(len(first), len(second)) <= 4 * width:
        return None
    u, v = changes(first, width), changes(second, width)
    r, lags, overlap = correlation_by_lag(u, v)
    shifts = offset + step * lags
    size = r.clip(0.0, None) if same_sign else np.abs(r)
    top = int(np.argmax(size))
    if size[top] == 0:
        return None
    # a maximum at the first or the last lag is no peak, because the correlation may rise beyond it
    rises_on = not 0 < top < len(r) - 1 or r[top - 1] == 0.0 or r[top + 1] == 0.0
    # on both sides, the peak ends at the first lag at which the correlation rises again
    before, after = (np.flatnonzero(np.diff(side) > 0) for side in (size[top::-1], size[top:]))
    below = top - int(before[0]) if len(before) else 0
    above = top + int(after[0]) if len(after) else len(size) - 1
    outside = size.copy()
    outside[below : above + 1] = 0.0
    rival = int(np.argmax(outside))
    best = min(float(size[top]), 1 - 1e-12)
    independent = max(float(overlap[top]) / (2 * width), 4.0)
    sigmas = 0.0 if rises_on else math.atanh(best) * math.sqrt(independent - 3)
    place = top + _vertex(size, top)
    next_best = float(outside[rival])
    return Shift(
        offset + step * float(lags[0] + place),
        step * _half_width(u, v, int(lags[top])),
        step,
        float(r[top]),
        next_best,
        float(shifts[rival]) if next_best > 0 else None,
        sigmas,
    )


def changes(y: Array, width: int) -> Array:
    """Return the changes of y, (n,): at each place, the mean of the following `width` samples minus
    the mean of the preceding `width` samples, shape (n - 2 width + 1,).
    """
    total = np.concatenate([[0.0], np.cumsum(y - y.mean())])
    means = (total[width:] - total[:-width]) / width
    differences: Array = means[width:] - means[:-width]
    return differences


def correlation_by_lag(u: Array, v: Array) -> tuple[Array, Array, Array]:
    """Return Pearson's correlation r of `u[i + lag]` and `v[i]` for every lag, the lags, and the
    numbers of overlapping samples, shape (k,) each.

    r is set to zero for lags at which the overlap is too short, or contains too small a part of the
    changes of one of the records.
    """
    # imported here, because the import is slow and few studies need it
    from scipy.signal import correlate

    n, m = len(u), len(v)
    # computes `sum_i a[i + lag] b[i]` for the lags -(m - 1) to n - 1
    sums = partial(correlate, method="fft")
    ones_u, ones_v = np.ones(n), np.ones(m)
    count = np.rint(sums(ones_u, ones_v))
    u_sum, v_sum = sums(u, ones_v), sums(ones_u, v)
    u_squares, v_squares = sums(u * u, ones_v), sums(ones_u, v * v)
    covariance = sums(u, v) - u_sum * v_sum / count
    spread = (u_squares - u_sum**2 / count) * (v_squares - v_sum**2 / count)
    speaks = (u_squares >= LEAST_EVENTS * np.sum(u * u)) & (
        v_squares >= LEAST_EVENTS * np.sum(v * v)
    )
    speaks &= (count >= LEAST_OVERLAP * min(n, m)) & (
        spread > 1e-18 * np.sum(u * u) * np.sum(v * v)
    )
    r = np.zeros(len(count))
    r[speaks] = covariance[speaks] / np.sqrt(spread[speaks])
    return r.clip(-1.0, 1.0), np.arange(-(m - 1.0), n), count


def _vertex(size: Array, top: int) -> float:
    """Return the place of the maximum of a parabola through the peak and its two neighbours, in
    lags relative to the peak.
    """
    if not 0 < top < len(size) - 1:
        return 0.0
    left, middle, right = (float(value) for value in size[top - 1 : top + 2])
    bend = left - 2 * middle + right
    return 0.0 if bend >= 0 else 0.5 * (left - right) / bend


def _half_width(u: Array, v: Array, lag: int) -> float:
    """Return half the width of the 95 % interval of the best lag between the changes `u` and `v`,
    in steps of the grid; infinite if the slopes of `u` and `v` have no positive correlation.

    Both are scaled to the same standard deviation. Let s be their mean and e their difference, so
    that `u = s + e/2` and `v = s - e/2`. Let s' be the slope of s. The error of the lag is `sum
    s'[i] e[i] / sum u'[i] v'[i]`. The values of e are correlated, because neighbouring changes are
    computed from the same samples, and because noise may be slow. Therefore, the numerator has the
    variance `sum_k R(k) A(k)`, with the autocovariance R of e and `A(k) = sum_i s'[i] s'[i + k]`.
    In the frequency domain, this variance is a sum of products. If a few of these products are much
    larger than the others, the variance is known less well. The effective number of products is
    therefore used as the degrees of freedom of Student's t.
    """
    # imported here, because the import is slow and few studies need it
    from scipy.fft import next_fast_len, rfft
    from scipy.special import stdtrit

    n = min(len(u), len(v) + lag) - max(lag, 0)
    first, second = u[max(lag, 0) :][:n], v[max(-lag, 0) :][:n]
    first, second = first - first.mean(), second - second.mean()
    second = second * math.copysign(math.sqrt(first @ first / (second @ second)), first @ second)
    steepness = float(np.diff(first) @ np.diff(second))
    if steepness <= 0:
        return math.inf
    size = next_fast_len(2 * n)  # zeros are added, so that the sums are not circular
    slope, rest = rfft(np.gradient(first + second) / 2, size), rfft(first - second, size)
    products = np.abs(slope * rest) ** 2
    total = float(np.sum(products))
    if total == 0:
        return 0.0
    freedom = total**2 / float(products @ products)
    return float(stdtrit(freedom, 0.975)) * math.sqrt(2 * total / (size * n)) / steepness
