"""Saturation: the quantity, held at the ends of its training range."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.terms.operator import Operator, Recursion, Setting


def recursion(setting: Setting) -> Recursion:
    """Sample by sample; it has no memory."""
    low, high = setting.limits

    def slopes(_s: Array, x: Array) -> tuple[Array]:
        return (((x > low) & (x < high)).astype(np.float64),)

    return Recursion(0, 0, lambda x: min(max(x, low), high), lambda x: min(max(x, low), high), slopes)


OPERATORS = (
    Operator(
        name="saturate",
        summary="The quantities `of`, held at the ends of their training range.",
        along=lambda x, setting: np.clip(x, *setting.limits),
        recursion=recursion,
        needs="range",
    ),
)
