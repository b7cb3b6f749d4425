"""Saturation: the quantity, held at the ends of its training range."""

from __future__ import annotations

from mapmore_cli.modelling.expressions.operator import Operator, Recursion, Setting


def recursion(setting: Setting) -> Recursion:
    """Return `s[k] = min(max(x[k], low), high)`; it has no memory."""
    low, high = setting.limits
    return Recursion(0, 0, lambda m, x: m.clip(x, low, high), lambda x: x)


OPERATORS = (
    Operator(
        name="saturate",
        summary="The quantities `of`, held at the ends of their training range.",
        recursion=recursion,
        needs="range",
    ),
)
