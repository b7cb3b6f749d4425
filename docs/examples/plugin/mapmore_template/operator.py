"""Washout: what of a quantity is fast. It decays with the time constant `tau` when that rests."""

import math

from mapmore_cli.modelling.expressions.operator import (
    Operator,
    Parameter,
    Recursion,
    Setting,
    linear,
)


def recursion(setting: Setting) -> Recursion:
    """Return `s[k] = a (s[k-1] + x[k] - x[k-1])` with `a = exp(-step/tau)`; at rest s is zero."""
    kept = math.exp(-setting.step / setting.numbers[0])
    return linear((kept,), (kept, -kept), 0.0)


OPERATOR = Operator(
    name="washout",
    summary="What of the quantities `of` is faster than the time constants `tau`.",
    recursion=recursion,
    parameters=(
        Parameter("tau", "s", "0.5 s", between=lambda step, longest: (2 * step, longest / 4)),
    ),
)
