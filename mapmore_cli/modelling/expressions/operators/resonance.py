"""Define the position and the velocity of a damped oscillator that is driven by x."""

from __future__ import annotations

import math

from mapmore_cli.modelling.expressions.operator import (
    Operator,
    Parameter,
    Recursion,
    Setting,
    linear,
)


def position(setting: Setting) -> Recursion:
    """Return the rule `y[k] = 2 q cos(th) y[k-1] - q^2 y[k-2] + gain x[k]` of a damped oscillator.
    The gain is such that y becomes equal to x if x is constant.

    Here, `w = 2 pi frequency` with the frequency in Hz, `q = exp(-damping w step)`, and `th = w
    step sqrt(1 - damping^2)`. The damping ratio `damping` is below one.
    """
    past, gain, _ = _oscillator(setting)
    return linear(past, [gain])


def velocity(setting: Setting) -> Recursion:
    """Return the rule `v[k] = (y[k] - y[k-1])/(w step)`: the velocity of the oscillator
    `position`, with 1/w as the unit of time.

    It is computed as an oscillator that is driven by the change of x.
    """
    past, gain, speed = _oscillator(setting)
    return linear(past, [gain / speed, -gain / speed], steady=0.0)


def _oscillator(setting: Setting) -> tuple[tuple[float, float], float, float]:
    """Return the numbers of an oscillator: the weights of its two past values, its gain, and its
    angular frequency times the time between samples.
    """
    frequency, damping = setting.numbers
    w = 2 * math.pi * frequency
    q, th = math.exp(-damping * w * setting.step), w * setting.step * math.sqrt(1 - damping**2)
    first, second = 2 * q * math.cos(th), q * q
    return (first, -second), 1 - first + second, w * setting.step


PARAMETERS = (Parameter("frequency", "Hz", "4 Hz"), Parameter("damping", "1", "0.2", below=1.0))

OPERATORS = (
    Operator(
        name="resonance",
        summary=(
            "Position and velocity of a damped oscillator (ringing) that is driven by each "
            "quantity in `of`. Training estimates `frequency` (in Hz) and `damping` if they are "
            "not given."
        ),
        recursion=position,
        parameters=PARAMETERS,
        needs="oscillator",
    ),
    Operator(
        name="resonance_velocity",
        summary="The velocity alone.",
        recursion=velocity,
        parameters=PARAMETERS,
        needs="oscillator",
        family="resonance",
    ),
)
