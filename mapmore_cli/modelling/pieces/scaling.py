"""Scaling of a segment's data before term selection (M1 step 1, M2 step i), and segment functions in physical units (M2 eq 8)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from itertools import product
from typing import TypeVar

import numpy as np

from mapmore_cli.domain.arrays import Array, Value
from mapmore_cli.domain.fits import Scaling
from mapmore_cli.domain.models import SegmentFunction
from mapmore_cli.modelling.terms import Compiled, compiled, derivative, parse

V = TypeVar("V", Array, Value)

END_FRACTION = 0.05
"""Share of the segment whose mean stands for an end of the trend, so that the anchor does not hang on one noisy sample."""

EVERY_CORNER_UP_TO = 3
"""Variables for which all `2^v` corners are tried as origins; beyond, only all-left and all-right."""


def placements(rule: str, X: Array, y: Array, variables: Sequence[str]) -> tuple[Scaling, ...]:
    """All scalings that satisfy a rule; the caller keeps the one with the least training error.

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
    """Mean of y over the samples nearest to the anchor; all at the same distance count, so the order of rows does not matter."""
    if distance.shape[1] == 0:
        return 0.0
    far = distance.max(axis=1)
    nearest = max(1, int(np.ceil(END_FRACTION * len(y))))
    return float(y[far <= np.partition(far, nearest - 1)[nearest - 1]].mean())


def _span(width: Array) -> Array:
    """Widths to divide by; a constant variable stays as it is."""
    return np.where(width > 0, width, 1.0)


def scaled(scaling: Scaling, columns: Mapping[str, V]) -> dict[str, V]:
    """Independent variables in scaled coordinates, `z = slope x + intercept` (M2 eq 8)."""
    return {name: columns[name] * m + c for name, m, c in zip(scaling.variables, scaling.slope, scaling.intercept, strict=True)}


def prepared(segment: SegmentFunction) -> Callable[[Mapping[str, Value]], Value]:
    """The segment function, for many calls: its value at every row, (n,); one number where every column that it needs is one."""
    scaling, program = segment.scaling, _program(segment.terms)
    factors, constant = list(segment.theta * scaling.y_slope), np.float64(scaling.y_intercept)
    return lambda columns: _combination(factors, program.values(scaled(scaling, columns)), constant)


def segment_slope(segment: SegmentFunction, columns: Mapping[str, Value], name: str) -> Value:
    """Derivative of the segment function with respect to one input."""
    scaling = segment.scaling
    if name not in scaling.variables:
        return np.float64(0.0)
    outer = scaling.y_slope * scaling.slope[scaling.variables.index(name)]
    return _combination(segment.theta * outer, _slopes(segment.terms, name).values(scaled(scaling, columns)), np.float64(0.0))


def _combination(factors: Iterable[np.float64], values: Iterable[Value], constant: np.float64) -> Value:
    total: Value = constant
    for factor, value in zip(factors, values, strict=True):
        total = total + factor * value
    return total


@lru_cache(maxsize=4096)
def _program(terms: tuple[str, ...]) -> Compiled:
    return compiled(tuple(map(parse, terms)))


@lru_cache(maxsize=4096)
def _slopes(terms: tuple[str, ...], name: str) -> Compiled:
    return compiled(tuple(derivative(parse(term), name) for term in terms))
