"""States with memory as names: `force[k-1]`, `slow(play(pressure, 0.16), 0.3)`; how they are read and written.

    state    = ( quantity | operator "(" state { "," number } ")" ) [ "[" "k" "-" steps "]" ]

In an expression a state is one name, by its canonical text; `modelling.memory` computes its values.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from mapmore_cli.modelling.expressions.errors import ExpressionError
from mapmore_cli.modelling.expressions.functions import FUNCTIONS
from mapmore_cli.modelling.expressions.operators import OPERATORS

MAX_NESTING = 8
MAX_STEPS = 1_000_000
_SPACE = re.compile(r"\s*", re.ASCII)
_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*", re.ASCII)
_NUMBER = re.compile(r"-?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?", re.ASCII)
_LAG = re.compile(r"\[\s*k\s*-\s*([0-9]{1,7})\s*\]", re.ASCII)


@dataclass(frozen=True)
class Measured:
    """A quantity as it is now."""

    name: str

    @property
    def quantity(self) -> str:
        """The measured quantity that the state is made of."""
        return self.name


@dataclass(frozen=True)
class Lagged:
    """`source` some samples ago."""

    source: State
    steps: int

    @property
    def name(self) -> str:
        """As `force[k-2]`."""
        return f"{self.source.name}[k-{self.steps}]"

    @property
    def quantity(self) -> str:
        """The measured quantity that the state is made of."""
        return self.source.quantity


@dataclass(frozen=True)
class Operated:
    """An operator of `OPERATORS` along the history of `source`."""

    operator: str
    source: State
    numbers: tuple[float, ...] = ()

    @property
    def name(self) -> str:
        """As `play(pressure, 0.16)`."""
        return f"{self.operator}({', '.join([self.source.name, *map(_number_text, self.numbers)])})"

    @property
    def quantity(self) -> str:
        """The measured quantity that the state is made of."""
        return self.source.quantity


State = Measured | Lagged | Operated


def lagged(source: State, steps: int) -> State:
    """`source` so many samples ago; itself where that is none."""
    return source if steps == 0 else Lagged(source, steps)


def state(text: str) -> State:
    """Return the state that `text` names. Raises ExpressionError where it names none."""
    found, end = read_state(text, 0)
    if _past_space(text, end) < len(text):
        raise ExpressionError(f"{text!r} goes on after the name of a state", end)
    return found


def opens_state(text: str, name: str, end: int) -> bool:
    """Whether the identifier `name`, which ends at `end` of `text`, begins the name of a state with memory."""
    mark = text[_past_space(text, end) :][:1]
    return mark == "[" or (mark == "(" and name in OPERATORS)


def read_state(text: str, start: int, depth: int = 0) -> tuple[State, int]:
    """Return the state whose name begins at `start`, and where it ends.

    Raises ExpressionError with the place of the first character that does not fit.
    """
    start = _past_space(text, start)
    word = _IDENTIFIER.match(text, start)
    if word is None or word[0] in FUNCTIONS:
        raise ExpressionError("expected the name of a quantity or of an operator with memory", start)
    if depth > MAX_NESTING:
        raise ExpressionError(f"more than {MAX_NESTING} operators inside each other", start)
    source, end = _operated(text, word[0], word.end(), depth)
    at = _past_space(text, end)
    if text[at : at + 1] != "[":
        return source, end
    lag = _LAG.match(text, at)
    if lag is None or not 1 <= int(lag[1]) <= MAX_STEPS:
        raise ExpressionError("a delay is written [k-1], [k-2], ...", at)
    return Lagged(source, int(lag[1])), lag.end()


def _operated(text: str, name: str, end: int, depth: int) -> tuple[State, int]:
    """Return the quantity `name`, or the operator of that name with what stands in its bracket."""
    opening = _past(text, end, "(")
    if opening is None:
        return Measured(name), end
    if name not in OPERATORS:
        raise ExpressionError(f"there is no operator with memory `{name[:40]}`; there are {', '.join(OPERATORS)}", end - len(name))
    source, end = read_state(text, opening, depth + 1)
    numbers: list[float] = []
    while (comma := _past(text, end, ",")) is not None:
        digits = _NUMBER.match(text, comma)
        if digits is None or not math.isfinite(float(digits[0])):
            raise ExpressionError(f"expected a number for `{name}`", comma)
        numbers.append(float(digits[0]))
        end = digits.end()
    closing = _past(text, end, ")")
    if closing is None:
        raise ExpressionError(f"expected `,` or `)` after what `{name}` works on", _past_space(text, end))
    operator = OPERATORS[name]
    if len(numbers) not in operator.counts:
        wanted = " or ".join(map(str, operator.counts))
        raise ExpressionError(f"`{name}` takes {wanted} number(s) after its source, not {len(numbers)}", closing - 1)
    for number, parameter in zip(numbers, operator.parameters, strict=False):
        if not parameter.above < number < parameter.below:
            limits = f"lies between {parameter.above:g} and {parameter.below:g}"
            raise ExpressionError(f"`{parameter.key}` of `{name}` {limits}, not {number:g}", closing - 1)
    return Operated(name, source, tuple(numbers)), closing


def _past(text: str, start: int, mark: str) -> int | None:
    """Where text goes on after `mark`, which is next; None where something else is."""
    at = _past_space(text, start)
    return _past_space(text, at + 1) if text[at : at + 1] == mark else None


def _past_space(text: str, start: int) -> int:
    match = _SPACE.match(text, start)
    return match.end() if match else start


def _number_text(value: float) -> str:
    return repr(value).removesuffix(".0")
