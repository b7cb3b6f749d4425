"""First-order lag: creep, filling."""

from __future__ import annotations

import math

import numpy as np

from mapmore_cli.modelling.terms.operator import Operator, Parameter, Recursion, Setting, linear

QUICKEST, SLOWEST = 10, 0.25
"""Spread time constants lie between so many samples and this fraction of the longest piece."""


def recursion(setting: Setting) -> Recursion:
    """Return `s[k] = a s[k-1] + (1 - a) x[k]`, `a = exp(-step/tau)`."""
    a = math.exp(-setting.step / setting.numbers[0])
    return linear([a], [1 - a])


def spread_times(count: int, step: float, longest: float) -> tuple[float, ...]:
    """Return `count` time constants, s, in even ratios from ten samples of `step` seconds to a quarter of the `longest` piece, s."""
    quickest = QUICKEST * step
    times = np.geomspace(quickest, max(SLOWEST * longest, quickest), count)
    return tuple(dict.fromkeys(float(f"{time:.3g}") for time in times))


OPERATORS = (
    Operator(
        name="slow",
        summary="First-order lags of the quantities `of`, with time constants `tau`, or a `count` of them spread over what the recordings "
        "can show.",
        recursion=recursion,
        parameters=(Parameter("tau", "s", "50 ms"),),
        spread=spread_times,
    ),
)
