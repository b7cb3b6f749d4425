"""Differentiate expressions, substitute in them, and convert them from scaled to physical
variables.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from mapmore_cli.modelling.expressions.functions import FUNCTIONS
from mapmore_cli.modelling.expressions.parsing import parse
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
    multiply,
    power,
    with_parts,
)


def derivative(expression: Expression, name: str) -> Expression:
    """Return the derivative `d expression / d name` in canonical form. The derivative of `abs(x)`
    is `sign(x)`, which is zero for x = 0, and the derivative of `sign(x)` is zero for every x.
    """
    if name not in expression.names:
        return ZERO
    match expression:
        case Name():
            return ONE
        case Sum(terms):
            return add(*(derivative(term, name) for term in terms))
        case Product(factors):
            slopes = (derivative(factor, name) for factor in factors)
            return add(
                *(
                    multiply(*factors[:i], slope, *factors[i + 1 :])
                    for i, slope in enumerate(slopes)
                )
            )
        case Power(base, exponent):
            within = exponent - 1 >= -MAX_EXPONENT
            lower = power(base, exponent - 1) if within else multiply(expression, power(base, -1))
            return multiply(Number(exponent), lower, derivative(base, name))
        case Call(function, argument):
            return multiply(
                substitute(parse(FUNCTIONS[function].slope), {"x": argument}),
                derivative(argument, name),
            )
    return ZERO


def substitute(expression: Expression, values: Mapping[str, Expression]) -> Expression:
    """Return `expression` in which each name in `values` is replaced by its value. All names are
    replaced at once, so that names inside the values are not replaced.
    """
    if isinstance(expression, Name):
        return values.get(expression.name, expression)
    return with_parts(expression, partial(substitute, values=values))


def exponents(expression: Expression) -> dict[str, float] | None:
    """Return the exponent of every name in a monomial `prod_j name_j^e_j`; None for any other
    expression.
    """
    powers: dict[str, float] = {}
    for factor in expression.factors if isinstance(expression, Product) else (expression,):
        base, exponent = (
            (factor.base, factor.exponent) if isinstance(factor, Power) else (factor, 1.0)
        )
        if not isinstance(base, Name):
            return None
        powers[base.name] = powers.get(base.name, 0.0) + exponent
    return powers


def affine(expression: Expression, slope: float, intercept: float) -> Expression:
    """Return `slope*expression + intercept`, written in the usual form of a scaled variable,
    `(expression - centre)/width`.

    For a negative slope, the result is `(centre - expression)/width`, so that the width is
    positive. `slope` and `intercept` are m and c in M2 eq 8, `m x + c`.

    Examples
    --------
    >>> from mapmore_cli.modelling.expressions import parse, to_text
    >>> strain = affine(Name("strain"), slope=1 / 0.0453, intercept=-0.045 / 0.0453)
    >>> to_text(substitute(parse("strain^2"), {"strain": strain}), digits=6)
    '((strain - 0.045)/0.0453)^2'
    """
    if slope == 0.0:
        return Number(intercept)
    centre, width = -intercept / slope, 1.0 / abs(slope)
    distance = expression - centre if slope > 0 else centre - expression
    return distance if width == 1.0 else distance / width
