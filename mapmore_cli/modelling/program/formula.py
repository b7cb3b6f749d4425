"""Write formulas of the literature as statements."""

from __future__ import annotations

from collections.abc import Mapping

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.literature.cells import Region
from mapmore_cli.modelling.literature.formula import Formula
from mapmore_cli.modelling.literature.hysteresis_loss import HysteresisLoss
from mapmore_cli.modelling.literature.piecewise import PiecewiseFormula
from mapmore_cli.modelling.program.statements import Block
from mapmore_cli.modelling.program.writing import Lines, times, total
from mapmore_cli.modelling.terms import Expression, Name, Number
from mapmore_cli.modelling.terms.syntax import Call, Condition, Power, Product, Sum


def formula_value(lines: Lines, fit: FormulaFit | None, inputs: Mapping[str, Expression]) -> Expression:
    """A fitted formula; zero where there is none.

    Raises
    ------
    DataError
        Where the fit failed, or the formula is no closed expression.
    """
    if fit is None:
        return Number(0.0)
    if fit.failed:
        raise DataError(f"the fit of {fit.name} failed: there is no formula to export", "fit it to other data, or choose another formula")
    model = literature.get(fit.name)
    match model:
        case PiecewiseFormula():
            return _by_region(lines, model, fit, inputs)
        case Formula():
            return lines.let("formula", with_numbers(model.expression, fit.parameters, inputs))
        case HysteresisLoss():
            raise DataError(
                f"{fit.name} searches for the free strain at every sample, which is no closed expression: it cannot be exported",
                "export the models that it is compared with, or a formula of the damping force itself",
            )
    raise DataError(f"{fit.name} cannot be exported", None)


def with_numbers(expression: Expression, numbers: Mapping[str, float], names: Mapping[str, Expression]) -> Expression:
    """Numbers and other names put in as they stand: `substitute` would fold numbers, and so round in another way than a prediction."""
    match expression:
        case Name(name):
            return Number(numbers[name]) if name in numbers else names[name]
        case Sum(terms):
            return total([with_numbers(term, numbers, names) for term in terms])
        case Product(factors):
            return times(*(with_numbers(factor, numbers, names) for factor in factors))
        case Power(base, exponent):
            return Power(with_numbers(base, numbers, names), exponent)
        case Call(function, argument):
            return Call(function, with_numbers(argument, numbers, names))
    return expression


def _by_region(lines: Lines, model: PiecewiseFormula, fit: FormulaFit, inputs: Mapping[str, Expression]) -> Expression:
    """The local formula of the region that the sample lies in; zero in none."""
    value: Expression = Number(0.0)
    for region in reversed(model.regions):
        own = {name: fit.parameters[region.parameter(name)] for name in model.local.parameters}
        inside = Lines(lines.names)
        local = inside.let("local", with_numbers(model.local.expression, own, inputs))
        value = _where(lines, region, inputs, inside.block(local), value)
    return value


def _where(lines: Lines, region: Region, inputs: Mapping[str, Expression], inside: Block, outside: Expression) -> Expression:
    """The block where all conditions of a region hold."""
    block: Block = inside
    for condition in reversed(region.conditions[1:]):
        nested = Lines(lines.names)
        found = nested.choose("region", [(_condition(condition.quantity, condition.comparison, condition.value, inputs), block)], outside)
        block = nested.block(found)
    first = region.conditions[0]
    return lines.choose("region", [(_condition(first.quantity, first.comparison, first.value, inputs), block)], outside)


def _condition(quantity: str, comparison: str, value: float, inputs: Mapping[str, Expression]) -> Condition:
    return Condition(inputs[quantity], comparison, Number(value))
