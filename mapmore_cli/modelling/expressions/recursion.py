"""Run operators along a piece of a recording, from their recursions."""

from __future__ import annotations

from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.expressions.functions import FUNCTIONS
from mapmore_cli.modelling.expressions.operator import Arithmetic, Operator, Recursion, Setting


class _Floats:
    """One number at a time; of a branch only the side that counts is computed."""

    def where(self, condition: Any, then: Any, otherwise: Any) -> Any:
        chosen = then if condition else otherwise
        return chosen() if callable(chosen) else chosen

    def clip(self, x: Any, low: Any, high: Any) -> Any:
        return low if low is not None and x < low else high if high is not None and x > high else x

    def call(self, function: str, x: Any) -> Any:
        return float(FUNCTIONS[function].compute(x))


class _Columns:
    """Whole columns; both sides of a branch are computed."""

    def where(self, condition: Any, then: Any, otherwise: Any) -> Any:
        return np.where(condition, *(side() if callable(side) else side for side in (then, otherwise)))

    def clip(self, x: Any, low: Any, high: Any) -> Any:
        return np.clip(x, low, high)

    def call(self, function: str, x: Any) -> Any:
        return FUNCTIONS[function].compute(x)


FLOATS: Arithmetic = _Floats()
COLUMNS: Arithmetic = _Columns()


def along(operator: Operator, x: Array, setting: Setting) -> Array:
    """Return the state along one uninterrupted piece, (n,); NaN where the source x is NaN at the beginning, at rest then."""
    begin = _beginning(x)
    values = np.full(len(x), np.nan)
    if begin < len(x):
        known = x[begin:]
        values[begin:] = operator.along(known, setting) if operator.along else followed(operator.recursion(setting), known)
    return values


def followed(rule: Recursion, x: Array) -> Array:
    """Return a recursion along x, (n,), as if x had always been x[0] before.

    A linear one is a filter, one without memory is computed for all samples at once, any other sample by sample.
    """
    rest = float(rule.rest(float(x[0])))
    if rule.own == 0:
        delayed = [np.concatenate([np.full(min(lag, len(x)), x[0]), x[: len(x) - lag]]) for lag in range(rule.source + 1)]
        return np.asarray(rule.next(COLUMNS, *delayed))
    if rule.weights is not None:
        return np.concatenate([[rest], _filtered(rule, x, rest)])
    own, past, values = [rest] * rule.own, [float(x[0])] * rule.source, [rest]
    for now in x[1:].tolist():
        value = rule.next(FLOATS, *own, now, *past)
        values.append(value)
        own, past = [value, *own[:-1]], [now, *past][: rule.source]
    return np.array(values)


def _filtered(rule: Recursion, x: Array, rest: float) -> Array:
    """Return the samples after the first."""
    from scipy.signal import lfilter, lfiltic

    assert rule.weights is not None
    a, b = [1.0, *(-weight for weight in rule.weights[: rule.own])], rule.weights[rule.own :]
    start = lfiltic(b, a, [rest] * rule.own, [x[0]] * rule.source)
    return np.asarray(lfilter(b, a, x[1:], zi=start)[0])


def _beginning(x: Array) -> int:
    """Return the index of the first sample that is not empty; the length where there is none."""
    known = ~np.isnan(x)
    return int(np.argmax(known)) if known.any() else len(x)
