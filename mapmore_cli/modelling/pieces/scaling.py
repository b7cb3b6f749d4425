"""Scaling of a segment's data before term selection (M1 step 1, M2 step i)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import TypeVar

import numpy as np

from mapmore_cli.domain.arrays import Array, Value
from mapmore_cli.domain.fits import Scaling

V = TypeVar("V", Array, Value)

END_FRACTION = 0.05
"""Share of the segment whose mean stands for an end of the trend, so that the anchor does not hang on one noisy sample."""

EVERY_CORNER_UP_TO = 3
"""Variables for which all `2^v` corners are tried as origins; beyond, only all-left and all-right."""


def placements(rule: str, X: Array, y: Array, variables: Sequence[str]) -> tuple[Scaling, ...]:
    """Return all scalings that satisfy a rule; the caller keeps the one with the least training error.

    - `unit_square`: x and y span one unit and the trend passes through the origin, which lies at the left or at the right end of each
      variable: scaled data lie in [0, 1] or [-1, 0]. The two are not equivalent for one-term fits, since left-anchored powers of a
      falling curve are concave and right-anchored ones convex.
    - `max_abs`: division by the largest magnitude, no offset.
    - `none`: data as they are.

    Parameters
    ----------
    X
        Independent variables, (n, v).
    y
        Dependent variable, (n,).
    """
    names = tuple(variables)
    count = len(names)
    if rule == "unit_square":
        return tuple(_anchored(X, y, names, right) for right in _corners(count))
    slope, y_slope = np.ones(count), 1.0
    if rule == "max_abs":
        slope, y_slope = 1 / _span(np.abs(X).max(axis=0)), float(_span(np.abs(y).max()))
    elif rule != "none":
        raise ValueError(f"unknown scaling rule {rule!r}: unit_square, max_abs or none")
    return (Scaling(rule, "-", names, slope, np.zeros(count), y_slope, 0.0),)


def _corners(count: int) -> list[tuple[bool, ...]]:
    if count > EVERY_CORNER_UP_TO:
        return [(False,) * count, (True,) * count]
    return list(product((False, True), repeat=count))


def _anchored(X: Array, y: Array, variables: tuple[str, ...], right: tuple[bool, ...]) -> Scaling:
    low, high = X.min(axis=0), X.max(axis=0)
    slope = 1 / _span(high - low)
    anchor = np.where(right, high, low)
    return Scaling(
        rule="unit_square",
        placement=",".join("right" if r else "left" for r in right) or "-",
        variables=variables,
        slope=slope,
        intercept=-slope * anchor,
        y_slope=float(_span(y.max() - y.min())),
        y_intercept=_end_value(np.abs(X - anchor) * slope, y),
    )


def _end_value(distance: Array, y: Array) -> float:
    """Return the mean of y over the samples nearest to the anchor; all at the same distance count, so the order of rows does not matter."""
    if distance.shape[1] == 0:
        return 0.0
    far = distance.max(axis=1)
    nearest = max(1, int(np.ceil(END_FRACTION * len(y))))
    return float(y[far <= np.partition(far, nearest - 1)[nearest - 1]].mean())


def _span(width: Array) -> Array:
    """Return widths to divide by; a constant variable stays as it is."""
    return np.where(width > 0, width, 1.0)


def scaled(scaling: Scaling, columns: Mapping[str, V]) -> dict[str, V]:
    """Return independent variables in scaled coordinates, `z = slope x + intercept` (M2 eq 8)."""
    return {name: columns[name] * m + c for name, m, c in zip(scaling.variables, scaling.slope, scaling.intercept, strict=True)}
