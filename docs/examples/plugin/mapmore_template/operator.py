"""Washout (high-pass filter): a state that follows fast changes of a quantity. While the quantity
is constant, the state decays to zero with the time constant `tau`.
"""

import math

from mapmore_cli.modelling.expressions.operator import (
    Operator,
    Parameter,
    Recursion,
    Setting,
    linear,
)


def recursion(setting: Setting) -> Recursion:
    """Return `s[k] = a (s[k-1] + x[k] - x[k-1])` with `a = exp(-step/tau)`, and s = 0 at rest."""
    decay = math.exp(-setting.step / setting.numbers[0])
    return linear((decay,), (decay, -decay), 0.0)


OPERATOR = Operator(
    name="washout",
    summary="The part of the quantities in `of` that changes faster than the time constants `tau`.",
    recursion=recursion,
    parameters=(
        Parameter("tau", "s", "0.5 s", between=lambda step, longest: (2 * step, longest / 4)),
    ),
)
