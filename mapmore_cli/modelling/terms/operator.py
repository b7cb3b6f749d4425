"""What is declared of an operator with memory: the form of its file in `operators/`, and helpers to write one.

An operator turns a state x into a new one by a causal rule that is the same at all times. Its file says how it is written, computed along
a recording, computed sample by sample where the output is fed back, printed, and what a spec may set of it. Nothing else knows of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mapmore_cli.domain.arrays import Array


@dataclass(frozen=True)
class Parameter:
    """One number of an operator.

    Attributes
    ----------
    key
        What a spec calls it, or a list of it.
    unit
        The unit that a name's number is in; `1` for a ratio.
    example
        A value as a spec's author would write it.
    below
        What it has to be smaller than; every number is positive.
    """

    key: str
    unit: Literal["s", "Hz", "1"]
    example: str
    below: float = math.inf


@dataclass(frozen=True)
class Setting:
    """What a state of an operator depends on besides its source.

    Attributes
    ----------
    numbers
        Those of the state's name, or those that training found.
    step
        Time between samples, s.
    limits
        Training range of the source; NaN for operators that do not need it.
    """

    numbers: tuple[float, ...]
    step: float
    limits: tuple[float, float] = (math.nan, math.nan)

    @property
    def width(self) -> float:
        """The first number as a fraction of the source's training range, in the source's unit."""
        low, high = self.limits
        return self.numbers[0] * (high - low)


@dataclass(frozen=True)
class Recursion:
    """An operator from one sample to the next: `s[k] = next(s[k-1], ..., s[k-p], x[k], ..., x[k-q])`.

    Attributes
    ----------
    own, source
        How many past values of its own, p, and of its source, q, it needs.
    next
        The new value, of p + q + 1 numbers in the order above.
    rest
        The value where the source has stood at x for ever.
    slopes
        Derivatives of s[k] for the same p + q + 1 numbers, each (n,) or one for all samples, given s and x, (n,) each.
    """

    own: int
    source: int
    next: Callable[..., float]
    rest: Callable[[float], float]
    slopes: Callable[[Array, Array], tuple[Array | float, ...]]


@dataclass(frozen=True)
class Operator:
    """Everything that is known of an operator.

    Attributes
    ----------
    name
        As in `slow(pressure, 0.3)`.
    summary
        What a spec's author reads of its family.
    along
        Its values on one uninterrupted piece, (n,), from those of its source; NaN where the source is NaN at the beginning, at rest then.
    recursion
        The same, sample by sample, as a free run needs it where the source depends on the output.
    parameters
        Its numbers, in the order of its name.
    needs
        What training has to find of the source: its `range`, which widths are fractions of; or the `oscillator` that it drives, where the
        name has no numbers.
    spread
        Numbers where a spec gives a `count` of them: of that count, the time between samples and the longest piece's duration, both s.
    family
        The key of the spec's family that writes it, if that is not its name: a family may write several operators.
    """

    name: str
    summary: str
    along: Callable[[Array, Setting], Array]
    recursion: Callable[[Setting], Recursion]
    parameters: tuple[Parameter, ...] = ()
    needs: Literal["range", "oscillator"] | None = None
    spread: Callable[[int, float, float], tuple[float, ...]] | None = None
    family: str = ""

    @property
    def counts(self) -> tuple[int, ...]:
        """How many numbers may stand in a name: none as well, where training finds them."""
        return (0, len(self.parameters)) if self.needs == "oscillator" else (len(self.parameters),)

    @property
    def latex(self) -> str:
        """The name upright."""
        return rf"\mathrm{{{self.name.replace('_', chr(92) + '_')}}}"


def beginning(x: Array) -> int:
    """Index of the first sample that is not empty; the length where there is none."""
    known = ~np.isnan(x)
    return int(np.argmax(known)) if known.any() else len(x)


def filtered_from_rest(x: Array, b: Sequence[float], a: Sequence[float]) -> Array:
    """The linear filter of unit gain with coefficients b (of x) and a, (n,), as if x had stood at its first value for ever."""
    from scipy.signal import lfilter

    begin = beginning(x)
    values = np.full(len(x), np.nan)
    rest = x[begin : begin + 1].sum()
    values[begin:] = np.asarray(lfilter(b, a, x[begin:] - rest)) + rest
    return values
