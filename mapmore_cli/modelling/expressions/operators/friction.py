"""Define two operators without memory: a smooth version of the sign of a velocity (Coulomb
friction), and saturation.
"""

from __future__ import annotations

import numpy as np

from mapmore_cli.modelling.expressions.operator import (
    Operator,
    Parameter,
    Recursion,
    Setting,
)

# starting values of v in the search, as fractions of the training range of x
WIDTHS = (0.001, 0.004, 0.016, 0.064, 0.25)
# smallest v, with which tanh(x/v) is almost a jump, and largest v, with which it is almost linear
FINEST, COARSEST = 1e-4, 4.0


def coulomb(setting: Setting) -> Recursion:
    """Return the rule `tanh(x/v)`. In the name of a state, v is a fraction of the training range of
    x.
    """
    v = setting.width or 1.0
    return Recursion(0, 0, lambda m, x: m.call("tanh", x / v), lambda x: np.tanh(x / v))


def saturate(setting: Setting) -> Recursion:
    """Return the rule `s[k] = min(max(x[k], low), high)`. Here, low and high are the smallest and
    the largest training value of x. The rule has no memory.
    """
    low, high = setting.limits
    return Recursion(0, 0, lambda m, x: m.clip(x, low, high), lambda x: np.clip(x, low, high))


OPERATORS = (
    Operator(
        name="coulomb",
        summary=(
            "The smooth sign `tanh(x/v)` of each rate x in `of`. If the rate is a velocity, this "
            "term describes Coulomb friction. `v` is a fraction of the training range of the rate. "
            "Training estimates `v` if it is not given."
        ),
        recursion=coulomb,
        parameters=(
            Parameter("v", "1", "0.01", between=lambda _step, _longest: (FINEST, COARSEST)),
        ),
        needs="range",
        starts=lambda _step, _longest: tuple((v,) for v in WIDTHS),
        timed=False,
    ),
    Operator(
        name="saturate",
        summary="The quantities in `of`, limited to their training range.",
        recursion=saturate,
        needs="range",
        timed=False,
    ),
)
