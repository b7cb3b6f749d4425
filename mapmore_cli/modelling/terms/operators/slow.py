"""First-order lag: creep, filling."""

from __future__ import annotations

import math

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.terms.operator import Operator, Parameter, Recursion, Setting, filtered_from_rest

QUICKEST, SLOWEST = 10, 0.25
"""Spread time constants lie between so many samples and this fraction of the longest piece."""


def slow(x: Array, tau: float, step: float) -> Array:
    """`s[k] = a s[k-1] + (1 - a) x[k]`, `a = exp(-step/tau)`, (n,), from `s[0] = x[0]`.

    Parameters
    ----------
    tau, step
        Time constant and time between samples, s.
    """
    a = math.exp(-step / tau)
    return filtered_from_rest(x, [1 - a], [1, -a])


def recursion(setting: Setting) -> Recursion:
    """The same, sample by sample."""
    a = math.exp(-setting.step / setting.numbers[0])
    return Recursion(1, 0, lambda s, x: a * s + (1 - a) * x, lambda x: x, lambda _s, _x: (a, 1 - a))


def spread_times(count: int, step: float, longest: float) -> tuple[float, ...]:
    """`count` time constants, s, in even ratios from ten samples of `step` seconds to a quarter of the `longest` piece, s."""
    quickest = QUICKEST * step
    times = np.geomspace(quickest, max(SLOWEST * longest, quickest), count)
    return tuple(dict.fromkeys(float(f"{time:.3g}") for time in times))


OPERATORS = (
    Operator(
        name="slow",
        summary="First-order lags of the quantities `of`, with time constants `tau`, or a `count` of them spread over what the recordings "
        "can show.",
        along=lambda x, setting: slow(x, setting.numbers[0], setting.step),
        recursion=recursion,
        parameters=(Parameter("tau", "s", "50 ms"),),
        spread=spread_times,
    ),
)
