"""Position and velocity of a damped oscillator: ringing."""

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
    """Return `y[k] = 2 q cos(th) y[k-1] - q^2 y[k-2] + gain x[k]`, an oscillator of unit gain.

    `q = exp(-damping w step)`, `th = w step sqrt(1 - damping^2)`, `w = 2 pi frequency`; frequency
    in Hz, damping ratio below one.
    """
    past, gain, _ = _oscillator(setting)
    return linear(past, [gain])


def velocity(setting: Setting) -> Recursion:
    """Return the velocity of the same oscillator in its natural unit of time, `v[k] = (y[k] -
    y[k-1])/(w step)`.

    It is the oscillator that the change of x drives.
    """
    past, gain, speed = _oscillator(setting)
    return linear(past, [gain / speed, -gain / speed], steady=0.0)


def _oscillator(setting: Setting) -> tuple[tuple[float, float], float, float]:
    """Return the weights of the past, the gain, and the angular frequency times the time between
    samples.
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
        summary="Position and velocity of a damped oscillator that each quantity `of` drives; "
        "`frequency` and `damping` are found where "
        "not given.",
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
