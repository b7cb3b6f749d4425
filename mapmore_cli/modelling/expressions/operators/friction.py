"""What has no memory: the smooth sign of a velocity, Coulomb's friction; and saturation."""

from __future__ import annotations

import numpy as np

from mapmore_cli.modelling.expressions.operator import (
    Operator,
    Parameter,
    Recursion,
    Setting,
)

# initial velocities of the search, as fractions of the training range
WIDTHS = (0.001, 0.004, 0.016, 0.064, 0.25)
FINEST, COARSEST = 1e-4, 4.0  # least and greatest of them: a jump, and a straight line


def coulomb(setting: Setting) -> Recursion:
    """Return `tanh(x/v)`, v as a fraction of the training range of x."""
    v = setting.width or 1.0
    return Recursion(0, 0, lambda m, x: m.call("tanh", x / v), lambda x: np.tanh(x / v))


def saturate(setting: Setting) -> Recursion:
    """Return `s[k] = min(max(x[k], low), high)`; it has no memory."""
    low, high = setting.limits
    return Recursion(0, 0, lambda m, x: m.clip(x, low, high), lambda x: np.clip(x, low, high))


OPERATORS = (
    Operator(
        name="coulomb",
        summary="The smooth sign `tanh(x/v)` of the rates `of`; `v` is a fraction of the training "
        "range, and found by training where not "
        "given.",
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
        summary="The quantities `of`, held at the ends of their training range.",
        recursion=saturate,
        needs="range",
        timed=False,
    ),
)
