"""A formula as one line of text, from which prediction, derivatives, fitting and equation
follow.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar, Self

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns, row_count
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.domain.fits import FormulaFit, Optimum
from mapmore_cli.modelling.expressions import (
    Expression,
    Number,
    derivative,
    dictionary_matrix,
    evaluate,
    parse,
    substitute,
)
from mapmore_cli.modelling.literature import linear, solvers
from mapmore_cli.modelling.literature.problem import (
    LeastSquares,
    Nonlinear,
    dependence,
    finite,
)

TARGET = "target"
LOAD_CYCLES = "load_cycles"
RANDOM = "random"


@dataclass(frozen=True)
class LinearForm:
    """A formula in other parameters than the printed ones: in those that make it linear.

    `text` is the same function of the inputs, `linear` names the parameters in which it is linear,
    and `printed` has every printed parameter as an expression of these and of the nonlinear ones.
    """

    text: str
    linear: tuple[str, ...]
    printed: Mapping[str, str]


@dataclass(frozen=True)
class Formula:
    """A parametric model with a name, which one expression holds; its output may stand against any
    target.

    - `name`, `reference`: as in the spec, and where it is published.
    - `inputs`: quantities that it predicts from.
    - `parameters`: in the order of the publication.
    - `text`: the formula as an expression of inputs and parameters.
    - `nonlinear`: the parameters in which it is not linear, and where to seek them; every term must
      be linear in one of the others, or hold a dimension of the muscle.
    - `form`: how it is fitted, where it is printed in parameters in which it is not linear.
    - `published_starts`: starting values that papers print for it, by the names that specs have for
      them.
    - `start`: the one of them that `levenberg_marquardt` starts from, or `random`.
    - `near`: parameters near the least error, as those of a fit to more of the same samples are:
      the default method begins there and does not search.
    - `title`: as people write the name; the name where there is none.
    - `about`: what it is, where the docstring of its file does not say it.
    - `component`: the component of the force that it was published for, `static`, `damping` or
      `dynamic`.
    - `dimensions`: those of its parameters that are dimensions of the muscle (`diameter`, in m),
      given and not fitted.
    - `given`: values of the dimensions, once `of_muscle` has put them in.
    - `units`, `definition`: units of the parameters, and what defines the formula, where a spec
      does (`own`).
    - `fitted_to`: `target`: fitted by `fit`. `load_cycles`: fitted by a method of its own to
      another experiment than it predicts.
    """

    name: str
    reference: str
    inputs: tuple[str, ...]
    parameters: tuple[str, ...]
    text: str
    nonlinear: tuple[Nonlinear, ...] = ()
    form: LinearForm | None = None
    published_starts: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    start: str = RANDOM
    near: Mapping[str, float] | None = field(default=None, kw_only=True)
    title: str = field(default="", kw_only=True)
    about: str = field(default="", kw_only=True)
    component: str = field(default="static", kw_only=True)
    dimensions: tuple[str, ...] = field(default=(), kw_only=True)
    given: Mapping[str, float] = field(default_factory=dict, kw_only=True)
    units: Mapping[str, str] = field(default_factory=dict, kw_only=True)
    definition: str = field(default="", kw_only=True)

    fitted_to: ClassVar[str] = TARGET

    def of_muscle(self, lengths: Mapping[str, float | None]) -> Self:
        """Return the formula with the dimensions of a muscle, in m, those that it needs among
        `lengths`.

        Raises `SpecError` if one of them is not known.
        """
        for name in self.dimensions:
            if not lengths.get(name):
                raise SpecError(
                    f"{self.name} needs the {name} of the muscle",
                    f"add `{name}: 10 mm` (with your own number) to `muscle`",
                )
        given = {name: value for name in self.dimensions if (value := lengths.get(name))}
        return replace(self, given=given)

    def checked(self) -> Self:
        """Return the formula; raises ValueError if its text is not what it declares."""
        if self.expression.names != {*self.inputs, *self.parameters}:
            raise ValueError(
                f"{self.name}: the names in the text are not the inputs and parameters"
            )
        without = with_numbers(self._fitted_expression, dict.fromkeys(self.linear, 0.0))
        if not (self.dimensions or self.definition) and without != Number(0.0):
            raise ValueError(f"{self.name}: a term has no linear parameter")
        if any(
            derivative(self._fitted_expression, name).names & {*self.linear} for name in self.linear
        ):
            raise ValueError(f"{self.name}: a parameter is nonlinear without being declared so")
        return self

    def starting_from(self, start: str) -> Formula:
        """Return the formula fitted from published starting values, or from random ones.

        Raises `SpecError` for starting values that nobody has published for it.
        """
        known = (RANDOM, *self.published_starts)
        if start not in known:
            raise SpecError(
                f"{self.name} has no starting values called `{start}`",
                f"write one of {', '.join(known)}",
            )
        return replace(self, start=start)

    @property
    def expression(self) -> Expression:
        """The formula with its parameters as names."""
        return parse(self.text)

    @cached_property
    def fitted(self) -> tuple[str, ...]:
        """Names of the parameters that a fit finds: all but the dimensions of the muscle."""
        return tuple(name for name in self.parameters if name not in self.dimensions)

    @cached_property
    def linear(self) -> tuple[str, ...]:
        """Names of the parameters in which the formula is linear, those of its linear form where it
        has one.
        """
        if self.form is not None:
            return self.form.linear
        nonlinear = {parameter.name for parameter in self.nonlinear}
        return tuple(name for name in self.fitted if name not in nonlinear)

    @property
    def _fitted_expression(self) -> Expression:
        return parse((self.form or self).text)

    def fit(self, columns: Columns, y: Array, method: str | None = None) -> FormulaFit:
        """Least-squares fit to the target `y`, `(n,)`, with the inputs among `columns`.

        `method` is `variable_projection` (the default: no starting values with at most one
        nonlinear parameter, bounds and ten starts with more; for a linear formula, linear least
        squares), `levenberg_marquardt` (ten starts, no bounds) or `simplex` (the same, without
        derivatives). A poor fit is told by the status and the notes, never raised.

        Raises DataError for a value that is not finite, an absent input, or fewer samples than
        parameters; SpecError for a dimension of the muscle that `of_muscle` has not put in;
        ValueError for an unknown method.
        """
        default = next(iter(solvers.METHODS))
        method = method or default
        if method not in solvers.METHODS:
            raise ValueError(f"unknown method `{method}`; there are {', '.join(solvers.METHODS)}")
        if self.start != RANDOM and method != solvers.LEVENBERG_MARQUARDT:
            raise SpecError(
                f"the method {method} does not use starting values",
                f"write `method: {solvers.LEVENBERG_MARQUARDT}` beside `starts`",
            )
        problem = self.problem(columns, y)
        if self.near is not None and method == default:
            problem = replace(problem, start=self.near)
        # without parameters there is nothing to descend to
        return self._result(problem, solvers.METHODS[method if self.fitted else default](problem))

    def predict(self, parameters: Mapping[str, float], columns: Columns) -> Array:
        """Return the formula on every row, `(n,)`; NaN with the parameters of a failed fit."""
        values = {name: columns[name] for name in self.inputs if name in columns}
        values |= {name: np.asarray(parameters[name]) for name in self.parameters}
        return evaluate(self.expression, values, row_count(columns))

    def equations(self, fit: FormulaFit) -> dict[str, Expression]:
        """`equation`, by the name of the formula; of some formulas, one for each of their parts."""
        return {self.name: self.equation(fit)}

    def equation(self, fit: FormulaFit) -> Expression:
        """Return the formula with the numbers of a fit that has not failed, in physical units."""
        return with_numbers(self.expression, fit.parameters)

    def problem(self, columns: Columns, y: Array) -> LeastSquares:
        """Return the rows in canonical order, so that the order of the samples cannot change a
        digit of the fit; raises as `fit`.
        """
        inputs = {name: finite(name, columns) for name in self.inputs}
        target = finite("the target", {"the target": y})
        if len(target) < len(self.fitted):
            raise DataError(
                f"{self.name} has {len(self.fitted)} parameters, but there are only "
                f"{len(target)} samples to fit them to",
                "add training data, or remove this formula",
            )
        expression = with_numbers(self._fitted_expression, self.of_muscle(self.given).given)
        names = (*self.linear, *(parameter.name for parameter in self.nonlinear))
        order = np.lexsort([target, *inputs.values()])
        return LeastSquares(
            expression,
            self.linear,
            self.nonlinear,
            {name: derivative(expression, name) for name in names},
            {name: column[order] for name, column in inputs.items()},
            target[order],
            start=self.published_starts.get(self.start),
        )

    def _result(self, problem: LeastSquares, solution: solvers.Solution) -> FormulaFit:
        values, notes = self._printed(problem, solution.beta, solution.c), solution.notes
        count, samples = len(self.fitted), len(problem.y)
        unknown, status = dict.fromkeys(self.parameters, float("nan")), solution.status
        failed = not np.isfinite(list(values.values())).all()
        if failed and status != "failed":
            notes = (*notes, "the formula has no finite value with its published parameters")
        fit = FormulaFit(
            *(self.name, unknown, unknown, "failed", solution.method, 0, np.nan, np.nan, samples),
            notes=notes,
            definition=self.definition,
        )
        if failed:
            return fit
        sse, freedom = problem.sse(solution.beta, solution.c), samples - count
        deviations, rank, condition = linear.parameter_errors(
            self._jacobian(values, problem.columns, samples),
            sse / freedom if freedom else np.nan,
        )
        errors = dict(zip(self.fitted, map(float, deviations), strict=True))
        if rank < count:
            one = (
                "the solution of least norm"
                if len(self.nonlinear) <= 1
                else ("one of many equally good solutions")
            )
            notes = (*notes, dependence(rank, count, problem.columns, f"{one} was taken"))
        elif not self.nonlinear:
            held = problem.at_levels.columns
            _, least, _ = linear.parameter_errors(self._jacobian(values, held, samples), 0.0)
            if least < count:
                decided = "the choice depends on how the measured values scatter about these levels"
                notes = (*notes, dependence(least, count, held, decided))
        weak = [
            name
            for name, error in errors.items()
            if not linear.half_width(error, freedom) <= abs(values[name])
        ]
        if weak and freedom:
            notes = (*notes, f"not identified (95 % interval beyond zero): {', '.join(weak)}")
        rivals = [Optimum(self._printed(problem, *at), problem.sse(*at)) for at in solution.rivals]
        return replace(
            fit,
            parameters=values,
            errors={**unknown, **errors},
            status=status if rank == count else "rank_deficient",
            rank=rank,
            condition=condition,
            sse=sse,
            notes=notes,
            rivals=tuple(rivals),
        )

    def _printed(self, problem: LeastSquares, beta: Array, c: Array) -> dict[str, float]:
        """Return the parameters as printed, from those of the linear form, and the dimensions."""
        given = {name: np.asarray(value) for name, value in self.given.items()}
        values = {**problem.values(beta, c), **given}
        printed = {} if self.form is None else self.form.printed
        return {
            name: float(evaluate(parse(printed.get(name, name)), values, 1)[0])
            for name in self.parameters
        }

    def _jacobian(self, values: Mapping[str, float], columns: Columns, n: int) -> Array:
        """Return derivatives for the fitted parameters at `values`, `(n, p)`."""
        numbers = {name: np.asarray(value) for name, value in values.items()}
        gradient = [derivative(self.expression, name) for name in self.fitted]
        return dictionary_matrix(gradient, {**columns, **numbers}, n)


def with_numbers(expression: Expression, numbers: Mapping[str, float]) -> Expression:
    """Return the expression with numbers in place of names."""
    return substitute(expression, {name: Number(value) for name, value in numbers.items()})
