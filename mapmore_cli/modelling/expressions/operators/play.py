"""Define the operators play (backlash) and stop (friction that sticks before it slips)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.expressions.operator import Operator, Parameter, Recursion, Setting

# largest half-width, as a fraction of the range of x; with a larger one, play cannot move back
WIDEST = 0.5

WIDTHS = Parameter("widths", "1", "0.1", below=1.0, between=lambda _step, _longest: (1e-3, WIDEST))
# starting values of the half-width in the search, as fractions of the range of x
STARTS = ((0.02,), (0.05,), (0.1,), (0.2,), (0.35,))


def play_recursion(setting: Setting) -> Recursion:
    """Return the rule `w[k] = min(max(w[k-1], x[k] - width), x[k] + width)` with `w[0] = x[0]`;
    `width` is half the gap of the backlash.

    A sum of such operators is the Prandtl-Ishlinskii model (P. Krejci, K. Kuhnen 2001).
    """
    width = setting.width
    return Recursion(1, 0, lambda m, w, x: m.clip(w, x - width, x + width), lambda x: x)


def stop_recursion(setting: Setting) -> Recursion:
    """Return the rule `s[k] = min(width, max(-width, s[k-1] + x[k] - x[k-1]))` with `s[0] = 0`: the
    difference between x and `play`.

    A sum of such operators is the Maxwell-slip model.
    """
    width = setting.width
    return Recursion(
        1, 1, lambda m, s, x, before: m.clip(s + (x - before), -width, width), lambda x: 0.0 * x
    )


def play(x: Array, width: float) -> Array:
    """Return the values of `play` along one piece, shape (n,). A loop over floats is used, because
    it is five times as fast as the general recursion.
    """
    w, followed = float(x[0]) if len(x) else 0.0, list[float]()
    for now in x.tolist():
        if now - width > w:
            w = now - width
        elif now + width < w:
            w = now + width
        followed.append(w)
    return np.array(followed)


def spread_widths(count: int, _step: float = 0.0, _longest: float = 0.0) -> tuple[float, ...]:
    """Return `count` evenly spaced half-widths, as fractions of the training range. All are below
    one half. With a larger half-width, the output of play could move in one direction, but never
    back, so that it would have no hysteresis.
    """
    return tuple(round(WIDEST * (i + 1) / (count + 1), 4) for i in range(count))


def _with_widths(
    name: str,
    summary: str,
    recursion: Callable[[Setting], Recursion],
    along: Callable[[Array, Setting], Array],
) -> Operator:
    return Operator(
        name,
        f"{summary}, as a fraction of the training range. Instead of `widths`, a `count` gives the "
        "number of evenly spaced widths. Without `widths` and `count`, training estimates one "
        "width.",
        recursion,
        (WIDTHS,),
        "range",
        starts=lambda _step, _longest: STARTS,
        spread=spread_widths,
        along=along,
        timed=False,
    )


OPERATORS = (
    _with_widths(
        "play",
        "`play` operators (backlash) on the quantities in `of`. Each number in `widths` is half "
        "the gap of an operator",
        play_recursion,
        lambda x, setting: play(x, setting.width),
    ),
    _with_widths(
        "stop",
        "`stop` operators (friction that sticks before it slips) on the quantities in `of`. "
        "Each number in `widths` is half the distance that the input moves after a reversal until "
        "the operator slips",
        stop_recursion,
        lambda x, setting: x - play(x, setting.width),
    ),
)
