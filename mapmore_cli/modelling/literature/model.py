"""A formula of the literature as a model, or as the part of a model that another is built on:
evaluated, printed, written as statements.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import FormulaFit, SegmentedCurve
from mapmore_cli.domain.models import CurveRange, Equation, Formula, Model
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.domain.results import Run
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.expressions import (
    Expression,
    Name,
    Number,
    multiply,
    substitute,
    to_latex,
    to_text,
)
from mapmore_cli.modelling.expressions.syntax import Call, Condition, Power, Product, Sum
from mapmore_cli.modelling.literature import piecewise
from mapmore_cli.modelling.program.writing import Inputs, Writer, limit, product_as_written, total

BLOCK = 2**18
"""Rows at a time: few enough to stay in the processor's cache, and enough for every region to have
many.
"""

DIGITS = 6
"""Digits of the printed numbers; model.h5 holds all of them."""


def build(
    name: str,
    output: Quantity,
    fit: FormulaFit,
    level: str | None,
    training: Sequence[SegmentedCurve],
    quantities: Mapping[str, Quantity],
) -> Model:
    """Return a fitted formula as a model; the `training` curves, in the order of their levels, say
    the range of its inputs.
    """
    inputs = sorted({*literature.of(fit).inputs, *([level] if level is not None else [])})
    ordered = sorted(training, key=lambda curve: (curve.level is not None, curve.level))
    ranges = tuple(
        CurveRange(curve.curve, curve.level, {i: curve.limits[i] for i in inputs})
        for curve in ordered
    )
    return Model(name, output, tuple(quantities[i] for i in inputs), Formula(fit, level, ranges))


def simulate(model: Model, columns: Columns) -> Run:
    """Return the formula at every row, (n,); NaN where an input is."""
    body = model.body
    assert isinstance(body, Formula)
    return Run(
        by_blocks(model.inputs, columns, lambda inputs, n: backbone_values(body.fit, inputs, n))
    )


def parameters(model: Model) -> int:
    """Return the parameters of the formula."""
    assert isinstance(model.body, Formula)
    return len(model.body.fit.parameters)


def equations(model: Model, units: Mapping[str, float]) -> tuple[Equation, ...]:
    """Return the formula with its parameters put in."""
    assert isinstance(model.body, Formula)
    return formula_equations(model.body.fit, units)


def backbone_values(fit: FormulaFit | None, inputs: Columns, n: int) -> Array:
    """Return a fitted formula at n rows; zero where there is none."""
    return np.zeros(n) if fit is None else literature.of(fit).predict(fit.parameters, inputs)


def formula_equations(fit: FormulaFit | None, units: Mapping[str, float]) -> tuple[Equation, ...]:
    """Return a fitted formula by the names of its parts; `units` says how many of the model's units
    one unit of a quantity is.
    """
    if fit is None:
        return ()
    other = {name: multiply(Number(factor), Name(name)) for name, factor in units.items()}
    return tuple(
        printed(name, substitute(formula, other))
        for name, formula in literature.of(fit).equations(fit).items()
    )


def printed(name: str, expression: Expression) -> Equation:
    """Return an equation as text and as LaTeX."""
    return Equation(name, to_text(expression, DIGITS), to_latex(expression, DIGITS))


def by_blocks(
    inputs: Sequence[Quantity], columns: Columns, value: Callable[[dict[str, Array], int], Array]
) -> Array:
    """Return a function of the inputs, block of rows by block; NaN where an input is not finite,
    (n,).
    """
    given = {
        quantity.name: np.asarray(columns[quantity.name], dtype=np.float64) for quantity in inputs
    }
    y = np.empty(len(next(iter(columns.values()))))
    for start in range(0, len(y), BLOCK):
        block = {name: x[start : start + BLOCK] for name, x in given.items()}
        n = len(y[start : start + BLOCK])
        finite = np.logical_and.reduce(
            [np.ones(n, dtype=np.bool_), *(np.isfinite(x) for x in block.values())]
        )
        with np.errstate(
            all="ignore"
        ):  # a term may overflow far outside, and what follows from a NaN is replaced
            y[start : start + BLOCK] = np.where(finite, value(block, n), np.nan)
    return y


def write(m: Writer, model: Model, inputs: Inputs) -> Expression:
    """Write a formula alone."""
    assert isinstance(model.body, Formula)
    limit(m, model.body.ranges, model.body.level, inputs)
    return formula_value(m, model.body.fit, inputs)


def formula_value(
    m: Writer, fit: FormulaFit | None, inputs: Mapping[str, Expression]
) -> Expression:
    """Write a fitted formula; zero where there is none.

    Raises DataError where the fit failed, or the formula is no closed expression.
    """
    if fit is None:
        return Number(0.0)
    if fit.failed:
        raise DataError(
            f"the fit of {fit.name} failed: there is no formula to export",
            "fit it to other data, or choose another formula",
        )
    model = literature.of(fit)
    match model:
        case piecewise.PiecewiseFormula():
            return _by_region(m, model, fit, inputs)
        case literature.Formula():
            return m.let("formula", with_numbers(model.expression, fit.parameters, inputs))
    raise DataError(
        f"{fit.name} searches for the free strain at every sample, which is no closed "
        "expression: it cannot be exported",
        "export the models that it is compared with, or a formula of the damping force itself",
    )


def with_numbers(
    expression: Expression, numbers: Mapping[str, float], names: Mapping[str, Expression]
) -> Expression:
    """Put in numbers and other names as they stand; `substitute` would fold numbers, and round
    otherwise than a prediction.
    """
    match expression:
        case Name(name):
            return Number(numbers[name]) if name in numbers else names[name]
        case Sum(terms):
            return total([with_numbers(term, numbers, names) for term in terms])
        case Product(factors):
            return product_as_written(*(with_numbers(factor, numbers, names) for factor in factors))
        case Power(base, exponent):
            return Power(with_numbers(base, numbers, names), exponent)
        case Call(function, argument):
            return Call(function, with_numbers(argument, numbers, names))
    return expression


def _by_region(
    m: Writer, model: piecewise.PiecewiseFormula, fit: FormulaFit, inputs: Mapping[str, Expression]
) -> Expression:
    """Write the local formula of the region that the sample lies in; zero in none."""
    value: Expression = Number(0.0)
    for region in reversed(model.regions):
        own = {name: fit.parameters[region.parameter(name)] for name in model.local.parameters}
        value = _where(
            m, region.conditions, inputs, with_numbers(model.local.expression, own, inputs), value
        )
    return value


def _where(
    m: Writer,
    conditions: Sequence[piecewise.Condition],
    inputs: Mapping[str, Expression],
    inside: Expression,
    outside: Expression,
) -> Expression:
    """Write `inside` where all conditions hold, else `outside`."""
    first, *rest = conditions
    holds = Condition(inputs[first.quantity], first.comparison, Number(first.value))
    return m.choose(
        "region",
        [
            (
                holds,
                lambda: (
                    _where(m, rest, inputs, inside, outside) if rest else m.let("local", inside)
                ),
            )
        ],
        outside,
    )
