"""Expressions as text and as LaTeX."""

from __future__ import annotations

import re

from mapmore_cli.modelling.expressions.functions import FUNCTIONS
from mapmore_cli.modelling.expressions.operators import OPERATORS
from mapmore_cli.modelling.expressions.states import Lagged, Measured, State, state
from mapmore_cli.modelling.expressions.syntax import ONE, Call, Expression, Name, Number, Power, Product, Sum, negate, power

_SUM, _PRODUCT, _POWER, _ATOM = range(4)
"""How tightly a text binds; an operand that binds less than its place needs is put in brackets."""

_Bound = tuple[str, int]


def to_text(expression: Expression, digits: int | None = None) -> str:
    """Canonical text: `parse(to_text(e)) == e` where `digits` is left out; else numbers are rounded to so many digits."""
    return _text(expression, digits)[0]


def to_latex(expression: Expression, digits: int | None = None) -> str:
    r"""LaTeX for mathematics mode: names upright, parameters such as `a1` in italics with an index, quotients as `\frac`."""
    return _latex(expression, digits)[0]


def _text(expression: Expression, digits: int | None) -> _Bound:
    match expression:
        case Number(value):
            return _digits(value, digits), _ATOM if value >= 0 else _PRODUCT
        case Name(name):
            return name, _ATOM
        case Sum(terms):
            return _signed_sum([(_enclosed(_text(size, digits), _PRODUCT), minus) for size, minus in map(_sign, terms)]), _SUM
        case Call(function, argument):
            return f"{function}({_text(argument, digits)[0]})", _ATOM
        case Power(base, exponent) if exponent > 0:
            return f"{_enclosed(_text(base, digits), _ATOM)}^{_digits(exponent, None if exponent.is_integer() else digits)}", _POWER
        case Power() | Product():
            return _product_text(expression, digits), _PRODUCT
    raise TypeError(f"not an expression: {expression!r}")


def _product_text(expression: Expression, digits: int | None) -> str:
    size, minus = _sign(expression)
    factors = size.factors if isinstance(size, Product) else (size,)
    text = ""
    for factor in factors:
        below = _inverse(factor)
        if below is not None:
            text = (text or "1") + "/" + _enclosed(_text(below, digits), _POWER)
        else:
            text += ("*" if text else "") + _enclosed(_text(factor, digits), _POWER)
    return "-" * minus + text


def _latex(expression: Expression, digits: int | None) -> _Bound:
    match expression:
        case Number(value):
            text = _latex_number(value, digits)
            return text, _PRODUCT if value < 0 or "times" in text else _ATOM
        case Name(name):
            return _state_latex(state(name))
        case Sum(terms):
            return _signed_sum([(_bracketed(_latex(size, digits), _PRODUCT), minus) for size, minus in map(_sign, terms)]), _SUM
        case Call(function, argument):
            return FUNCTIONS[function].latex.replace("#", _latex(argument, digits)[0]), _POWER
        case Power(base, exponent) if exponent > 0:
            return f"{_bracketed(_latex(base, digits), _ATOM)}^{{{_latex_number(exponent, digits)}}}", _POWER
        case Power() | Product():
            return _quotient_latex(expression, digits), _PRODUCT
    raise TypeError(f"not an expression: {expression!r}")


def _quotient_latex(expression: Expression, digits: int | None) -> str:
    size, minus = _sign(expression)
    factors = size.factors if isinstance(size, Product) else (size,)
    below = [inverse for factor in factors if (inverse := _inverse(factor)) is not None]
    above = [factor for factor in factors if _inverse(factor) is None] or [ONE]
    if not below:
        return "-" * minus + _factors_latex(above, digits)
    numerator, denominator = (_latex(f[0], digits)[0] if len(f) == 1 else _factors_latex(f, digits) for f in (above, below))
    return "-" * minus + rf"\frac{{{numerator}}}{{{denominator}}}"


def _factors_latex(factors: list[Expression], digits: int | None) -> str:
    text = ""
    for factor in factors:
        needed = _PRODUCT if isinstance(factor, Number) and not text else _POWER
        latex = _bracketed(_latex(factor, digits), needed)
        text += (r" \cdot " if latex[0].isdigit() else r" \, ") * bool(text) + latex
    return text


def _sign(expression: Expression) -> tuple[Expression, bool]:
    """Return the expression without its leading minus, and whether it had one."""
    first = expression.factors[0] if isinstance(expression, Product) else expression
    minus = isinstance(first, Number) and first.value < 0
    return (negate(expression) if minus else expression), minus


def _inverse(factor: Expression) -> Expression | None:
    """Return what `factor` divides by; None where it multiplies."""
    return power(factor.base, -factor.exponent) if isinstance(factor, Power) and factor.exponent < 0 else None


def _signed_sum(terms: list[tuple[str, bool]]) -> str:
    (first, minus), *rest = terms
    return "-" * minus + first + "".join((" - " if minus else " + ") + text for text, minus in rest)


def _enclosed(text: _Bound, needed: int) -> str:
    return text[0] if text[1] >= needed else f"({text[0]})"


def _bracketed(latex: _Bound, needed: int) -> str:
    return latex[0] if latex[1] >= needed else rf"\left({latex[0]}\right)"


def _digits(value: float, digits: int | None) -> str:
    text = repr(value) if digits is None else f"{value:.{digits}g}"
    return text.removesuffix(".0")


def _latex_number(value: float, digits: int | None) -> str:
    mantissa, _, exponent = _digits(value, digits).partition("e")
    return rf"{mantissa} \times 10^{{{int(exponent)}}}" if exponent else mantissa


def _state_latex(found: State) -> _Bound:
    """Return the numbers of an operator as an index."""
    match found:
        case Measured(name):
            return _latex_name(name), _ATOM
        case Lagged(source, steps):
            return f"{_state_latex(source)[0]}[k-{steps}]", _ATOM
    index = ", ".join(f"{number:g}" for number in found.numbers)
    return OPERATORS[found.operator].latex + f"_{{{index}}}" * bool(index) + rf"\left({_state_latex(found.source)[0]}\right)", _POWER


def _latex_name(name: str) -> str:
    indexed = re.fullmatch(r"([A-Za-z])([0-9]*)", name)
    if indexed is None:
        upright = name.replace("_", r"\_")
        return rf"\mathrm{{{upright}}}"
    return indexed[1] + (f"_{{{indexed[2]}}}" if indexed[2] else "")
