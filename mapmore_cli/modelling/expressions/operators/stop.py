"""Elasto-slide element: friction that sticks before it slips."""

from __future__ import annotations

from mapmore_cli.modelling.expressions.operator import Operator, Recursion, Setting
from mapmore_cli.modelling.expressions.operators.play import STARTS, WIDTHS, play, spread_widths


def recursion(setting: Setting) -> Recursion:
    """Return `s[k] = min(width, max(-width, s[k-1] + x[k] - x[k-1]))`, from zero: what `play` does
    not follow.

    Sums of such operators are the Maxwell-slip model.
    """
    width = setting.width
    return Recursion(
        1, 1, lambda m, s, x, before: m.clip(s + (x - before), -width, width), lambda x: 0.0 * x
    )


OPERATORS = (
    Operator(
        name="stop",
        summary="`stop` operators (friction that sticks before it slips) on the quantities `of`. "
        "`widths` are half the way until it slips, "
        "as fractions of the training range; a `count` of them is spread evenly; training "
        "finds one that is given by neither.",
        recursion=recursion,
        along=lambda x, setting: x - play(x, setting.width),
        parameters=(WIDTHS,),
        needs="range",
        starts=lambda _step, _longest: STARTS,
        spread=spread_widths,
    ),
)
