"""Operators along one uninterrupted piece of a recording: what the past does to the present.

Each starts at rest at its first sample, and leaves empty (NaN) what its source leaves empty at the beginning.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from mapmore_cli.domain.arrays import Array


def delayed(x: Array, steps: int) -> Array:
    """`x[k - steps]`, (n,); NaN before there is history."""
    values = np.full(len(x), np.nan)
    values[steps:] = x[: max(len(x) - steps, 0)]
    return values


def slow(x: Array, tau: float, step: float) -> Array:
    """First-order lag `s[k] = a s[k-1] + (1 - a) x[k]`, `a = exp(-step/tau)`, (n,), from `s[0] = x[0]`.

    Parameters
    ----------
    tau, step
        Time constant and time between samples, s.
    """
    from scipy.signal import lfilter

    a = math.exp(-step / tau)
    return _from_rest(x, lambda moved: np.asarray(lfilter([1 - a], [1, -a], moved)))


def play(x: Array, width: float) -> Array:
    """Backlash: `w[k] = min(max(w[k-1], x[k] - width), x[k] + width)`, (n,), from `w[0] = x[0]`.

    `width` is half the slack, in the unit of x. Sums of such operators are the Prandtl-Ishlinskii model (P. Krejci, K. Kuhnen 2001).
    """
    begin = _beginning(x)
    values = np.full(len(x), np.nan)
    series = x[begin:].tolist()  # a loop over Python's floats is much faster than one over NumPy's
    followed: list[float] = []
    w = series[0] if series else 0.0
    for now in series:
        if now - width > w:
            w = now - width
        elif now + width < w:
            w = now + width
        followed.append(w)
    values[begin:] = followed
    return values


def stop(x: Array, width: float) -> Array:
    """Elasto-slide: what `play` does not follow, `s[k] = x[k] - w[k]`, (n,), between -width and width, from zero.

    It obeys `s[k] = min(width, max(-width, s[k-1] + x[k] - x[k-1]))`; sums of such operators are the Maxwell-slip model.
    """
    return x - play(x, width)


def resonance(x: Array, frequency: float, damping: float, step: float) -> Array:
    """Second-order oscillator of unit gain driven by x, (n,), from rest at `x[0]`.

    `y[k] = 2 q cos(th) y[k-1] - q^2 y[k-2] + (1 - 2 q cos(th) + q^2) x[k]` with `q = exp(-damping w step)`,
    `th = w step sqrt(1 - damping^2)` and `w = 2 pi frequency`.

    Parameters
    ----------
    frequency, damping, step
        Undamped frequency, Hz; damping ratio, below one; time between samples, s.
    """
    from scipy.signal import lfilter

    w = 2 * math.pi * frequency
    q, th = math.exp(-damping * w * step), w * step * math.sqrt(1 - damping**2)
    first, second = 2 * q * math.cos(th), q * q
    return _from_rest(x, lambda moved: np.asarray(lfilter([1 - first + second], [1, -first, second], moved)))


def resonance_velocity(x: Array, frequency: float, damping: float, step: float) -> Array:
    """Velocity of the same oscillator in its natural unit of time, `v[k] = (y[k] - y[k-1])/(w step)`, (n,), from zero."""
    y = resonance(x, frequency, damping, step)
    velocity = np.diff(y, prepend=np.nan) / (2 * math.pi * frequency * step)
    velocity[_beginning(x) : _beginning(x) + 1] = 0.0
    return velocity


def _from_rest(x: Array, filtered: Callable[[Array], Array]) -> Array:
    """A filter of unit gain that has stood at the first value for ever."""
    begin = _beginning(x)
    values = np.full(len(x), np.nan)
    rest = x[begin : begin + 1].sum()
    values[begin:] = filtered(x[begin:] - rest) + rest
    return values


def _beginning(x: Array) -> int:
    """Index of the first sample that is not empty; the length where there is none."""
    known = ~np.isnan(x)
    return int(np.argmax(known)) if known.any() else len(x)
