"""Read and write the names of states with memory, for example `force[k-1]` or `slow(play(pressure,
0.16), 0.3)`, and the tokens of which these names and expressions consist.

    state    = ( quantity | operator "(" state { "," number } ")" ) [ "[" "k" "-" steps "]" ]

In an expression, a state is one name, given by its canonical text. `modelling.memory` computes its
values.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from mapmore_cli.modelling.expressions.functions import FUNCTIONS
from mapmore_cli.modelling.expressions.operators import OPERATORS

MAX_NESTING = 8
MAX_STEPS = 1_000_000
IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")

_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)"
    rf"|(?P<name>{IDENTIFIER.pattern})|(?P<mark>\*\*|[-+*/^()\[\],])|(?P<end>\Z)|(?P<other>.))",
    re.ASCII | re.DOTALL,
)


class ExpressionError(ValueError):
    """Error for a text that is no valid expression. `position` is the 0-based offset of the first
    character that does not fit.
    """

    def __init__(self, message: str, position: int = 0) -> None:
        super().__init__(message)
        self.message = message
        self.position = position


class _State:
    @property
    def parts(self) -> tuple[State, ...]:
        """The state itself and all states inside it, the innermost first."""
        assert isinstance(self, State)
        return (self,) if isinstance(self, Measured) else (*self.source.parts, self)

    @property
    def quantity(self) -> str:
        """Name of the measured quantity inside the state."""
        return self.parts[0].name

    @property
    def lag(self) -> int:
        """Number of samples by which the state is delayed. At the beginning of a recording, the
        state has no value for this many samples.
        """
        return sum(part.steps for part in self.parts if isinstance(part, Lagged))

    @property
    def goes_by_order(self) -> bool:
        """Return True if the state depends on the order of the samples, but not on the time between
        them.
        """
        return all(
            not OPERATORS[part.operator].timed
            if isinstance(part, Operated)
            else isinstance(part, Measured)
            for part in self.parts
        )


@dataclass(frozen=True)
class Measured(_State):
    """The state that is the value of a quantity at the present sample."""

    name: str


@dataclass(frozen=True)
class Lagged(_State):
    """The value of a state some samples ago: `source` delayed by `steps` samples."""

    source: State
    steps: int

    @property
    def name(self) -> str:
        """Name of the state, for example `force[k-2]`."""
        return f"{self.source.name}[k-{self.steps}]"


@dataclass(frozen=True)
class Operated(_State):
    """The state that results if an operator of `OPERATORS` is applied to the present and past
    values of `source`.
    """

    operator: str
    source: State
    numbers: tuple[float, ...] = ()

    @property
    def name(self) -> str:
        """Name of the state, for example `play(pressure, 0.16)`."""
        return (
            f"{self.operator}({', '.join([self.source.name, *map(shortest_text, self.numbers)])})"
        )


State = Measured | Lagged | Operated


def shortest_text(value: float) -> str:
    """Return the shortest text that reads as exactly the same number."""
    return repr(value).removesuffix(".0")


class Token(NamedTuple):
    """A token of an expression. `kind` is `number`, `name`, `end`, or the symbol itself."""

    kind: str
    text: str
    position: int


class Tokens:
    """Tokens of a text, which are read one after the other. `next` is the token that is read next.
    Raises ExpressionError if the text contains a character that belongs to no token.
    """

    def __init__(self, text: str) -> None:
        self._rest = iter([_token(match) for match in _TOKEN.finditer(text)])
        self.next = next(self._rest)

    def take(self) -> Token:
        """Return the next token and advance."""
        token = self.next
        self.next = next(self._rest, token)
        return token

    def skip(self, kind: str) -> bool:
        """If the next token is of this kind, consume it and return True; otherwise return False."""
        return self.next.kind == kind and bool(self.take())


def _token(match: re.Match[str]) -> Token:
    kind = str(match.lastgroup)
    if kind == "other":
        raise ExpressionError(f"unexpected character {match[kind]!r}", match.start(kind))
    return Token(
        match[kind].replace("**", "^") if kind == "mark" else kind, match[kind], match.start(kind)
    )


@lru_cache(maxsize=4096)
def state(text: str) -> State:
    """Return the state that `text` names. Raises ExpressionError for a malformed name."""
    tokens = Tokens(text)
    parsed = read_state(tokens, tokens.take())
    if tokens.next.kind != "end":
        raise ExpressionError(
            f"{text!r} has more text after the name of a state, for example `pressure[k-1]`",
            tokens.next.position,
        )
    return parsed


def opens_state(name: Token, mark: Token) -> bool:
    """Return True if the identifier `name` and the symbol `mark` after it begin the name of a state
    with memory, for example `force[` or `slow(`.
    """
    return mark.kind == "[" or (mark.kind == "(" and name.text in OPERATORS)


def read_state(tokens: Tokens, name: Token, depth: int = 0) -> State:
    """Return the state that begins with the token `name` and continues with `tokens`; raises
    ExpressionError for an unexpected token.
    """
    if name.kind != "name" or name.text in FUNCTIONS:
        raise ExpressionError(
            "expected the name of a quantity or of an operator with memory", name.position
        )
    if depth > MAX_NESTING:
        raise ExpressionError(
            f"too many operators are nested; nest at most {MAX_NESTING}", name.position
        )
    source = _operated(tokens, name, depth) if tokens.skip("(") else Measured(name.text)
    start = tokens.next.position
    if not tokens.skip("["):
        return source
    k, minus, steps, end = (tokens.take().text for _ in range(4))
    if (k, minus, end) != ("k", "-", "]") or not (
        steps.isdigit() and len(steps) < 8 and 1 <= int(steps) <= MAX_STEPS
    ):
        raise ExpressionError(f"a delay is written [k-1], [k-2], ..., up to [k-{MAX_STEPS}]", start)
    return Lagged(source, int(steps))


def _operated(tokens: Tokens, name: Token, depth: int) -> Operated:
    """Read the bracket after the operator `name`, and return the state that results."""
    operator = OPERATORS.get(name.text)
    if operator is None:
        raise ExpressionError(
            f"there is no operator with memory `{name.text[:40]}`; there are "
            f"{', '.join(OPERATORS)}",
            name.position,
        )
    source = read_state(tokens, tokens.take(), depth + 1)
    numbers: list[float] = []
    while tokens.skip(","):
        start, sign = tokens.next.position, -1.0 if tokens.skip("-") else 1.0
        kind, digits, _ = tokens.take()
        if kind != "number" or not math.isfinite(float(digits)):
            raise ExpressionError(f"expected a number for `{name.text}`", start)
        numbers.append(sign * float(digits))
    closing = tokens.next.position
    if not tokens.skip(")"):
        raise ExpressionError(f"expected `,` or `)` after the state inside `{name.text}`", closing)
    if len(numbers) not in operator.counts:
        wanted = " or ".join(map(str, operator.counts))
        raise ExpressionError(
            f"`{name.text}` takes {wanted} number(s) after its source, not {len(numbers)}", closing
        )
    for number, parameter in zip(numbers, operator.parameters, strict=False):
        if not parameter.allows(number):
            between = f"lies between {parameter.above:g} and {parameter.below:g}"
            limits = f"is 0, or {between}" if parameter.or_zero else between
            raise ExpressionError(
                f"`{parameter.key}` of `{name.text}` {limits}, not {number:g}", closing
            )
    return Operated(name.text, source, tuple(numbers))
