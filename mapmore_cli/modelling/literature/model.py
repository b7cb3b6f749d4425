"""Evaluate, print and export a formula of the literature, which is the whole model or the backbone
of a model.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns, row_count
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.models import Equation, Formula, Model
from mapmore_cli.domain.recording import CurveRange, Quantity
from mapmore_cli.domain.results import SimulatedRun
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.equations import as_equation
from mapmore_cli.modelling.expressions import (
    Expression,
    Name,
    Number,
    folded,
    multiply,
    substitute,
)
from mapmore_cli.modelling.kinds import Verbs
from mapmore_cli.modelling.literature.formula import with_numbers
from mapmore_cli.modelling.program.writing import Inputs, Writer, limit

DIGITS = 6
"""Significant digits of printed numbers; model.h5 holds all digits."""


def formula_model(
    name: str,
    output: Quantity,
    fit: FormulaFit,
    level: str | None,
    training: Sequence[CurveRange],
    quantities: Mapping[str, Quantity],
) -> Model:
    """Return a fitted formula as a model. The model contains the range of its inputs in each
    `training` curve, in the order of the levels.
    """
    inputs = sorted({*literature.of(fit).inputs, *([level] if level is not None else [])})
    ordered = sorted(training, key=lambda curve: (curve.level is not None, curve.level))
    ranges = tuple(curve.of(inputs) for curve in ordered)
    return Model(name, output, tuple(quantities[i] for i in inputs), Formula(fit, level, ranges))


def backbone_values(fit: FormulaFit | None, inputs: Columns, n: int) -> Array:
    """Return the output of a fitted formula at n rows; zeros if there is no formula."""
    return np.zeros(n) if fit is None else literature.of(fit).predict(fit.parameters, inputs)


def formula_equations(fit: FormulaFit | None, units: Mapping[str, float]) -> tuple[Equation, ...]:
    """Return the equations of a fitted formula. If a printed quantity has another unit than in the
    model, `units` gives the factor that converts printed values to the unit of the model.
    """
    if fit is None:
        return ()
    other = {name: multiply(Number(factor), Name(name)) for name, factor in units.items()}
    return tuple(
        printed(name, substitute(formula, other))
        for name, formula in literature.of(fit).equations(fit).items()
    )


def printed(name: str, expression: Expression) -> Equation:
    """Return an equation in which numbers are combined if possible, and rounded to six digits."""
    return as_equation(name, folded(expression), DIGITS)


def where_finite(
    inputs: Sequence[Quantity], columns: Columns, value: Callable[[dict[str, Array], int], Array]
) -> Array:
    """Return the values of a function of the inputs, shape (n,); NaN if an input is not finite."""
    values = {
        quantity.name: np.asarray(columns[quantity.name], dtype=np.float64) for quantity in inputs
    }
    n = row_count(columns)
    finite = np.logical_and.reduce([np.ones(n, dtype=np.bool_), *map(np.isfinite, values.values())])
    # no warnings: terms may overflow far outside the data, and rows with NaN are replaced below
    with np.errstate(all="ignore"):
        return np.where(finite, value(values, n), np.nan)


def formula_value(
    m: Writer, fit: FormulaFit | None, inputs: Mapping[str, Expression]
) -> Expression:
    """Write a fitted formula as statements of a program, and return its value; zero if there is no
    formula.

    Raises DataError if the fit failed, or if the formula is fitted to load cycles, because such a
    formula searches for the free strain at every sample.
    """
    if fit is None:
        return Number(0.0)
    if fit.failed:
        raise DataError(
            f"the fit of {fit.name} failed, so that there is no formula to export",
            "fit it to other data, or choose another formula",
        )
    model = literature.of(fit)
    if model.fitted_to == literature.LOAD_CYCLES:
        raise DataError(
            f"{fit.name} searches for the free strain at every sample, so that it is not a "
            "closed expression and cannot be exported",
            "export the model of the run, or another formula of the damping force",
        )
    return m.let("formula", substitute(with_numbers(model.expression, fit.parameters), inputs))


class FormulaVerbs(Verbs):
    """Operations of a model that consists of a formula only."""

    def simulate(self, model: Model, columns: Columns) -> SimulatedRun:
        """Return the output of the formula at every row, shape (n,); NaN in rows in which an input
        is NaN.
        """
        fit = model.body_of(Formula).fit
        return SimulatedRun(
            where_finite(model.inputs, columns, lambda inputs, n: backbone_values(fit, inputs, n))
        )

    def parameters(self, model: Model) -> int:
        """Return the number of parameters of the formula."""
        return len(model.body_of(Formula).fit.parameters)

    def equations(self, model: Model, units: Mapping[str, float]) -> tuple[Equation, ...]:
        """Return the equations of the formula with the values of its parameters."""
        return formula_equations(model.body_of(Formula).fit, units)

    def write(self, m: Writer, model: Model, inputs: Inputs) -> Expression:
        """Write the formula as statements, and return its value."""
        body = model.body_of(Formula)
        limit(m, body.ranges, body.level, inputs)
        return formula_value(m, body.fit, inputs)
