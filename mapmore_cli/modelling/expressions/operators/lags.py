"""Lags: creep, filling; and rates of change, for signals whose rate is not measured, the fed-back
output among them.
"""

from __future__ import annotations

import math

import numpy as np

from mapmore_cli.modelling.expressions.operator import (
    Amount,
    Arithmetic,
    Operator,
    Parameter,
    Recursion,
    Setting,
    linear,
)

BEYOND = 100.0  # times the longest piece: what is slower than that is a drift at a constant rate


def slow(setting: Setting) -> Recursion:
    """Return `s[k] = a s[k-1] + (1 - a) x[k]`, `a = exp(-step/tau)`."""
    a = math.exp(-setting.step / setting.numbers[0])
    return linear([a], [1 - a])


def spread_times(count: int, step: float, longest: float) -> tuple[float, ...]:
    """Return `count` time constants, s, in even ratios from ten samples of `step` seconds to a
    quarter of the `longest` piece, s.
    """
    quickest = 10 * step
    times = np.geomspace(quickest, max(0.25 * longest, quickest), count)
    return tuple(dict.fromkeys(float(f"{time:.3g}") for time in times))


def creep(setting: Setting) -> Recursion:
    """Return s with `ds/dt = (width/tau) sinh((x - s)/width)`, exactly over one step: `tanh(e/2)`
    of e = (x - s)/width decays by tau.

    A step of many widths creeps as `width ln(t)`, a small one as a first-order lag. Source: H.
    Eyring 1936. `width` is a fraction of the training range of x.
    """
    tau, (low, high) = setting.numbers[0], setting.limits
    width = setting.numbers[1] * (high - low) or 1.0
    keeps = math.exp(-setting.step / tau)

    def following(m: Arithmetic, s: Amount, x: Amount) -> Amount:
        # sixty half-widths from rest, creep is as quick as it gets
        left = keeps * m.call("tanh", m.clip((x - s) / (2 * width), -60.0, 60.0))
        return x - width * (m.call("log1p", left) - m.call("log1p", -left))

    return Recursion(1, 0, following, lambda x: x)


def rate_of_change(setting: Setting) -> Recursion:
    """Return `(x[k] - x[k-1])/step`, per second."""
    return linear([], [1 / setting.step, -1 / setting.step], steady=0.0)


def last_direction(_setting: Setting) -> Recursion:
    """Return 1 after x has risen, -1 after it has fallen, 0 before it has moved; of `play(x, r)`,
    with a dead band of r.
    """

    def following(m: Arithmetic, s: Amount, x: Amount, before: Amount) -> Amount:
        return m.where(x > before, 1.0, lambda: m.where(x < before, -1.0, s))

    return Recursion(1, 1, following, lambda x: 0.0 * x)


OPERATORS = (
    Operator(
        name="slow",
        summary="First-order lags of the quantities `of`, with time constants `tau`, or a `count` "
        "of them spread over what the recordings "
        "can show; training finds one that is given by neither.",
        recursion=slow,
        parameters=(
            Parameter(
                "tau", "s", "50 ms", between=lambda step, longest: (0.5 * step, BEYOND * longest)
            ),
        ),
        starts=lambda step, longest: tuple((tau,) for tau in spread_times(6, step, 4 * longest)),
        spread=spread_times,
    ),
    Operator(
        name="creep",
        summary="Creep of the quantities `of` with the logarithm of the time: a lag of time "
        "constant `tau` for changes smaller than "
        "`width`, a fraction of the training range; found by training where not given.",
        recursion=creep,
        parameters=(
            Parameter("tau", "s", "10 s", between=lambda step, longest: (step, BEYOND * longest)),
            Parameter("width", "1", "0.05", between=lambda _step, _longest: (0.005, 10.0)),
        ),
        needs="range",
        starts=lambda step, longest: tuple(
            (tau, width) for tau in spread_times(4, step, 16 * longest) for width in (0.03, 0.2)
        ),
    ),
    Operator(
        name="rate",
        summary="The change of the quantities `of` per second, from one sample to the next.",
        recursion=rate_of_change,
    ),
    Operator(
        name="direction",
        summary=(
            "The sign of the last change of the quantities `of`; of `play(pressure, 0.02)`, "
            "one that small changes do not turn."
        ),
        recursion=last_direction,
    ),
)
