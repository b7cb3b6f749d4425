"""Expressions from text: a tokenizer and a recursive descent parser.

    sum      = product { ("+" | "-") product }
    product  = signed { ("*" | "/") signed }
    signed   = { "+" | "-" } power
    power    = atom [ ("^" | "**") signed ]            the exponent must be constant
    atom     = number | name | state | function "(" sum ")" | "(" sum ")"

A state with memory (`terms.states`), as `force[k-1]`, is one name. Length and depth are limited, so that hostile text ends in an
`ExpressionError` and never in a `RecursionError`.
"""

from __future__ import annotations

import difflib
import math
import re
from dataclasses import dataclass
from functools import lru_cache

from mapmore_cli.modelling.expressions.errors import ExpressionError
from mapmore_cli.modelling.expressions.evaluation import constant_value
from mapmore_cli.modelling.expressions.functions import FUNCTIONS
from mapmore_cli.modelling.expressions.printing import to_text
from mapmore_cli.modelling.expressions.states import opens_state, read_state
from mapmore_cli.modelling.expressions.syntax import IDENTIFIER, MAX_EXPONENT, Expression, Name, Number, add, call, multiply, negate, power

MAX_LENGTH = 10_000
MAX_DEPTH = 50

_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)"
    rf"|(?P<name>{IDENTIFIER.pattern})|(?P<operator>\*\*|[-+*/^()])|(?P<end>\Z))",
    re.ASCII,
)
_SPACE = re.compile(r"\s*", re.ASCII)


@lru_cache(maxsize=4096)
def parse(text: str) -> Expression:
    """Syntax tree of `text`, in canonical form; of a text that comes again, the same tree.

    Raises ExpressionError where `text` is no expression; its `position` says where.

    Examples
    --------
    >>> from mapmore_cli.modelling.expressions import to_text
    >>> to_text(parse("2*3*strain**2 - exp(-strain/0.02)"))
    '6*strain^2 - exp(-strain/0.02)'
    """
    if len(text) > MAX_LENGTH:
        raise ExpressionError(f"the expression has {len(text)} characters, more than {MAX_LENGTH}", MAX_LENGTH)
    parser = _Parser(_tokens(text))
    expression = parser.sum()
    parser.expect("end", "an operator")
    if len(text) > MAX_LENGTH // 10 and (length := len(to_text(expression))) > MAX_LENGTH:  # written out, nothing grows tenfold
        raise ExpressionError(f"the expression has {length} characters when it is written out, more than {MAX_LENGTH}", len(text))
    return expression


@dataclass(frozen=True)
class _Token:
    kind: str  # number | name | state | end, or the operator itself
    text: str
    position: int


def _tokens(text: str) -> list[_Token]:
    tokens: list[_Token] = []
    position = 0
    while not tokens or tokens[-1].kind != "end":
        match = _TOKEN.match(text, position)
        if match is None:
            at = _end_of_space(text, position)
            raise ExpressionError(f"unexpected character {text[at]!r}", at)
        kind, position = str(match.lastgroup), match.end()
        word = match[kind]
        if kind == "name" and opens_state(text, word, position):
            found, position = read_state(text, match.start(kind))
            tokens.append(_Token("state", found.name, match.start(kind)))
            continue
        tokens.append(_Token("^" if word == "**" else word if kind == "operator" else kind, word, match.start(kind)))
    return tokens


def _end_of_space(text: str, position: int) -> int:
    match = _SPACE.match(text, position)
    return match.end() if match else position


class _Parser:
    """One method for each rule of the grammar; `_next` is the token to be read."""

    def __init__(self, tokens: list[_Token]) -> None:
        self._rest = iter(tokens)
        self._next = next(self._rest)
        self._depth = 0

    def sum(self) -> Expression:
        terms = [self._product()]
        while self._next.kind in ("+", "-"):
            terms.append(self._product() if self._take().kind == "+" else negate(self._product()))
        return add(*terms)

    def expect(self, kind: str, wanted: str) -> None:
        if self._next.kind != kind:
            found = "the end" if self._next.kind == "end" else f"`{self._next.text}`"
            raise ExpressionError(f"expected {wanted}, found {found}", self._next.position)
        if kind != "end":
            self._take()

    def _product(self) -> Expression:
        factors = [self._signed()]
        while self._next.kind in ("*", "/"):
            factors.append(self._signed() if self._take().kind == "*" else power(self._signed(), -1.0))
        return multiply(*factors)

    def _signed(self) -> Expression:
        negative = False
        while self._next.kind in ("+", "-"):
            negative ^= self._take().kind == "-"
        operand = self._power()
        return negate(operand) if negative else operand

    def _power(self) -> Expression:
        base = self._atom()
        if self._next.kind != "^":
            return base
        self._take()
        start = self._next.position
        self._enter(start)
        exponent = self._signed()
        self._depth -= 1
        if exponent.names:
            raise ExpressionError("the exponent must be a constant; write exp(b*log(a)) for a^b", start)
        value = constant_value(exponent)
        if not abs(value) <= MAX_EXPONENT:
            raise ExpressionError(f"the exponent {value:g} is beyond {MAX_EXPONENT} in magnitude", start)
        return power(base, value)

    def _atom(self) -> Expression:
        token = self._next
        if token.kind == "number":
            self._take()
            return _number(token)
        if token.kind == "state":
            self._take()
            return Name(token.text)
        if token.kind == "name":
            self._take()
            if self._next.kind == "(":
                return call(_function(token), self._bracket())
            if token.text in FUNCTIONS:
                raise ExpressionError(f"`{token.text}` is a function: write {token.text}(...)", token.position)
            return Name(token.text)
        if token.kind == "(":
            return self._bracket()
        found = "the expression ends" if token.kind == "end" else f"`{token.text}` stands"
        raise ExpressionError(f"{found} where a number, a name or `(` should be", token.position)

    def _bracket(self) -> Expression:
        self._enter(self._take().position)
        inner = self.sum()
        self._depth -= 1
        self.expect(")", "an operator or `)`")
        return inner

    def _enter(self, position: int) -> None:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise ExpressionError(f"more than {MAX_DEPTH} brackets and exponents inside each other", position)

    def _take(self) -> _Token:
        token = self._next
        self._next = next(self._rest)
        return token


def _number(token: _Token) -> Number:
    value = float(token.text)
    if not math.isfinite(value):
        raise ExpressionError("the number is too large", token.position)
    return Number(value)


def _function(token: _Token) -> str:
    if token.text in FUNCTIONS:
        return token.text
    near = difflib.get_close_matches(token.text, FUNCTIONS, n=1)
    hint = f"did you mean `{near[0]}`?" if near else f"there are {', '.join(FUNCTIONS)}"
    raise ExpressionError(f"there is no function `{token.text[:40]}`; {hint}", token.position)
