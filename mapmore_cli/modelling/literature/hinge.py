"""Sárosi's formula with a slack foot, on normalised data: its values, its derivatives, its units.

With p = P/max|P|, x = strain/max|strain|, f = F/max|F| (any target F):

    f = lo + w ln(1 + exp((hi - lo)/w)),   hi = (a1 p + a2) exp(a3 x) + a4 x p + a5 p + a6,   lo = b0 + b1 p + b2 x

is Sárosi's `hi` above the foot and the plane `lo` on it, joined by a hinge of width w. Coordinates q, `(10,)`, are the parameters in the
order of `NAMES`, but for ln w in place of w.
"""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array

NAMES = ("a1", "a2", "a3", "a4", "a5", "a6", "b0", "b1", "b2", "w")
A, A3, B, B1, LN_W = [0, 1, 3, 4, 5], 2, [6, 7, 8], 7, 9
"""Places of the parameters in q: the linear ones of `hi`, its curvature, those of `lo`, the foot's slope with pressure, the width."""


def force(q: Array, p: Array, x: Array) -> Array:
    """The normalised force, `(n,)`; of several places q, `(s, 10)`, a row for each, `(s, n)`."""
    _, high, low = _sides(q, p, x)
    w = np.exp(_each(q, LN_W))
    return np.asarray(low + w * np.logaddexp(0.0, (high - low) / w))


def linearised(q: Array, p: Array, x: Array) -> tuple[Array, Array]:
    """`force` and its derivative for q, `(n, 10)`; of several places `(s, n)` and `(s, n, 10)`."""
    w = np.exp(_each(q, LN_W))
    decay, high, low = _sides(q, p, x)
    above = (high - low) / w
    softened = np.logaddexp(0.0, above)
    share = 0.5 * (1.0 + np.tanh(0.5 * above))  # d force / d hi
    below = 1.0 - share
    falling = decay * share
    slopes = (
        *(p * falling, falling, (_each(q, 0) * p + _each(q, 1)) * x * falling, x * p * share, p * share, share),
        *(below, p * below, x * below),
        w * (softened - share * above),
    )
    return low + w * softened, np.stack(slopes, axis=-1)


def upper_regressors(a3: float, p: Array, x: Array) -> Array:
    """Regressors of `hi`, `(n, 5)`, for a given curvature."""
    decay = np.exp(a3 * x)
    return np.stack([p * decay, decay, x * p, p, np.ones_like(p)], axis=1)


def foot_regressors(p: Array, x: Array) -> Array:
    """Regressors of `lo`, `(n, 3)`."""
    return np.stack([np.ones_like(p), p, x], axis=1)


def units(pressure: float, strain: float, target: float) -> Array:
    """What one of every parameter is in the units of the data, `(10,)`, with the scales that the data were divided by."""
    upper = [target / pressure, target, 1 / strain, target / (pressure * strain), target / pressure, target]
    return np.array([*upper, target, target / pressure, target / strain, target])


def _sides(q: Array, p: Array, x: Array) -> tuple[Array, Array, Array]:
    """`exp(a3 x)`, `hi` and `lo`, each `(n,)` or `(s, n)`."""
    a1, a2, a3, a4, a5, a6, b0, b1, b2, _ = (_each(q, place) for place in range(len(NAMES)))
    decay = np.exp(a3 * x)
    return decay, (a1 * p + a2) * decay + (a4 * x + a5) * p + a6, b0 + b1 * p + b2 * x


def _each(q: Array, place: int) -> Array:
    """One coordinate of every place, to be multiplied with rows."""
    return np.asarray(q[..., place, np.newaxis])
