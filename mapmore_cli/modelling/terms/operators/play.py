"""Backlash: friction, hysteresis."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.terms.operator import Operator, Parameter, Recursion, Setting, beginning

WIDEST = 0.5
"""Half-width, as a fraction of the range, from which a play never follows."""

ROUNDING = 1e-9
"""Of the half-width: what is so near to an end of the slack is at the end."""

WIDTHS = Parameter("widths", "1", "0.1", below=1.0)


def play(x: Array, width: float) -> Array:
    """`w[k] = min(max(w[k-1], x[k] - width), x[k] + width)`, (n,), from `w[0] = x[0]`.

    `width` is half the slack, in the unit of x. Sums of such operators are the Prandtl-Ishlinskii model (P. Krejci, K. Kuhnen 2001).
    """
    begin = beginning(x)
    values = np.full(len(x), np.nan)
    series = x[begin:].tolist()  # a loop over Python's floats is much faster than one over NumPy's
    followed: list[float] = []
    w = series[0] if series else 0.0
    for now in series:
        if now - width > w:
            w = now - width
        elif now + width < w:
            w = now + width
        followed.append(w)
    values[begin:] = followed
    return values


def recursion(setting: Setting) -> Recursion:
    """The same, sample by sample; within the slack it stands, at its ends it moves with x."""
    width = setting.width

    def slopes(w: Array, x: Array) -> tuple[Array, Array]:
        stands = (np.abs(w - x) < width * (1 - ROUNDING)).astype(np.float64)
        return stands, 1 - stands

    return Recursion(1, 0, lambda w, x: min(max(w, x - width), x + width), lambda x: x, slopes)


def spread_widths(count: int, _step: float = 0.0, _longest: float = 0.0) -> tuple[float, ...]:
    """`count` half-widths of play or stop, evenly over those that can move, as fractions of the training range."""
    return tuple(round(WIDEST * (i + 1) / (count + 1), 4) for i in range(count))


OPERATORS = (
    Operator(
        name="play",
        summary="`play` operators (backlash) on the quantities `of`. `widths` are half the slack as fractions of the training range; a "
        "`count` of them is spread evenly.",
        along=lambda x, setting: play(x, setting.width),
        recursion=recursion,
        parameters=(WIDTHS,),
        needs="range",
        spread=spread_widths,
    ),
)
