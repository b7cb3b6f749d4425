"""Elasto-slide element: friction that sticks before it slips."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.terms.operator import Operator, Recursion, Setting
from mapmore_cli.modelling.terms.operators.play import WIDTHS, play, spread_widths


def stop(x: Array, width: float) -> Array:
    """What `play` does not follow, `s[k] = x[k] - w[k]`, (n,), between -width and width, from zero.

    It obeys `s[k] = min(width, max(-width, s[k-1] + x[k] - x[k-1]))`; sums of such operators are the Maxwell-slip model.
    """
    return x - play(x, width)


def recursion(setting: Setting) -> Recursion:
    """The same, sample by sample; where it slips, it does not depend on x."""
    width = setting.width

    def slopes(s: Array, _x: Array) -> tuple[Array, Array, Array]:
        sticks = (np.abs(s) < width).astype(np.float64)
        return sticks, sticks, -sticks

    return Recursion(1, 1, lambda s, x, before: min(width, max(-width, s + x - before)), lambda _x: 0.0, slopes)


OPERATORS = (
    Operator(
        name="stop",
        summary="`stop` operators (friction that sticks before it slips) on the quantities `of`. `widths` are half the way until it slips, "
        "as fractions of the training range; a `count` of them is spread evenly.",
        along=lambda x, setting: stop(x, setting.width),
        recursion=recursion,
        parameters=(WIDTHS,),
        needs="range",
        spread=spread_widths,
    ),
)
