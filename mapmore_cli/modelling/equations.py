"""Print sums of terms as readable equations. Scaled inputs get short names, and numbers are rounded
as far as the accuracy allows.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from functools import partial
from types import MappingProxyType

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns, Ranges
from mapmore_cli.domain.fits import Scaling
from mapmore_cli.domain.models import Equation
from mapmore_cli.modelling.expressions import (
    Expression,
    Name,
    Number,
    add,
    affine,
    evaluate,
    exponents,
    folded,
    multiply,
    parse,
    state,
    substitute,
    to_latex,
    to_mathml,
    to_text,
)
from mapmore_cli.modelling.expressions.functions import FUNCTIONS
from mapmore_cli.modelling.expressions.states import Lagged
from mapmore_cli.modelling.expressions.syntax import (
    Call,
    Power,
    Product,
    Sum,
    power,
    with_parts,
)

TOLERANCE, RECURSIVE = 5e-4, 5e-7
"""Largest change of an equation's values that rounding its numbers may cause, as a fraction of the
range of these values over the training range. The second number is for recursions, in which errors
pass from sample to sample and add up.
"""


FAR, FARTHEST = 7.0, 600.0
"""Limits of the magnitude of an exponent in `exp(...)`. An exponential beyond the first limit is
rewritten so that its coefficient stays readable. Beyond the second limit it is left unchanged,
because the rewritten coefficient would overflow.
"""


def equation(
    name: str,
    terms: Sequence[str],
    theta: Array,
    scaling: Scaling,
    limits: Ranges,
    units: Mapping[str, float],
    weight: str = "",
    tolerance: float = TOLERANCE,
) -> Equation:
    """Return `y_slope sum_k theta_k D_k + y_intercept` (M2 eq 8) as text and as LaTeX.

    Numbers are rounded to the fewest digits with which the error of the equation stays below the
    `tolerance`. The error is relative to the range of values that the equation takes while its
    inputs or states vary within their `limits`. If this range is more than twice the range of the
    training output, twice the latter is used: large terms can cancel in all samples, because the
    inputs depend on each other there, although they do not cancel elsewhere within the limits.
    """
    whole, where = summed(terms, theta, scaling, units)
    whole = folded(whole)
    u = np.random.default_rng(0).uniform(size=(200, len(scaling.variables)))
    at = {}
    for variable, part in zip(scaling.variables, u.T, strict=True):
        low, high = limits.get(variable) or limits.get(
            state(variable).quantity, (math.nan, math.nan)
        )
        at[variable] = (low + (high - low) * part) / units.get(state(variable).quantity, 1.0)

    def value(digits: int) -> Array:
        known = {s: evaluate(rounded(line, digits), at, len(u)) for s, line in where.items()}
        return evaluate(rounded(whole, digits), {**at, **known}, len(u))

    with np.errstate(all="ignore"):  # no warnings, because a term may be undefined somewhere
        known = {**at, **{short: evaluate(line, at, len(u)) for short, line in where.items()}}
        terms_of_sum = whole.terms if isinstance(whole, Sum) else (whole,)
        whole = add(*(_balanced(term, known, len(u)) for term in terms_of_sum))
        exact = evaluate(whole, known, len(u))
        span = np.ptp(exact) or np.abs(exact).max()
        error = tolerance * (
            span if scaling.rule == "none" else min(span, 2 * abs(scaling.y_slope))
        )
        digits = next((n for n in range(3, 17) if np.abs(value(n) - exact).max() <= error), 6)
    return as_equation(name, whole, digits, where, weight)


def rounded(expression: Expression, digits: int) -> Expression:
    """Return the expression with each number rounded to `digits` significant digits, as it is
    printed.
    """
    match expression:
        case Number(value):
            return Number(float(f"{value:.{digits}g}"))
        case Power(base, exponent) if not exponent.is_integer():
            return power(rounded(base, digits), float(f"{exponent:.{digits}g}"))
    return with_parts(expression, partial(rounded, digits=digits))


def as_equation(
    name: str,
    whole: Expression,
    digits: int,
    where: Mapping[str, Expression] = MappingProxyType({}),
    weight: str = "",
) -> Equation:
    """Return an equation whose numbers have `digits` significant digits. `where` holds the meaning
    of the short names in it.
    """
    text, latex, mathml = to_text(whole, digits), to_latex(whole, digits), to_mathml(whole, digits)
    for number, (short, line) in enumerate(where.items()):
        text += f"{',' if number else ', where'} {short} = {to_text(line, digits)}"
        latex += rf", \quad {to_latex(Name(short))} = {to_latex(line, digits)}"
        opening = f"<mtext>{'and' if number else 'where'}&#160;</mtext>"
        sides = (*to_mathml(Name(short)), "<mo>=</mo>", *to_mathml(line, digits))
        mathml += (opening + "".join(sides),)
    return Equation(name, text, latex, mathml, weight)


def _balanced(term: Expression, at: Columns, n: int) -> Expression:
    """Move a constant factor out of each exponential with a large exponent, so that the coefficient
    of the term has a readable magnitude.
    """
    factors: list[Expression] = []
    for factor in term.factors if isinstance(term, Product) else (term,):
        if isinstance(factor, Call) and factor.function == "exp":
            height = float(np.nan_to_num(evaluate(factor.argument, at, n).max()).round())
            if FAR < abs(height) < FARTHEST:
                factors.append(Number(math.exp(height)))
                factors.append(Call("exp", factor.argument - height))
                continue
        factors.append(factor)
    return multiply(*factors)


def summed(
    terms: Sequence[str], theta: Array, scaling: Scaling, units: Mapping[str, float]
) -> tuple[Expression, dict[str, Expression]]:
    """Return a sum of terms, and the meaning of the names of its scaled inputs: `p` for `pressure`,
    `sr` for `strain_rate`, `v16` for `voltage[k-16]`.

    If a quantity is printed in another unit, `units` holds the number of the model's units in one
    printed unit. If all terms are products of powers and no input has an offset, the scale factors
    are multiplied into the coefficients. No short names are then needed, as in table 5 of M2.
    """
    trees, weights = list(map(parse, terms)), (scaling.y_slope * theta).tolist()
    degrees = list(map(exponents, trees))
    numbers = zip(
        scaling.variables, scaling.slope.tolist(), scaling.intercept.tolist(), strict=True
    )
    lines = {
        name: (slope * units.get(state(name).quantity, 1.0), intercept)
        for name, slope, intercept in numbers
    }
    if None not in degrees and not scaling.intercept.any():
        for place, powers in enumerate(degrees):
            weights[place] *= math.prod(
                lines[name][0] ** power for name, power in (powers or {}).items()
            )
        lines = {}
    short, where = dict[str, Expression](), dict[str, Expression]()
    placed = dict(zip(scaling.variables, scaling.placement.split(","), strict=False))
    for name, (slope, intercept) in lines.items():
        if (slope, intercept) != (1.0, 0.0):
            of_state = state(name)
            fresh = "".join(re.findall("(?<![A-Za-z])[A-Za-z]", of_state.quantity)).lower() or "x"
            fresh += str(of_state.steps) if isinstance(of_state, Lagged) else ""
            while fresh in {*where, *scaling.variables, *FUNCTIONS}:
                fresh += "_"
            bent = sum(
                1 if degree is None else -1
                for tree, degree in zip(trees, degrees, strict=True)
                if name in tree.names
            )
            # For -1 <= z <= 0, a term such as sqrt(1 + z) is printed shorter with the input z + 1.
            shift = 1.0 if placed.get(name) == "right" and bent > 0 else 0.0
            short[name], where[fresh] = (
                Name(fresh) - shift,
                affine(Name(name), slope, intercept + shift),
            )
    parts = (
        multiply(Number(weight), substitute(tree, short))
        for weight, tree in zip(weights, trees, strict=True)
    )
    whole = add(Number(scaling.y_intercept), *parts)
    return whole, {name: line for name, line in where.items() if name in whole.names}
