"""Read expressions from text by recursive descent.

    sum      = product { ("+" | "-") product }
    product  = signed { ("*" | "/") signed }
    signed   = { "+" | "-" } power
    power    = atom [ ("^" | "**") signed ]            the exponent must be constant
    atom     = number | name | state | function "(" sum ")" | "(" sum ")"

A state with memory (`expressions.states`), for example `force[k-1]`, is one name. The length of the
text and the depth of nested brackets and exponents are limited, so that hostile text causes an
`ExpressionError`, never a `RecursionError`.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable
from functools import lru_cache, partial

from mapmore_cli.modelling.expressions.evaluation import evaluate
from mapmore_cli.modelling.expressions.functions import FUNCTIONS
from mapmore_cli.modelling.expressions.printing import to_text
from mapmore_cli.modelling.expressions.states import (
    ExpressionError,
    Token,
    Tokens,
    opens_state,
    read_state,
)
from mapmore_cli.modelling.expressions.syntax import (
    MAX_EXPONENT,
    Call,
    Expression,
    Name,
    Number,
    add,
    call,
    multiply,
    negate,
    power,
)

RANGED = "unit"
"""Function name that marks an argument whose training range is not known yet
(`expressions.ranged`).
"""

MAX_LENGTH = 10_000
MAX_DEPTH = 50


@lru_cache(maxsize=4096)
def parse(text: str, ranged: Callable[[Expression], Expression] | None = None) -> Expression:
    """Return the syntax tree of `text` in canonical form. The same text returns the same object.

    With `ranged`, the text may contain calls of `unit`, which depend on a training range. The
    function `ranged` takes the argument of such a call, and returns the expression that replaces
    the call.

    Raises ExpressionError if `text` is no valid expression; its `position` is the place of the
    mistake in the text.

    Examples
    --------
    >>> from mapmore_cli.modelling.expressions import to_text
    >>> to_text(parse("2*3*strain**2 - exp(-strain/0.02)"))
    '6*strain^2 - exp(-strain/0.02)'
    """
    if len(text) > MAX_LENGTH:
        raise ExpressionError(
            f"the expression has {len(text)} characters; at most {MAX_LENGTH} are possible",
            MAX_LENGTH,
        )
    parser = _Parser(text)
    parser.ranged = ranged
    expression = parser.sum()
    parser.expect("end", "an operator")
    # the length is limited after expansion too, because a short text with powers may become long
    if len(text) > MAX_LENGTH // 10 and (length := len(to_text(expression))) > MAX_LENGTH:
        raise ExpressionError(
            f"the expression has {length} characters when its powers are written out; at most "
            f"{MAX_LENGTH} are possible",
            len(text),
        )
    return expression


candidate = partial(parse, ranged=partial(Call, RANGED))
"""Read a term of a dictionary, which may depend on a training range that is not known yet."""


class _Parser(Tokens):
    """Parser with one method for each rule of the grammar."""

    _depth = 0
    ranged: Callable[[Expression], Expression] | None = None

    def sum(self) -> Expression:
        terms = [self._product()]
        while self.next.kind in ("+", "-"):
            terms.append(self._product() if self.take().kind == "+" else negate(self._product()))
        return add(*terms)

    def expect(self, kind: str, wanted: str) -> None:
        next_text = "the end" if self.next.kind == "end" else f"`{self.next.text}`"
        if not self.skip(kind):
            raise self._misfit(f"expected {wanted}, found {next_text}")

    def _misfit(self, message: str) -> ExpressionError:
        """Return an error with the message and the position of the next token. The characters `[`,
        `]` and `,` get another message, because they are valid only in names of states.
        """
        message = (
            f"unexpected character {self.next.text!r}"
            if self.next.kind in ("[", "]", ",")
            else message
        )
        return ExpressionError(message, self.next.position)

    def _product(self) -> Expression:
        factors = [self._signed()]
        while self.next.kind in ("*", "/"):
            factors.append(
                self._signed() if self.take().kind == "*" else power(self._signed(), -1.0)
            )
        return multiply(*factors)

    def _signed(self) -> Expression:
        negative = False
        while self.next.kind in ("+", "-"):
            negative ^= self.take().kind == "-"
        operand = self._power()
        return negate(operand) if negative else operand

    def _power(self) -> Expression:
        base = self._atom()
        if not self.skip("^"):
            return base
        start = self.next.position
        self._enter(start)
        exponent = self._signed()
        self._depth -= 1
        if exponent.names:
            raise ExpressionError(
                "the exponent must be a constant; write exp(b*log(a)) for a^b", start
            )
        value = float(evaluate(exponent, {}, 1)[0])
        if not abs(value) <= MAX_EXPONENT:
            raise ExpressionError(
                f"the exponent {value:g} is too large: at most {MAX_EXPONENT} in magnitude "
                "is possible",
                start,
            )
        return power(base, value)

    def _atom(self) -> Expression:
        if self.next.kind == "number":
            value, start = float(self.next.text), self.take().position
            if not math.isfinite(value):
                raise ExpressionError("the number is too large", start)
            return Number(value)
        if self.next.kind == "name":
            return self._named(self.take())
        if self.next.kind == "(":
            return self._bracket()
        what_stands = (
            "the expression ends" if self.next.kind == "end" else f"`{self.next.text}` stands"
        )
        raise self._misfit(f"{what_stands} where a number, a name or `(` is expected")

    def _named(self, token: Token) -> Expression:
        if opens_state(token, self.next):
            return Name(read_state(self, token).name)
        if self.next.kind == "(":
            if self.ranged and token.text == RANGED:
                return self.ranged(self._bracket())
            return call(_known_function(token), self._bracket())
        if token.text in FUNCTIONS:
            raise ExpressionError(
                f"`{token.text}` is a function: write {token.text}(...)", token.position
            )
        return Name(token.text)

    def _bracket(self) -> Expression:
        self._enter(self.take().position)
        inner = self.sum()
        self._depth -= 1
        self.expect(")", "an operator or `)`")
        return inner

    def _enter(self, position: int) -> None:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise ExpressionError(f"more than {MAX_DEPTH} nested brackets and exponents", position)


def _known_function(token: Token) -> str:
    if token.text in FUNCTIONS:
        return token.text
    near = difflib.get_close_matches(token.text, FUNCTIONS, n=1)
    hint = f"did you mean `{near[0]}`?" if near else f"there are {', '.join(FUNCTIONS)}"
    raise ExpressionError(f"there is no function `{token.text[:40]}`; {hint}", token.position)
