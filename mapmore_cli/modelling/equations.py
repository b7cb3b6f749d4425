"""Sums of terms as equations that a person reads: scaled inputs have short names, and numbers as few digits as do."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence, Set
from itertools import count

import numpy as np

from mapmore_cli.domain.arrays import Array, Ranges
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
    multiply,
    parse,
    state,
    substitute,
    to_latex,
    to_text,
)
from mapmore_cli.modelling.expressions.operator import FUNCTIONS
from mapmore_cli.modelling.expressions.states import Lagged

TOLERANCE = 5e-4
"""What rounding may change, as part of what an equation varies by over the training range."""

MEANINGLESS = 1e9
"""Coefficients in physical units beyond it, or below its inverse, say less than those of scaled inputs."""

Short = dict[str, Expression]
"""What short names mean."""


def equation(name: str, terms: Sequence[str], theta: Array, scaling: Scaling, limits: Ranges, units: Mapping[str, float]) -> Equation:
    """Return `y_slope sum_k theta_k D_k + y_intercept` (M2 eq 8) as text and as LaTeX.

    Numbers have the fewest digits with which it errs by less than a thousandth of its range over the `limits` of quantities or states.
    """
    whole, where = summed(terms, theta, scaling, units)
    u = np.random.default_rng(0).uniform(size=(200, len(scaling.variables)))
    at = {}
    for one, part in zip(scaling.variables, u.T, strict=True):
        low, high = limits.get(one) or limits.get(state(one).quantity, (math.nan, math.nan))
        at[one] = (low + (high - low) * part) / units.get(state(one).quantity, 1.0)

    def value(digits: int) -> Array:
        known = {short: evaluate(parse(to_text(line, digits)), at, len(u)) for short, line in where.items()}
        return evaluate(parse(to_text(whole, digits)), {**at, **known}, len(u))

    with np.errstate(all="ignore"):
        exact = value(17)
        error = TOLERANCE * (np.ptp(exact) or np.abs(exact).max())
        digits = next((one for one in range(3, 17) if np.abs(value(one) - exact).max() <= error), 6)
    text, latex = to_text(whole, digits), to_latex(whole, digits)
    for short, line in where.items():
        text += f"{',' if ', where ' in text else ', where'} {short} = {to_text(line, digits)}"
        latex += rf", \quad {to_latex(Name(short))} = {to_latex(line, digits)}"
    return Equation(name, text, latex)


def summed(terms: Sequence[str], theta: Array, scaling: Scaling, units: Mapping[str, float]) -> tuple[Expression, Short]:
    """Return a sum of terms, and what the names of its scaled inputs mean: `pressure` is `p`, `strain_rate` `sr`, `voltage[k-16]` `v16`.

    `units` says how many of the model's units one unit of a quantity is, where it is to be in another: states are proportional to it. A
    product of quantities that are scaled without an offset keeps its form, with one coefficient in front, as M2's table 5 prints them.
    """
    trees, short, where = list(map(parse, terms)), Short(), Short()
    slopes = [m * units.get(state(one).quantity, 1.0) for one, m in zip(scaling.variables, scaling.slope.tolist(), strict=True)]
    weights = (scaling.y_slope * theta).tolist()
    degrees = [own for tree in trees if (own := exponents(tree)) is not None]
    if len(degrees) == len(trees) and not scaling.intercept.any():
        slope = dict(zip(scaling.variables, slopes, strict=True))
        physical = [weight * math.prod(slope[name] ** e for name, e in own.items()) for weight, own in zip(weights, degrees, strict=True)]
        if all(1 / MEANINGLESS < abs(weight) < MEANINGLESS for weight in physical):
            weights, slopes = physical, [1.0] * len(slopes)
    used = frozenset[str]().union(*(tree.names for tree in trees))
    placed = dict(zip(scaling.variables, scaling.placement.split(","), strict=False))
    for one, m, c in zip(scaling.variables, slopes, scaling.intercept.tolist(), strict=True):
        line = affine(Name(one), m, c)
        if line != Name(one) and one in used:
            short[one] = Name(fresh := _initials(one, {*where, *scaling.variables, *FUNCTIONS}))
            where[fresh] = line
            bent = [one in tree.names for tree in trees if exponents(tree) is None]
            if placed.get(one) == "right" and 2 * sum(bent) > sum(one in tree.names for tree in trees):
                where[fresh], short[one] = affine(Name(one), m, c + 1.0), Name(fresh) - 1.0
    parts = (multiply(Number(weight), substitute(tree, short)) for weight, tree in zip(weights, trees, strict=True))
    return add(Number(scaling.y_intercept), *parts), where


def _initials(name: str, taken: Set[str]) -> str:
    """Return the initials of a quantity, with the steps of a delay, and what makes them no name that is taken."""
    found = state(name)
    letters = "".join(word[:1] for word in found.quantity.lower().split("_")) + (str(found.steps) if isinstance(found, Lagged) else "")
    stem = letters if letters.isidentifier() else f"x{letters}"
    return next(way for way in (stem + "_" * more for more in count()) if way not in taken)
