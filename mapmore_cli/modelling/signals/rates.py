"""Time derivatives of measured signals."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.errors import DataError

BLOCK = 100_000  # samples gathered into windows at one time: a few MB, which stay in the cache


def rate(time: Array, values: Array, window: float, order: int) -> Array:
    """Return the time derivative of `values` by a Savitzky-Golay filter on the true time stamps.

    At every sample, a polynomial of degree `order` is fitted by least squares to the samples within `window / 2` of it, and
    differentiated there. Near both ends of the record the window is moved inwards, so that it keeps its width. On evenly spaced stamps
    this is `scipy.signal.savgol_filter(deriv=1, mode="interp")`. Loggers however round and repeat stamps; resampling such a
    record to even steps first would turn the rounding into noise of the rate, where the fit averages it.

    Parameters
    ----------
    time
        `(n,)` seconds, never decreasing.
    values
        `(n,)` in any unit.
    window
        Width in seconds, ends included.
    order
        Degree of the polynomial; the rate of a polynomial up to this degree is exact.

    Raises
    ------
    DataError
        Where a window holds fewer than `order + 1` different stamps.
    """
    slack = 1e-9 * window + 4 * np.finfo(float).eps * float(np.abs(time).max())  # a stamp on the edge is inside, however it was rounded
    begin = np.clip(time - window / 2, time[0], max(time[0], time[-1] - window))
    start = np.searchsorted(time, begin - slack, side="left")
    stop = np.searchsorted(time, begin + window + slack, side="right")
    _check_windows(time, start, stop, window, order)
    longest = int((stop - start).max())
    rows = max(1, BLOCK // longest)
    blocks = [slice(i, i + rows) for i in range(0, len(time), rows)]
    return np.concatenate([_slopes(time, values, time[b], start[b], stop[b], window, order) for b in blocks])


def _check_windows(time: Array, start: IntArray, stop: IntArray, window: float, order: int) -> None:
    rank = np.concatenate([[0], np.cumsum(np.diff(time) > 0)])
    different = rank[stop - 1] - rank[start] + 1
    worst = int(np.argmin(different))
    if different[worst] <= order:
        raise DataError(
            f"the window of {window:g} s at t = {time[worst]:g} s holds {different[worst]} different time stamps; "
            f"a rate of order {order} needs {order + 1}",
            "Give a wider `window` or a lower `order`.",
        )


def _slopes(time: Array, values: Array, at: Array, start: IntArray, stop: IntArray, window: float, order: int) -> Array:
    """Slopes at `at` `(m,)` of the polynomials fitted to `time[start:stop]`, all at once by their normal equations.

    Time runs in units of the window, measured from `at`, where the monomials up to degree 5 are still well conditioned. Element
    (i, j) of the normal matrix is the sum of `t^(i+j)`, so that `2 order + 1` sums over the window fill it.
    """
    places = start[:, None] + np.arange((stop - start).max())
    power = (places < stop[:, None]).astype(float)  # t^0, zero outside of the window
    places = np.minimum(places, len(time) - 1)
    t = (time[places] - at[:, None]) / window
    y = values[places] - values[start][:, None]  # a large offset would cost digits
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
            f"the time stamps in a window of {window:g} s near t = {at[0]:g} s lie too close together for a rate of order {order}",
            "Give a wider `window` or a lower `order`.",
        ) from None
    return slopes
