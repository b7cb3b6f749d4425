"""Smooth friction of a velocity: Coulomb's sign and Stribeck's excess near standstill. They have no
memory.
"""

from __future__ import annotations

import math
from typing import Any

from mapmore_cli.modelling.expressions.operator import (
    Arithmetic,
    Operator,
    Parameter,
    Recursion,
    Setting,
)

WIDTHS = (
    0.001,
    0.004,
    0.016,
    0.064,
    0.25,
)  # velocities that a search begins from, as fractions of the training range
FINEST, COARSEST = 1e-4, 4.0  # least and greatest of them: a jump, and a straight line


def coulomb(setting: Setting) -> Recursion:
    """Return `tanh(x/v)`, v as a fraction of the training range of x."""
    v = setting.width or 1.0
    return Recursion(0, 0, lambda m, x: m.call("tanh", x / v), lambda x: math.tanh(x / v))


def stribeck(setting: Setting) -> Recursion:
    """Return `tanh(x/v) exp(-(x/fades)^2)`: friction that breaks away; both velocities as fractions
    of the training range of x.
    """
    v, (low, high) = setting.width or 1.0, setting.limits
    fades = setting.numbers[1] * (high - low) or 1.0

    def following(m: Arithmetic, x: Any) -> Any:
        return m.call("tanh", x / v) * m.call("exp", -((x / fades) ** 2))

    return Recursion(0, 0, following, lambda x: math.tanh(x / v) * math.exp(-((x / fades) ** 2)))


def _velocity(key: str, example: str) -> Parameter:
    return Parameter(key, "1", example, between=lambda _step, _longest: (FINEST, COARSEST))


OPERATORS = (
    Operator(
        name="coulomb",
        summary="The smooth sign `tanh(x/v)` of the rates `of`; `v` is a fraction of the training "
        "range, and found by training where not "
        "given.",
        recursion=coulomb,
        parameters=(_velocity("v", "0.01"),),
        needs="range",
        starts=lambda _step, _longest: tuple((v,) for v in WIDTHS),
    ),
    Operator(
        name="stribeck",
        summary="Break-away friction `tanh(x/v) exp(-(x/fades)^2)` of the rates `of`, `v` and "
        "`fades` as fractions of the training range; "
        "found by training where not given.",
        recursion=stribeck,
        parameters=(_velocity("v", "0.01"), _velocity("fades", "0.1")),
        needs="range",
        starts=lambda _step, _longest: tuple(
            (v, fades) for v in WIDTHS[:3] for fades in WIDTHS[1:4] if fades > v
        ),
    ),
)
