"""Position and velocity of a damped oscillator: ringing."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.terms.operator import Operator, Parameter, Recursion, Setting, beginning, filtered_from_rest


class Oscillator(NamedTuple):
    """`y[k] = first y[k-1] - second y[k-2] + gain x[k]`, and `speed`, the angular frequency times the time between samples."""

    first: float
    second: float
    gain: float
    speed: float


def oscillator(frequency: float, damping: float, step: float) -> Oscillator:
    """`first = 2 q cos(th)`, `second = q^2` with `q = exp(-damping w step)`, `th = w step sqrt(1 - damping^2)` and `w = 2 pi frequency`."""
    w = 2 * math.pi * frequency
    q, th = math.exp(-damping * w * step), w * step * math.sqrt(1 - damping**2)
    first, second = 2 * q * math.cos(th), q * q
    return Oscillator(first, second, 1 - first + second, w * step)


def resonance(x: Array, frequency: float, damping: float, step: float) -> Array:
    """Second-order oscillator of unit gain driven by x, (n,), from rest at `x[0]`: `y[k]` as `Oscillator` says.

    Parameters
    ----------
    frequency, damping, step
        Undamped frequency, Hz; damping ratio, below one; time between samples, s.
    """
    first, second, gain, _ = oscillator(frequency, damping, step)
    return filtered_from_rest(x, [gain], [1, -first, second])


def resonance_velocity(x: Array, frequency: float, damping: float, step: float) -> Array:
    """Velocity of the same oscillator in its natural unit of time, `v[k] = (y[k] - y[k-1])/(w step)`, (n,), from zero."""
    y = resonance(x, frequency, damping, step)
    velocity = np.diff(y, prepend=np.nan) / (2 * math.pi * frequency * step)
    begin = beginning(x)
    velocity[begin : begin + 1] = 0.0
    return velocity


def _of(setting: Setting) -> Oscillator:
    frequency, damping = setting.numbers
    return oscillator(frequency, damping, setting.step)


def position_recursion(setting: Setting) -> Recursion:
    """The position, sample by sample."""
    first, second, gain, _ = _of(setting)
    return Recursion(2, 0, lambda y, older, x: first * y - second * older + gain * x, lambda x: x, lambda _y, _x: (first, -second, gain))


def velocity_recursion(setting: Setting) -> Recursion:
    """The velocity, sample by sample: the same oscillator, driven by the change of x."""
    first, second, gain, speed = _of(setting)
    gain /= speed
    return Recursion(
        2,
        1,
        lambda v, older, x, before: first * v - second * older + gain * (x - before),
        lambda _x: 0.0,
        lambda _v, _x: (first, -second, gain, -gain),
    )


PARAMETERS = (Parameter("frequency", "Hz", "4 Hz"), Parameter("damping", "1", "0.2", below=1.0))

OPERATORS = (
    Operator(
        name="resonance",
        summary="Position and velocity of a damped oscillator that each quantity `of` drives; `frequency` and `damping` are found where "
        "not given.",
        along=lambda x, setting: resonance(x, setting.numbers[0], setting.numbers[1], setting.step),
        recursion=position_recursion,
        parameters=PARAMETERS,
        needs="oscillator",
    ),
    Operator(
        name="resonance_velocity",
        summary="The velocity alone.",
        along=lambda x, setting: resonance_velocity(x, setting.numbers[0], setting.numbers[1], setting.step),
        recursion=velocity_recursion,
        parameters=PARAMETERS,
        needs="oscillator",
        family="resonance",
    ),
)
