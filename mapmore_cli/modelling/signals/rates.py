"""Compute rates, directions of motion and other quantities from measured quantities over time.
Remove noise and spikes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns, IntArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Signal
from mapmore_cli.modelling.signals.sampling import ROUNDING

STEPS = 10  # number of grid points per window


def running_median(x: Array, y: Array, window: float) -> tuple[Array, Array]:
    """Return the medians of x and of y around each point of an even grid over the range of x, shape
    (m,) each. Each median is taken over half of the window: a quarter on both sides of the point.

    If the samples lie on a straight line, the medians lie on this line too. A spike that is
    narrower than a quarter of the window has no effect. If a grid point has no samples around it,
    its value is interpolated between neighbouring points. Samples x, y (n,) come in any order; the
    window is in the unit of x.
    """
    order = np.lexsort((y, x))
    x, y = x[order], y[order]
    grid = np.linspace(x[0], x[-1], max(1, round(STEPS * float(x[-1] - x[0]) / window)) + 1)
    # tolerance, so that a sample exactly on the edge of the window is inside
    reach = window / 4 * (1 + ROUNDING)
    first = np.searchsorted(x, grid - reach, "left")
    last = np.searchsorted(x, grid + reach, "right")
    known = last > first
    near = [slice(begin, end) for begin, end in zip(first[known], last[known], strict=True)]
    over_x, over_y = (
        np.interp(grid, grid[known], [np.median(values[rows]) for rows in near])
        for values in (x, y)
    )
    return over_x, over_y


# number of samples that are processed at once, so that they stay in the processor's cache
BLOCK = 100_000


def rate(time: Array, values: Array, window: float, order: int) -> Array:
    """Return the time derivative of `values` by a Savitzky-Golay filter on the true time stamps.

    At every sample, a polynomial of degree `order` is fitted by least squares to the samples within
    `window / 2` of it, and differentiated there. Near both ends of the record, the window is moved
    inwards, so that it keeps its width. For evenly spaced stamps, the result is that of
    `scipy.signal.savgol_filter(deriv=1, mode="interp")`. But loggers round and repeat stamps. If
    the record were resampled to even steps first, the rounding of stamps would become noise of the
    rate. A fit on the true stamps averages the rounding out.

    - `time`, `values`: `(n,)`; seconds, never decreasing, and any unit.
    - `window`: width in seconds, ends included.

    Raises DataError if a window holds fewer than `order + 1` different stamps.
    """
    # tolerance, so that a stamp exactly on the edge of the window is inside
    slack = ROUNDING * window + 4 * np.finfo(float).eps * float(np.abs(time).max())
    begin = np.clip(time - window / 2, time[0], max(time[0], time[-1] - window))
    start = np.searchsorted(time, begin - slack, side="left")
    stop = np.searchsorted(time, begin + window + slack, side="right")
    rank = np.concatenate([[0], np.cumsum(np.diff(time) > 0)])
    different = rank[stop - 1] - rank[start] + 1
    worst = int(np.argmin(different))
    if different[worst] <= order:
        raise DataError(
            f"the window of {window:g} s at t = {time[worst]:g} s holds {different[worst]} "
            "different time stamps; "
            f"a rate of order {order} needs {order + 1}",
            "Give a wider `window` or a lower `order`.",
        )
    rows = max(1, BLOCK // int((stop - start).max()))
    blocks = [slice(i, i + rows) for i in range(0, len(time), rows)]
    return np.concatenate(
        [_slopes(time, values, time[b], start[b], stop[b], window, order) for b in blocks]
    )


def _slopes(
    time: Array,
    values: Array,
    at: Array,
    start: IntArray,
    stop: IntArray,
    window: float,
    order: int,
) -> Array:
    """Return the slopes of m polynomials at the times `at`, (m,). Each is fitted to the samples
    `start` to `stop` of its window. All fits are solved together by their normal equations.

    The time t is measured from `at` and divided by the width of the window, because the normal
    equations of monomials up to degree 5 are then well conditioned. Element (i, j) of the normal
    matrix is the sum of `t^(i+j)`, so that only `2 order + 1` different sums are needed.
    """
    places = start[:, None] + np.arange((stop - start).max())
    # `power` holds t^0, t^1, ... one after the other; it is zero outside the window.
    power = (places < stop[:, None]).astype(float)
    places = np.minimum(places, len(time) - 1)
    t = (time[places] - at[:, None]) / window
    # an offset is subtracted, because large values would lose digits
    y = values[places] - values[start][:, None]
    sums, moments = [], []
    for degree in range(2 * order + 1):
        sums.append(power.sum(axis=1))
        if degree <= order:
            moments.append((power * y).sum(axis=1))
        power *= t
    i = np.arange(order + 1)
    normal = np.array(sums)[i[:, None] + i].transpose(2, 0, 1)
    try:
        slopes: Array = np.linalg.solve(normal, np.array(moments).T[..., None])[:, 1, 0] / window
    except np.linalg.LinAlgError:
        raise DataError(
            f"the time stamps in a window of {window:g} s near t = {at[0]:g} s lie too close "
            f"together for a rate of order {order}",
            "Give a wider `window` or a lower `order`.",
        ) from None
    return slopes


RISE, FALL = 1.0, -1.0


def direction(rate: Array, dead_band: float) -> Array:
    """Return the sign of a rate, +1 (rise) or -1 (fall), shape (n,). While `|rate| <= dead_band`,
    the last direction is kept. At the beginning of a recording, the direction is +1. So the
    direction depends on past samples only. In M2 eq 16, the direction is the sign of the change of
    pressure. This sign would change with the noise on every plateau.
    """
    moving = np.abs(rate) > dead_band
    last = np.maximum.accumulate(np.where(moving, np.arange(len(rate)), -1))
    return np.where(last < 0, RISE, np.sign(rate[np.maximum(last, 0)]))


def signal_values(signal: Signal, columns: Columns) -> Array:
    """Return a signal over one recording, shape (n,), computed from its source quantity and, for a
    rate, from the `time`.

    Raises DataError if the window of a rate contains too few samples.
    """
    source = columns[signal.of]
    if signal.kind == "direction":
        return direction(source, signal.dead_band)
    return signal.factor * rate(
        columns["time"] * signal.seconds, source, signal.window, signal.order
    )


def with_signals(signals: Sequence[Signal], columns: Columns) -> dict[str, Array]:
    """Return the columns of one recording, with all missing signals added."""
    known = dict(columns)
    for signal in signals:
        if signal.name not in known:
            known[signal.name] = signal_values(signal, known)
    return known


def needed_signals(signals: Sequence[Signal], inputs: Sequence[str]) -> tuple[Signal, ...]:
    """Return the signals that are needed to compute the inputs. A signal that is computed from
    another signal comes after it in the result.
    """
    wanted = set(inputs)
    kept: list[Signal] = []
    for signal in reversed(signals):
        if signal.name in wanted:
            wanted.add(signal.of)
            kept.insert(0, signal)
    return tuple(kept)
