"""Print expressions as text, LaTeX and MathML."""

from __future__ import annotations

import re

from mapmore_cli.modelling.expressions.functions import FUNCTIONS
from mapmore_cli.modelling.expressions.operators import OPERATORS
from mapmore_cli.modelling.expressions.states import Lagged, Measured, State, shortest_text, state
from mapmore_cli.modelling.expressions.syntax import (
    ONE,
    Call,
    Expression,
    Name,
    Number,
    Power,
    Product,
    Sum,
    negate,
    power,
)

# Precedence: an operand with a lower precedence than its place requires is put in brackets.
_SUM, _PRODUCT, _POWER, _ATOM = range(4)

_Bound = tuple[str, int]


def to_text(expression: Expression, digits: int | None = None) -> str:
    """Return the expression as text. Without `digits`, `parse` reads this text as the same
    expression: `parse(to_text(e)) == e`. With `digits`, numbers are rounded to this many
    significant digits.
    """
    return _Text(digits).printed(expression)[0]


def to_latex(expression: Expression, digits: int | None = None) -> str:
    r"""Return LaTeX for mathematics mode: names upright, parameters such as `a1` in italics with an
    index, quotients as `\frac`.
    """
    return _Latex(digits).printed(expression)[0]


def to_mathml(expression: Expression, digits: int | None = None) -> tuple[str, ...]:
    """Return presentation MathML that looks like the LaTeX, with one `<mrow>` for each term of a
    sum, so that a line can break between them.
    """
    terms = expression.terms if isinstance(expression, Sum) else (expression,)
    return tuple(f"<mrow>{term}</mrow>" for term in _MathML(digits).signed(terms))


class _Text:
    """Printer of expressions as text. Numbers are rounded to `digits` significant digits; None
    keeps all digits.
    """

    brackets = "({})"
    minus, plus, before_first = " - ", " + ", "-"

    def __init__(self, digits: int | None) -> None:
        self.digits = digits

    def printed(self, expression: Expression) -> _Bound:
        match expression:
            case Number(value):
                return self.number(value)
            case Name(name):
                return self.name(name)
            case Sum(terms):
                return self.sum(terms), _SUM
            case Call(function, argument):
                return self.call(function, self.printed(argument)[0])
            case Power(base, exponent) if exponent > 0:
                return self.power(self.operand(base, _ATOM), exponent), _POWER
            case Power() | Product():
                return self.product(expression), _PRODUCT
        raise TypeError(f"not an expression: {expression!r}")

    def operand(self, expression: Expression, needed: int) -> str:
        """Return the text of an operand, in brackets if the operand's precedence is lower than its
        place requires.
        """
        text, bound = self.printed(expression)
        return text if bound >= needed else self.brackets.format(text)

    def digits_of(self, value: float) -> str:
        return (
            shortest_text(value)
            if self.digits is None
            else f"{value:.{self.digits}g}".removesuffix(".0")
        )

    def sum(self, terms: tuple[Expression, ...]) -> str:
        return "".join(self.signed(terms))

    def signed(self, terms: tuple[Expression, ...]) -> list[str]:
        """Return the terms of a sum, each with its sign."""
        (first, minus), *rest = [
            (self.operand(size, _PRODUCT), minus) for size, minus in map(_sign, terms)
        ]
        return [
            self.before_first * minus + first,
            *((self.minus if minus else self.plus) + text for text, minus in rest),
        ]

    def number(self, value: float) -> _Bound:
        return self.digits_of(value), _ATOM if value >= 0 else _PRODUCT

    def name(self, name: str) -> _Bound:
        return name, _ATOM

    def call(self, function: str, argument: str) -> _Bound:
        return f"{function}({argument})", _ATOM

    def power(self, base: str, exponent: float) -> str:
        digits = shortest_text if exponent.is_integer() else self.digits_of
        return f"{base}^{digits(exponent)}"

    def product(self, expression: Expression) -> str:
        factors, minus = _factors(expression)
        text = ""
        for factor in factors:
            below = _inverse(factor)
            if below is not None:
                text = (text or "1") + "/" + self.operand(below, _POWER)
            else:
                text += "*" * bool(text) + self.operand(factor, _POWER)
        return "-" * minus + text


class _Latex(_Text):
    """Printer of expressions as LaTeX."""

    brackets = r"\left({}\right)"
    numeral, scientific = "{}", r"{} \times 10^{{{}}}"
    quotient, raised = r"\frac{{{}}}{{{}}}", "{}^{{{}}}"
    beside, before_digit = r" \, ", r" \cdot "
    underscore = r"\_"
    upright, letter, indexed, past = r"\mathrm{{{}}}", "{}", "{}_{{{}}}", "{}[k-{}]"

    def number(self, value: float) -> _Bound:
        mantissa, _, exponent = self.digits_of(value).partition("e")
        form = self.scientific if exponent else self.numeral
        text = form.format(mantissa, int(exponent or 0))
        return text, _PRODUCT if value < 0 or exponent else _ATOM

    def name(self, name: str) -> _Bound:
        return self.state(state(name))

    def call(self, function: str, argument: str) -> _Bound:
        return FUNCTIONS[function].texts["latex"].replace("#", argument), _POWER

    def operator(self, name: str) -> str:
        return OPERATORS[name].latex

    def power(self, base: str, exponent: float) -> str:
        return self.raised.format(base, self.number(exponent)[0])

    def product(self, expression: Expression) -> str:
        factors, minus = _factors(expression)
        below = [inverse for factor in factors if (inverse := _inverse(factor)) is not None]
        above = [factor for factor in factors if _inverse(factor) is None] or [ONE]
        sides = [
            self.printed(f[0])[0] if below and len(f) == 1 else self._side_by_side(f)
            for f in (above, below)
        ]
        return self.before_first * minus + (self.quotient.format(*sides) if below else sides[0])

    def _side_by_side(self, factors: list[Expression]) -> str:
        text = ""
        for factor in factors:
            latex = self.operand(
                factor, _PRODUCT if isinstance(factor, Number) and not text else _POWER
            )
            digit = re.match(r"(<\w+>)*\d", latex)
            text += (self.before_digit if digit else self.beside) * bool(text) + latex
        return text

    def state(self, wanted: State) -> _Bound:
        """Return the LaTeX of a quantity or of a state. The numbers of an operator become its
        index.
        """
        match wanted:
            case Measured(name):
                if indexed := re.fullmatch(r"([A-Za-z])([0-9]*)", name):
                    letter, number = (self.letter.format(indexed[1]), indexed[2])
                    return self.indexed.format(letter, number) if number else letter, _ATOM
                return self.upright.format(name.replace("_", self.underscore)), _ATOM
            case Lagged(source, steps):
                return self.past.format(self.state(source)[0], steps), _ATOM
        index = ", ".join(f"{number:g}" for number in wanted.numbers)
        name = self.operator(wanted.operator)
        head = self.indexed.format(name, index) if index else name
        return head + self.brackets.format(self.state(wanted.source)[0]), _POWER


class _MathML(_Latex):
    """Printer of expressions as MathML."""

    brackets = "<mrow><mo>(</mo>{}<mo>)</mo></mrow>"
    before_first = "<mo>−</mo>"
    minus, plus = '<mo form="infix">−</mo>', '<mo form="infix">+</mo>'
    numeral = "<mn>{}</mn>"
    scientific = "<mn>{}</mn><mo>·</mo><msup><mn>10</mn><mn>{}</mn></msup>"
    quotient = "<mfrac><mrow>{}</mrow><mrow>{}</mrow></mfrac>"
    raised = "<msup><mrow>{}</mrow><mrow>{}</mrow></msup>"
    beside, before_digit = '<mspace width="0.17em"/>', "<mo>·</mo>"
    underscore, upright, letter = "_", "<mi>{}</mi>", "<mi>{}</mi>"
    indexed, past = "<msub>{}<mn>{}</mn></msub>", "<mrow>{}<mo>[k−{}]</mo></mrow>"

    def number(self, value: float) -> _Bound:
        text, bound = super().number(value)
        return text.replace("-", "−"), bound

    def call(self, function: str, argument: str) -> _Bound:
        text = FUNCTIONS[function].texts["mathml"].replace("#", argument)
        return f"<mrow>{text}</mrow>", _POWER

    def operator(self, name: str) -> str:
        return self.upright.format(name)


def _sign(expression: Expression) -> tuple[Expression, bool]:
    """Return the expression without its leading minus sign, and True if it had a minus sign."""
    first = expression.factors[0] if isinstance(expression, Product) else expression
    minus = isinstance(first, Number) and first.value < 0
    return (negate(expression) if minus else expression), minus


def _factors(expression: Expression) -> tuple[tuple[Expression, ...], bool]:
    """Return the factors without the leading minus sign, and True if there was a minus sign."""
    size, minus = _sign(expression)
    return (size.factors if isinstance(size, Product) else (size,)), minus


def _inverse(factor: Expression) -> Expression | None:
    """Return the divisor if the factor is a power with a negative exponent, which stands for a
    division; None otherwise.
    """
    return (
        power(factor.base, -factor.exponent)
        if isinstance(factor, Power) and factor.exponent < 0
        else None
    )
