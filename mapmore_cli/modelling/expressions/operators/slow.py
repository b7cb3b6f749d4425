"""First-order lag: creep, filling."""

from __future__ import annotations

import math

import numpy as np

from mapmore_cli.modelling.expressions.operator import (
    Operator,
    Parameter,
    Recursion,
    Setting,
    linear,
)

QUICKEST, SLOWEST = (
    10,
    0.25,
)  # spread time constants lie between so many samples and this fraction of the longest piece
BEYOND = 100.0  # times the longest piece: what is slower than that is a drift at a constant rate
STARTING = 6  # time constants that a search begins from


def recursion(setting: Setting) -> Recursion:
    """Return `s[k] = a s[k-1] + (1 - a) x[k]`, `a = exp(-step/tau)`."""
    a = math.exp(-setting.step / setting.numbers[0])
    return linear([a], [1 - a])


def spread_times(count: int, step: float, longest: float) -> tuple[float, ...]:
    """Return `count` time constants, s, in even ratios from ten samples of `step` seconds to a
    quarter of the `longest` piece, s.
    """
    quickest = QUICKEST * step
    times = np.geomspace(quickest, max(SLOWEST * longest, quickest), count)
    return tuple(dict.fromkeys(float(f"{time:.3g}") for time in times))


OPERATORS = (
    Operator(
        name="slow",
        summary="First-order lags of the quantities `of`, with time constants `tau`, or a `count` "
        "of them spread over what the recordings "
        "can show; training finds one that is given by neither.",
        recursion=recursion,
        parameters=(
            Parameter(
                "tau", "s", "50 ms", between=lambda step, longest: (0.5 * step, BEYOND * longest)
            ),
        ),
        starts=lambda step, longest: tuple(
            (tau,) for tau in spread_times(STARTING, step, 4 * longest)
        ),
        spread=spread_times,
    ),
)
