"""Derivatives, substitution, and the way back from scaled to physical variables."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from mapmore_cli.modelling.expressions.syntax import (
    MAX_EXPONENT,
    ONE,
    ZERO,
    Call,
    Expression,
    Name,
    Number,
    Power,
    Product,
    Sum,
    add,
    call,
    multiply,
    negate,
    power,
)

SLOPES: Mapping[str, Callable[[Expression], Expression]] = MappingProxyType(
    {
        "exp": lambda x: call("exp", x),
        "log": lambda x: power(x, -1),
        "sqrt": lambda x: multiply(Number(0.5), power(call("sqrt", x), -1)),
        "abs": lambda x: call("sign", x),
        "sign": lambda _: ZERO,
        "sin": lambda x: call("cos", x),
        "cos": lambda x: negate(call("sin", x)),
        "tan": lambda x: power(call("cos", x), -2),
        "atan": lambda x: power(add(ONE, power(x, 2)), -1),
        "sinh": lambda x: call("cosh", x),
        "cosh": lambda x: call("sinh", x),
        "tanh": lambda x: power(call("cosh", x), -2),
        "expm1": lambda x: call("exp", x),
        "log1p": lambda x: power(add(ONE, x), -1),
    }
)
"""Derivative of every function with respect to its argument (zero at the kinks of `abs` and `sign`)."""


def derivative(expression: Expression, name: str) -> Expression:
    """`d expression / d name`, in canonical form."""
    if name not in expression.names:
        return ZERO
    match expression:
        case Name():
            return ONE
        case Sum(terms):
            return add(*(derivative(term, name) for term in terms))
        case Product(factors):
            slopes = [derivative(factor, name) for factor in factors]
            return add(*(multiply(*factors[:i], slope, *factors[i + 1 :]) for i, slope in enumerate(slopes) if slope != ZERO))
        case Power(base, exponent):
            within = exponent - 1 >= -MAX_EXPONENT
            lower = power(base, exponent - 1) if within else multiply(expression, power(base, -1))
            return multiply(Number(exponent), lower, derivative(base, name))
        case Call(function, argument):
            return multiply(SLOPES[function](argument), derivative(argument, name))
    return ZERO


def substitute(expression: Expression, values: Mapping[str, Expression]) -> Expression:
    """`expression` with every name of `values` replaced, all at once."""
    match expression:
        case Name(name):
            return values.get(name, expression)
        case Sum(terms):
            return add(*(substitute(term, values) for term in terms))
        case Product(factors):
            return multiply(*(substitute(factor, values) for factor in factors))
        case Power(base, exponent):
            return power(substitute(base, values), exponent)
        case Call(function, argument):
            return call(function, substitute(argument, values))
    return expression


def exponents(expression: Expression) -> dict[str, float] | None:
    """Exponent of every name in a monomial `prod_j name_j^e_j`; None for any other expression."""
    found: dict[str, float] = {}
    for factor in expression.factors if isinstance(expression, Product) else (expression,):
        base, exponent = (factor.base, factor.exponent) if isinstance(factor, Power) else (factor, 1.0)
        if not isinstance(base, Name):
            return None
        found[base.name] = found.get(base.name, 0.0) + exponent
    return found


def affine(expression: Expression, slope: float, intercept: float) -> Expression:
    """`slope*expression + intercept` as a person would write a scaled variable: `(expression - centre)/width`.

    The width is kept positive, `(centre - expression)/width`, where the slope is negative (M2 eq 8's `m x + c`).

    Examples
    --------
    >>> from mapmore_cli.modelling.expressions import parse, to_text
    >>> strain = affine(Name("strain"), slope=1 / 0.0453, intercept=-0.045 / 0.0453)
    >>> to_text(substitute(parse("strain^2"), {"strain": strain}), digits=6)
    '((strain - 0.045)/0.0453)^2'
    """
    if slope == 0.0:
        return Number(intercept)
    centre, width = Number(-intercept / slope), Number(1.0 / abs(slope))
    distance = add(expression, negate(centre)) if slope > 0 else add(centre, negate(expression))
    return distance if width == ONE else multiply(distance, power(width, -1))
