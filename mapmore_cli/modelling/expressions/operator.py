"""Define the classes that describe an operator with memory, for example a first-order lag. The
operators themselves are in the files of `operators/`.

An operator turns a state x into a new state by a causal rule that does not change over time. The
file of an operator defines its name, its parameters, how its state is computed and printed, and the
keys with which a spec sets it. All other modules treat all operators alike.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import mul
from typing import Any, Literal

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.expressions.functions import FUNCTIONS


@dataclass(frozen=True)
class Parameter:
    """A numerical parameter of an operator, for example a time constant.

    - `key`: name in a spec, for one value or a list of values.
    - `unit`: unit of the number in the name of a state; `1` for a ratio.
    - `example`: a value as the author of a spec would write it.
    - `above`, `below`: limits between which the number must lie, not included.
    - `or_zero`: True if the number may also be 0.
    - `between`: function that returns the smallest and the largest value that training tries. Its
      arguments are the time between samples and the duration of the longest piece, both in s.
    """

    key: str
    unit: Literal["s", "Hz", "1"]
    example: str
    below: float = math.inf
    above: float = 0.0
    between: Callable[[float, float], tuple[float, float]] | None = None
    or_zero: bool = False

    def allows(self, number: float) -> bool:
        """Return True if the parameter can have this value."""
        return self.above < number < self.below or (self.or_zero and number == 0)


@dataclass(frozen=True)
class Setting:
    """Numbers from which, together with the values of the source, the values of an operator's state
    are computed.

    - `numbers`: numbers from the name of the state, or estimated in training.
    - `step`: time between samples, s.
    - `limits`: training range of the source; NaN for operators that do not need it.
    """

    numbers: tuple[float, ...]
    step: float
    limits: tuple[float, float] = (math.nan, math.nan)

    @property
    def width(self) -> float:
        """Width in the unit of the source: the first number of the operator, multiplied by the
        difference between the largest and the smallest training value of the source.
        """
        low, high = self.limits
        return self.numbers[0] * (high - low)


Amount = Any
"""A value that a rule computes with: a float, a column of shape (n,), or an expression of a
program.
"""


class Arithmetic:
    """Operations that the rule of an operator may use, in addition to `+ - * / **` and comparisons.
    This class computes with whole columns; its subclasses compute with single numbers or write
    statements of a program.

    In `where`, the arguments `then` and `otherwise` are values, or functions without arguments that
    compute a value. This class computes both values for all rows; a subclass may compute only one
    of them.
    """

    def where(self, condition: Amount, then: Amount, otherwise: Amount) -> Amount:
        """Return the values of `then` in rows in which the condition is true, and the values of
        `otherwise` in all other rows.
        """
        return np.where(
            condition, *(side() if callable(side) else side for side in (then, otherwise))
        )

    def clip(self, x: Amount, low: Amount, high: Amount) -> Amount:
        """Return x limited to the interval from low to high."""
        return np.clip(x, low, high)

    def call(self, function: str, x: Amount) -> Amount:
        """Return `function(x)`. The function is named by its key in `FUNCTIONS`."""
        return FUNCTIONS[function].compute(x)


class _Floats(Arithmetic):
    """Operations on single numbers. Of the two values in `where`, only the one that the condition
    selects is computed.
    """

    def where(self, condition: Amount, then: Amount, otherwise: Amount) -> Amount:
        chosen = then if condition else otherwise
        return chosen() if callable(chosen) else chosen

    def clip(self, x: Amount, low: Amount, high: Amount) -> Amount:
        return low if low is not None and x < low else high if high is not None and x > high else x

    def call(self, function: str, x: Amount) -> Amount:
        return float(FUNCTIONS[function].compute(x))


COLUMNS, FLOATS = Arithmetic(), _Floats()


@dataclass(frozen=True)
class Recursion:
    """Rule that computes the state s of an operator from one sample to the next: `s[k] = next(m,
    s[k-1], ..., s[k-p], x[k], ..., x[k-q])`. Here, x is the source and m holds the operations
    (`Arithmetic`).

    This is the only definition of an operator: values along a recording, steps of a free run,
    derivatives and exported code are derived from it. `next` is called with floats, with columns
    and, for exported code, with names of variables. Therefore it must branch with `m.where` instead
    of `if`.

    - `own`, `source`: number of past values of the state, p, and of its source, q, that the rule
      needs.
    - `next`: function that returns s[k]. Its arguments are m and the p + q + 1 values in the order
      above.
    - `rest`: value of the state if the source has always been x.
    - `weights`: the p + q + 1 weights of a linear operator; None for other operators.
    """

    own: int
    source: int
    next: Callable[..., Amount]
    rest: Callable[[Amount], Amount]
    weights: tuple[float, ...] | None = None


def linear(past: Sequence[float], driven: Sequence[float], steady: float = 1.0) -> Recursion:
    """Return the linear recursion `s[k] = sum_i past_i s[k-i] + sum_j driven_j x[k-j]`, with i from
    1 and j from 0. If x is constant, s approaches `steady` times x.
    """
    weights = (*past, *driven)
    return Recursion(
        len(past),
        len(driven) - 1,
        lambda _m, *values: sum(map(mul, weights, values)),
        lambda x: steady * x,
        weights,
    )


@dataclass(frozen=True)
class Operator:
    """An operator with memory.

    - `name`: name in a state, for example `slow` in `slow(pressure, 0.3)`.
    - `summary`: explanation for the author of a spec. The summary of the first operator of a family
      explains the whole family.
    - `recursion`: function that returns the rule from one sample to the next.
    - `parameters`: its parameters, in the order of the numbers in the name of a state.
    - `needs`: what training must determine: the `range` of the source, if widths are fractions of
      this range; or the `oscillator` that the source drives, if the name has no numbers.
    - `starts`: function that returns the sets of starting values for the search in training. Its
      arguments are the time between samples and the duration of the longest piece, both in s. None
      if training cannot estimate the numbers.
    - `spread`: function that chooses the numbers if a spec gives only their `count`. Its arguments
      are this count, the time between samples and the duration of the longest piece, both in s.
    - `family`: key of the family in a spec, if it is not `name`. A family may consist of several
      operators.
    - `along`: function that computes the values on one uninterrupted piece, shape (n,), which
      begins at rest. It is faster than the recursion, which is used if `along` is None.
    - `timed`: True if the operator needs equal time steps. Otherwise the order of the samples is
      enough.
    """

    name: str
    summary: str
    recursion: Callable[[Setting], Recursion]
    parameters: tuple[Parameter, ...] = ()
    needs: Literal["range", "oscillator"] | None = None
    starts: Callable[[float, float], tuple[tuple[float, ...], ...]] | None = None
    spread: Callable[[int, float, float], tuple[float, ...]] | None = None
    family: str = ""
    along: Callable[[Array, Setting], Array] | None = None
    timed: bool = True

    @property
    def counts(self) -> tuple[int, ...]:
        """Return the possible counts of numbers in the name of a state, for example `(0, 2)`. The
        count 0 is possible if training can estimate the numbers.
        """
        return (0, len(self.parameters)) if self.found else (len(self.parameters),)

    @property
    def found(self) -> bool:
        """Return True if training estimates the numbers of the operator when the name of a state
        does not contain them.
        """
        return self.needs == "oscillator" or self.starts is not None

    @property
    def latex(self) -> str:
        """Name of the operator as LaTeX source, in upright letters."""
        return rf"\mathrm{{{self.name.replace('_', chr(92) + '_')}}}"


# Compute a state along a piece of a recording
# -------------------------------------------------------------------------------------------------

NOTHING_BEFORE = (np.empty(0), np.empty(0))


def along(
    operator: Operator, x: Array, setting: Setting, before: tuple[Array, Array] = NOTHING_BEFORE
) -> Array:
    """Return the state of an operator along one uninterrupted piece with the source x, shape (n,).
    If x begins with NaN, the state is NaN at the same samples. At the first finite value of x, the
    state is at rest.

    If the piece continues an earlier piece, the state continues too. `before` then holds the last
    values of the state and of the source in the earlier piece.
    """
    states, source = map(_from_first_number, before)
    if len(states):
        rule = operator.recursion(setting)
        return run_recursion(rule, x, _latest(states, rule.own), _latest(source, rule.source))
    values = np.full(len(x), np.nan)
    known = ~np.isnan(x)
    if known.any():
        begin = int(np.argmax(known))
        values[begin:] = (
            operator.along(x[begin:], setting)
            if operator.along
            else from_rest(operator.recursion(setting), x[begin:])
        )
    return values


def _from_first_number(values: Array) -> Array:
    """Return the values without the NaN at the beginning."""
    known = ~np.isnan(values)
    return values[int(np.argmax(known)) if known.any() else len(values) :]


def _latest(values: Array, count: int) -> list[float]:
    """Return the last `count` values, the latest first. If there are fewer values, the first value
    is repeated.
    """
    last: list[float] = values[: -count - 1 : -1].tolist()
    return last + [float(values[0])] * (count - len(last))


def from_rest(rule: Recursion, x: Array) -> Array:
    """Return the values of a recursion along x, shape (n,), beginning at rest: x is assumed to have
    had the value x[0] at all times before the first sample.
    """
    first = float(x[0])
    if rule.own == 0:
        return run_recursion(rule, x, [], [first] * rule.source)
    rest = float(rule.rest(first))
    return np.append(rest, run_recursion(rule, x[1:], [rest] * rule.own, [first] * rule.source))


def run_recursion(rule: Recursion, x: Array, states: list[float], past: list[float]) -> Array:
    """Return the values of a recursion along x, shape (n,). `states` holds the last values of the
    state, and `past` holds the last values of x, the latest first.

    A linear recursion is computed as a filter, and a recursion without memory for all samples at
    once. Any other recursion is computed sample by sample.
    """
    if rule.own == 0:
        whole, n = np.concatenate([past[::-1], x]), len(past)
        delayed = [whole[n - lag : len(whole) - lag] for lag in range(rule.source + 1)]
        return np.asarray(rule.next(COLUMNS, *delayed))
    if rule.weights is not None:
        from scipy.signal import lfilter

        a, b = [1.0, *(-weight for weight in rule.weights[: rule.own])], rule.weights[rule.own :]
        # Compute the contribution of the values before x[0] to the filter.
        # SciPy's `lfiltic` is not used, because for short pieces it takes longer than the filter.
        carried = [
            sum(map(mul, b[step:], past)) - sum(map(mul, a[step:], states))
            for step in range(1, max(len(a), len(b)))
        ]
        return np.asarray(lfilter(b, a, x, zi=carried)[0])
    values = []
    for now in x.tolist():
        value = rule.next(FLOATS, *states, now, *past)
        values.append(value)
        states, past = [value, *states[:-1]], [now, *past][: rule.source]
    return np.array(values)
