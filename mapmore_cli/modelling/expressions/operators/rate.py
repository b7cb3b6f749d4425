"""Rate of change, and the direction that it had last: for signals whose rate is not measured, the
fed-back output among them.
"""

from __future__ import annotations

from typing import Any

from mapmore_cli.modelling.expressions.operator import (
    Arithmetic,
    Operator,
    Recursion,
    Setting,
    linear,
)


def rate(setting: Setting) -> Recursion:
    """Return `(x[k] - x[k-1])/step`, per second."""
    return linear([], [1 / setting.step, -1 / setting.step], steady=0.0)


def direction(_setting: Setting) -> Recursion:
    """Return 1 after x has risen, -1 after it has fallen, 0 before it has moved; of `play(x, r)`,
    with a dead band of r.
    """

    def following(m: Arithmetic, s: Any, x: Any, before: Any) -> Any:
        return m.where(x > before, 1.0, lambda: m.where(x < before, -1.0, s))

    return Recursion(1, 1, following, lambda x: 0.0 * x)


OPERATORS = (
    Operator(
        name="rate",
        summary="The change of the quantities `of` per second, from one sample to the next.",
        recursion=rate,
    ),
    Operator(
        name="direction",
        summary=(
            "The sign of the last change of the quantities `of`; of `play(pressure, 0.02)`, "
            "one that small changes do not turn."
        ),
        recursion=direction,
    ),
)
