"""Creep with the logarithm of the time: Eyring's dashpot beside a spring."""

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
from mapmore_cli.modelling.expressions.operators.slow import BEYOND, spread_times

FARTHEST = 60.0  # half-widths of distance from rest beyond which the dashpot is as quick as it gets


def recursion(setting: Setting) -> Recursion:
    """Return s with `ds/dt = (width/tau) sinh((x - s)/width)`, exactly over one step: `tanh(e/2)`
    of e = (x - s)/width decays by tau.

    A step of many widths creeps as `width ln(t)`, a small one as a first-order lag. Source: H.
    Eyring 1936. `width` is a fraction of the training range of x.
    """
    tau, (low, high) = setting.numbers[0], setting.limits
    width = setting.numbers[1] * (high - low) or 1.0
    keeps = math.exp(-setting.step / tau)

    def following(m: Arithmetic, s: Any, x: Any) -> Any:
        left = keeps * m.call("tanh", m.clip((x - s) / (2 * width), -FARTHEST, FARTHEST))
        return x - width * (m.call("log1p", left) - m.call("log1p", -left))

    return Recursion(1, 0, following, lambda x: x)


OPERATORS = (
    Operator(
        name="creep",
        summary="Creep of the quantities `of` with the logarithm of the time: a lag of time "
        "constant `tau` for changes smaller than "
        "`width`, a fraction of the training range; found by training where not given.",
        recursion=recursion,
        parameters=(
            Parameter("tau", "s", "10 s", between=lambda step, longest: (step, BEYOND * longest)),
            Parameter("width", "1", "0.05", between=lambda _step, _longest: (0.005, 10.0)),
        ),
        needs="range",
        starts=lambda step, longest: tuple(
            (tau, width) for tau in spread_times(4, step, 16 * longest) for width in (0.03, 0.2)
        ),
    ),
)
