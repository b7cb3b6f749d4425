"""Write formulas of the literature as statements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.expressions import Expression, Name, Number
from mapmore_cli.modelling.expressions.syntax import Call, Condition, Power, Product, Sum
from mapmore_cli.modelling.literature import cells
from mapmore_cli.modelling.literature.formula import Formula
from mapmore_cli.modelling.literature.hysteresis_loss import HysteresisLoss
from mapmore_cli.modelling.literature.piecewise import PiecewiseFormula
from mapmore_cli.modelling.program.writing import Writer, times, total


def formula_value(m: Writer, fit: FormulaFit | None, inputs: Mapping[str, Expression]) -> Expression:
    """Write a fitted formula; zero where there is none.

    Raises DataError where the fit failed, or the formula is no closed expression.
    """
    if fit is None:
        return Number(0.0)
    if fit.failed:
        raise DataError(f"the fit of {fit.name} failed: there is no formula to export", "fit it to other data, or choose another formula")
    model = literature.of(fit)
    match model:
        case PiecewiseFormula():
            return _by_region(m, model, fit, inputs)
        case Formula():
            return m.let("formula", with_numbers(model.expression, fit.parameters, inputs))
        case HysteresisLoss():
            raise DataError(
                f"{fit.name} searches for the free strain at every sample, which is no closed expression: it cannot be exported",
                "export the models that it is compared with, or a formula of the damping force itself",
            )
    raise DataError(f"{fit.name} cannot be exported", None)


def with_numbers(expression: Expression, numbers: Mapping[str, float], names: Mapping[str, Expression]) -> Expression:
    """Put in numbers and other names as they stand; `substitute` would fold numbers, and round otherwise than a prediction."""
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


def _by_region(m: Writer, model: PiecewiseFormula, fit: FormulaFit, inputs: Mapping[str, Expression]) -> Expression:
    """Write the local formula of the region that the sample lies in; zero in none."""
    value: Expression = Number(0.0)
    for region in reversed(model.regions):
        own = {name: fit.parameters[region.parameter(name)] for name in model.local.parameters}
        value = _where(m, region.conditions, inputs, with_numbers(model.local.expression, own, inputs), value)
    return value


def _where(
    m: Writer, conditions: Sequence[cells.Condition], inputs: Mapping[str, Expression], inside: Expression, outside: Expression
) -> Expression:
    """Write `inside` where all conditions hold, else `outside`."""
    first, *rest = conditions
    holds = Condition(inputs[first.quantity], first.comparison, Number(first.value))
    return m.choose("region", [(holds, lambda: _where(m, rest, inputs, inside, outside) if rest else m.let("local", inside))], outside)
