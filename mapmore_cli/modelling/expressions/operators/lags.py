"""Define first-order lags, for example for creep or for the filling of a volume. Also define the
rate of change of a signal, for example of a fed-back output, and the direction of its last change.
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

# largest time constant, as a multiple of the duration of the longest piece
# A lag with a larger time constant looks like a drift at a constant rate.
BEYOND = 100.0


def slow(setting: Setting) -> Recursion:
    """Return the rule `s[k] = a s[k-1] + (1 - a) x[k]` with `a = exp(-step/tau)`. Here, tau is the
    time constant, and step is the time between samples.
    """
    a = math.exp(-setting.step / setting.numbers[0])
    return linear([a], [1 - a])


def spread_times(count: int, step: float, longest: float) -> tuple[float, ...]:
    """Return `count` time constants in s, from ten times `step` to a quarter of `longest`, with
    equal ratios between neighbours. `step` and `longest` are times in s.
    """
    quickest = 10 * step
    times = np.geomspace(quickest, max(0.25 * longest, quickest), count)
    return tuple(dict.fromkeys(float(f"{time:.3g}") for time in times))


def creep(setting: Setting) -> Recursion:
    """Return the rule that solves `ds/dt = (width/tau) sinh((x - s)/width)` exactly over one step.
    It uses that `tanh(e/2)` with e = (x - s)/width decays with the time constant tau.

    After a step of many widths, s creeps as `width ln(t)`; after a small step, it is a first-order
    lag. In the name of a state, `width` is a fraction of the training range of x. Source: H. Eyring
    1936.
    """
    tau, (low, high) = setting.numbers[0], setting.limits
    width = setting.numbers[1] * (high - low) or 1.0
    keeps = math.exp(-setting.step / tau)

    def following(m: Arithmetic, s: Amount, x: Amount) -> Amount:
        # the limits -60 and 60 change no result, because tanh(60) is 1 in floating-point numbers
        left = keeps * m.call("tanh", m.clip((x - s) / (2 * width), -60.0, 60.0))
        return x - width * (m.call("log1p", left) - m.call("log1p", -left))

    return Recursion(1, 0, following, lambda x: x)


def rate_of_change(setting: Setting) -> Recursion:
    """Return the rule `(x[k] - x[k-1])/step`, the rate of change of x per second."""
    return linear([], [1 / setting.step, -1 / setting.step], steady=0.0)


def last_direction(_setting: Setting) -> Recursion:
    """Return the rule for the direction of the last change of x: 1 after a rise, -1 after a fall,
    and 0 before the first change. Applied to `play(x, r)` instead of x, the rule ignores changes of
    x that are too small to move the play.
    """

    def following(m: Arithmetic, s: Amount, x: Amount, before: Amount) -> Amount:
        return m.where(x > before, 1.0, lambda: m.where(x < before, -1.0, s))

    return Recursion(1, 1, following, lambda x: 0.0 * x)


OPERATORS = (
    Operator(
        name="slow",
        summary=(
            "First-order lags of the quantities in `of`, for example for creep or for the "
            "filling of a volume. Give the time constants `tau`, or their number `count`. With "
            "`count`, the time constants are spread over the range that the recordings can show. "
            "Without `tau` and `count`, training estimates one time constant."
        ),
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
        summary=(
            "Creep of the quantities in `of` with the logarithm of time. Changes that are small "
            "compared with `width` (a fraction of the training range) creep as in a first-order "
            "lag with the time constant `tau`. Training estimates `tau` and `width` if they are "
            "not given."
        ),
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
        summary="The change of the quantities in `of` from one sample to the next, per second.",
        recursion=rate_of_change,
    ),
    Operator(
        name="direction",
        summary=(
            "The sign of the last change of the quantities in `of`. Applied to "
            "`play(pressure, 0.02)`, it ignores small changes."
        ),
        recursion=last_direction,
        timed=False,
    ),
)
