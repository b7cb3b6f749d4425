"""Operators with memory: the form of a file in `operators/`.

An operator turns a state x into a new one by a causal rule that is the same at all times. Its file
says how it is written, its recursion, how it is printed, and what a spec may set of it. Nothing
else knows of it.
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
    """One number of an operator.

    - `key`: what a spec calls it, or a list of it.
    - `unit`: the unit that a name's number is in; `1` for a ratio.
    - `example`: a value as a spec's author would write it.
    - `above`, `below`: what it has to be larger and smaller than.
    - `between`: least and greatest value that training tries, of the time between samples and the
      longest piece's duration, both s.
    """

    key: str
    unit: Literal["s", "Hz", "1"]
    example: str
    below: float = math.inf
    above: float = 0.0
    between: Callable[[float, float], tuple[float, float]] | None = None


@dataclass(frozen=True)
class Setting:
    """Settings on which a state of an operator depends besides its source.

    - `numbers`: those of the state's name, or those that training found.
    - `step`: time between samples, s.
    - `limits`: training range of the source; NaN for operators that do not need it.
    """

    numbers: tuple[float, ...]
    step: float
    limits: tuple[float, float] = (math.nan, math.nan)

    @property
    def width(self) -> float:
        """The first number as a fraction of the source's training range, in the source's unit."""
        low, high = self.limits
        return self.numbers[0] * (high - low)


Amount = Any
"""What a rule computes with: a float, a column, (n,), or an expression of a program."""


class Arithmetic:
    """What a recursion computes with beside `+ - * / **` and comparisons: here whole columns,
    elsewhere floats or statements of a program.

    `then` and `otherwise` are values, or functions without arguments that compute one; for columns
    both are computed.
    """

    def where(self, condition: Amount, then: Amount, otherwise: Amount) -> Amount:
        """Return `then` if the condition holds, otherwise `otherwise`."""
        return np.where(
            condition, *(side() if callable(side) else side for side in (then, otherwise))
        )

    def clip(self, x: Amount, low: Amount, high: Amount) -> Amount:
        """Return x, held at low and high."""
        return np.clip(x, low, high)

    def call(self, function: str, x: Amount) -> Amount:
        """Return the value of one of `FUNCTIONS` at x."""
        return FUNCTIONS[function].compute(x)


class _Floats(Arithmetic):
    """One number at a time; of a branch only the side that counts is computed."""

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
    """An operator from one sample to the next: `s[k] = next(m, s[k-1], ..., s[k-p], x[k], ...,
    x[k-q])`.

    This is the one definition of an operator: values along a recording, steps of a free run,
    derivatives and exported code follow from it. `next` is called with floats, with columns and
    with the names of a program, so it branches by `m.where` and not by `if`.

    - `own`, `source`: how many past values of its own, p, and of its source, q, it needs.
    - `next`: the new value, of the arithmetic m and p + q + 1 numbers in the order above.
    - `rest`: the value where the source has always been x.
    - `weights`: of a linear operator, the p + q + 1 weights; None for others.
    """

    own: int
    source: int
    next: Callable[..., Amount]
    rest: Callable[[Amount], Amount]
    weights: tuple[float, ...] | None = None


def linear(past: Sequence[float], driven: Sequence[float], steady: float = 1.0) -> Recursion:
    """Return the recursion `s[k] = sum_i past_i s[k-i] + sum_j driven_j x[k-j]`, i from 1, j from
    0; at rest s is `steady` times x.
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
    """Everything that is known of an operator.

    - `name`: as in `slow(pressure, 0.3)`.
    - `summary`: what a spec's author reads of its family.
    - `recursion`: from one sample to the next.
    - `parameters`: its numbers, in the order of its name.
    - `needs`: what training has to find of the source: its `range`, which widths are fractions of;
      or the `oscillator` that it drives,
      where the name has no numbers.
    - `starts`: where training can find its numbers: sets of them to begin from, of the time between
      samples and the longest piece's
      duration, s.
    - `spread`: numbers where a spec gives a `count` of them: of that count, the time between
      samples and the longest piece's duration, both
      s.
    - `family`: the key of the spec's family that writes it, if that is not its name: a family may
      write several operators.
    - `along`: a faster way to compute its values on one uninterrupted piece, (n,), which begins at
      rest; None takes the recursion.
    - `timed`: whether it needs even steps of time; else the order of samples is enough.
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
        """How many numbers may stand in a name: none as well, where training finds them."""
        return (0, len(self.parameters)) if self.found else (len(self.parameters),)

    @property
    def found(self) -> bool:
        """Whether training finds numbers that a name leaves out."""
        return self.needs == "oscillator" or self.starts is not None

    @property
    def latex(self) -> str:
        """The name upright."""
        return rf"\mathrm{{{self.name.replace('_', chr(92) + '_')}}}"


# Run along a piece of a recording
# -------------------------------------------------------------------------------------------------

NOTHING_BEFORE = (np.empty(0), np.empty(0))


def along(
    operator: Operator, x: Array, setting: Setting, before: tuple[Array, Array] = NOTHING_BEFORE
) -> Array:
    """Return the state along one uninterrupted piece, (n,); NaN where the source x is NaN at the
    beginning, at rest then. Where the piece goes on, its own last values and those of the source
    came `before`.
    """
    own, source = map(_from_first_number, before)
    if len(own):
        rule = operator.recursion(setting)
        return run_recursion(rule, x, _latest(own, rule.own), _latest(source, rule.source))
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
    """Return the values from the first that is a number."""
    known = ~np.isnan(values)
    return values[int(np.argmax(known)) if known.any() else len(values) :]


def _latest(values: Array, count: int) -> list[float]:
    """Return the last values, the last first; before the first of them, it has always been that."""
    last: list[float] = values[: -count - 1 : -1].tolist()
    return last + [float(values[0])] * (count - len(last))


def from_rest(rule: Recursion, x: Array) -> Array:
    """Return a recursion along x, (n,), as if x had always been x[0] before."""
    first = float(x[0])
    if rule.own == 0:
        return run_recursion(rule, x, [], [first] * rule.source)
    rest = float(rule.rest(first))
    return np.append(rest, run_recursion(rule, x[1:], [rest] * rule.own, [first] * rule.source))


def run_recursion(rule: Recursion, x: Array, own: list[float], past: list[float]) -> Array:
    """Return a recursion along x, (n,), from its own last values and the `past` of x, the last
    first.

    A linear one is a filter, one without memory is computed for all samples at once, any other
    sample by sample.
    """
    if rule.own == 0:
        whole, n = np.concatenate([past[::-1], x]), len(past)
        delayed = [whole[n - lag : len(whole) - lag] for lag in range(rule.source + 1)]
        return np.asarray(rule.next(COLUMNS, *delayed))
    if rule.weights is not None:
        from scipy.signal import lfilter, lfiltic

        a, b = [1.0, *(-weight for weight in rule.weights[: rule.own])], rule.weights[rule.own :]
        return lfilter(b, a, x, zi=lfiltic(b, a, own, past))[0]
    values = []
    for now in x.tolist():
        value = rule.next(FLOATS, *own, now, *past)
        values.append(value)
        own, past = [value, *own[:-1]], [now, *past][: rule.source]
    return np.array(values)
