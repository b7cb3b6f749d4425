"""Segment functions in physical units: `f(x) = y_slope sum_k theta_k D_k(slope x + intercept) + y_intercept` (M2 eq 8)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache

import numpy as np

from mapmore_cli.domain.arrays import Value
from mapmore_cli.domain.models import SegmentFunction
from mapmore_cli.modelling.pieces.scaling import scaled
from mapmore_cli.modelling.terms import Program, compiled, derivative, parse


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
def _program(terms: tuple[str, ...]) -> Program:
    return compiled(tuple(map(parse, terms)))


@lru_cache(maxsize=4096)
def _slopes(terms: tuple[str, ...], name: str) -> Program:
    return compiled(tuple(derivative(parse(term), name) for term in terms))
