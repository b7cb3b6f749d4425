"""Define a formula by one line of text. Its predictions, derivatives, fits and printed equations
all follow from this text.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar, Self

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns, columns_at, row_count
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
    """A formula with new parameters in place of the published ones. The new parameters are chosen
    so that the formula is linear in most of them.

    `text` is the formula with the new parameters, and `linear` names those in which it is linear.
    `printed` gives each published parameter as an expression of the new parameters.
    """

    text: str
    linear: tuple[str, ...]
    printed: Mapping[str, str]


@dataclass(frozen=True)
class Formula:
    """A parametric model with a name, defined by one expression. Its output may be compared with
    any target.

    - `name`: name of the formula in a spec. `reference`: publication of the formula.
    - `inputs`: quantities from which the formula computes its output.
    - `parameters`: names in the order of the publication.
    - `text`: the formula as an expression of inputs and parameters.
    - `nonlinear`: parameters in which the formula is not linear, with the intervals in which a fit
      searches them. Every term must have a factor that is a linear parameter or a dimension of the
      muscle.
    - `form`: linear form in which it is fitted, if it is not linear in the printed parameters.
    - `published_starts`: starting values that papers print, by the name that a spec uses.
    - `start`: name of the starting values that `levenberg_marquardt` uses, or `random`.
    - `near`: parameters at which the default method begins, for example those of the fit to all
      samples if some samples are now left out; None if the method must search for starting values.
    - `title`: usual name in texts; `name` if it is empty.
    - `about`: explanation of the formula; by default the docstring of its module.
    - `component`: component of the force for which it was published: `static`, `damping` or
      `dynamic`.
    - `dimensions`: parameters that are dimensions of the muscle (for example `diameter`, in m),
      which are given and not fitted.
    - `given`: values of the dimensions, after `of_muscle` has set them.
    - `constants_for`: quantities for which the text contains numbers, for example `1 - strain`.
      The formula therefore needs these quantities in their default units (kPa, N, m; strain as a
      fraction).
    - `units`, `definition`: units of the parameters, and the text that defines the formula, for a
      formula of a spec (`own`).
    - `fitted_to`: `target` for a formula that `fit` fits; `load_cycles` for one that has its own
      method and is fitted to another experiment than the one it predicts.
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
    constants_for: tuple[str, ...] = field(default=(), kw_only=True)
    units: Mapping[str, str] = field(default_factory=dict, kw_only=True)
    definition: str = field(default="", kw_only=True)

    fitted_to: ClassVar[str] = TARGET

    def of_muscle(self, lengths: Mapping[str, float | None]) -> Self:
        """Return the formula with the dimensions of a muscle, in m, which are taken from `lengths`.

        Raises SpecError if a dimension that the formula needs is unknown.
        """
        for name in self.dimensions:
            if not lengths.get(name):
                raise SpecError(
                    f"{self.name} needs the {name} of the muscle",
                    f"add `{name}: 10 mm` (with your own number) to `muscle`",
                )
        known_lengths = {name: value for name in self.dimensions if (value := lengths.get(name))}
        return replace(self, given=known_lengths)

    def checked(self) -> Self:
        """Return the formula unchanged. Raises ValueError if its text contradicts the declared
        inputs and parameters.
        """
        if self.expression.names != {*self.inputs, *self.parameters}:
            raise ValueError(
                f"{self.name}: the expression must contain all declared inputs and parameters of "
                "the formula, and no other name"
            )
        without = with_numbers(self._fitted_expression, dict.fromkeys(self.linear, 0.0))
        if not (self.dimensions or self.definition) and without != Number(0.0):
            raise ValueError(f"{self.name}: a term has no linear parameter")
        for name in self.linear:
            if others := derivative(self._fitted_expression, name).names & {*self.linear}:
                raise ValueError(
                    f"{self.name}: add `{name}` to `nonlinear`, because the derivative of the "
                    f"formula with respect to `{name}` contains `{min(others)}`"
                )
        return self

    def starting_from(self, start: str) -> Formula:
        """Return the formula with the given starting values for its fit. `start` is the name of
        published values, or `random`.

        Raises SpecError if no starting values of this name are published.
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
        """The formula as an expression, in which the parameters are names."""
        return parse(self.text)

    @cached_property
    def fitted(self) -> tuple[str, ...]:
        """Names of the parameters that a fit estimates: all except the dimensions of the muscle."""
        return tuple(name for name in self.parameters if name not in self.dimensions)

    @cached_property
    def linear(self) -> tuple[str, ...]:
        """Names of the parameters in which the formula, or its linear form, is linear."""
        if self.form is not None:
            return self.form.linear
        nonlinear = {parameter.name for parameter in self.nonlinear}
        return tuple(name for name in self.fitted if name not in nonlinear)

    @property
    def _fitted_expression(self) -> Expression:
        return parse((self.form or self).text)

    def fit(self, columns: Columns, y: Array, method: str | None = None) -> FormulaFit:
        """Fit the formula by least squares to the target `y`, shape (n,), with its inputs among
        `columns`.

        There are three methods. `variable_projection` is the default. It needs no starting values
        if at most one parameter is nonlinear; otherwise, it uses bounds and 13 starts. (A linear
        formula is fitted by linear least squares.) `levenberg_marquardt` uses ten starts and no
        bounds. `simplex` also uses ten starts and no bounds, and it needs no derivatives. A poor
        fit raises no error; the status and the notes of the result report it.

        Raises DataError for a value that is not finite, a missing input, or fewer samples than
        parameters; SpecError for a dimension of the muscle that `of_muscle` has not set; ValueError
        for an unknown method.
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
        # a formula without fitted parameters is evaluated by the default method
        return self._result(problem, solvers.METHODS[method if self.fitted else default](problem))

    def predict(self, parameters: Mapping[str, float], columns: Columns) -> Array:
        """Return the output of the formula at every row, shape (n,); NaN if the fit failed."""
        values = {name: columns[name] for name in self.inputs if name in columns}
        values |= {name: np.asarray(parameters[name]) for name in self.parameters}
        return evaluate(self.expression, values, row_count(columns))

    def equations(self, fit: FormulaFit) -> dict[str, Expression]:
        """Return the equations of a fit by their names. Most formulas have one equation; for some,
        equations of their parts follow.
        """
        return {self.name: self.equation(fit)}

    def equation(self, fit: FormulaFit) -> Expression:
        """Return the formula with the fitted parameters as numbers, in physical units. The fit must
        have succeeded.
        """
        return with_numbers(self.expression, fit.parameters)

    def problem(self, columns: Columns, y: Array) -> LeastSquares:
        """Return the least-squares problem with sorted rows, so that the order of the samples
        cannot change a digit of the fit. Raises the same errors as `fit`.
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
            columns_at(inputs, order),
            target[order],
            start=self.near or self.published_starts.get(self.start),
        )

    def _result(self, problem: LeastSquares, solution: solvers.Solution) -> FormulaFit:
        values, notes = self._printed(problem, solution.beta, solution.c), solution.notes
        count, samples = len(self.fitted), len(problem.y)
        unknown, status = dict.fromkeys(self.parameters, float("nan")), solution.status
        failed = not np.isfinite(list(values.values())).all()
        if failed and status != "failed":
            notes = (*notes, "the fit gives no finite value for a parameter of the printed formula")
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
        notes = (*notes, *self._dependences(problem, values, rank))
        weak = [
            name
            for name, error in errors.items()
            if not linear.half_width(error, freedom) <= abs(values[name])
        ]
        if weak and freedom:
            notes = (*notes, f"not identified (95 % interval contains zero): {', '.join(weak)}")
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

    def _dependences(
        self, problem: LeastSquares, values: Mapping[str, float], rank: int
    ) -> Iterator[str]:
        """Yield a note if the data do not determine all parameters, or if the data determine some
        parameters only because the measured inputs scatter about their nominal levels.
        """
        count = len(self.fitted)
        if not self.nonlinear:
            held = problem.at_levels.columns
            jacobian = self._jacobian(values, held, len(problem.y))
            _, least, _ = linear.parameter_errors(jacobian, 0.0)
            if least < rank:
                decided = "the choice depends on how the measured values scatter about these levels"
                yield dependence(least, count, held, decided)
                return
        if rank < count:
            choice = (
                "the solution of least norm"
                if len(self.nonlinear) <= 1
                else "one of many equally good solutions"
            )
            yield dependence(rank, count, problem.columns, f"{choice} was taken")

    def _printed(self, problem: LeastSquares, beta: Array, c: Array) -> dict[str, float]:
        """Return all published parameters by name: the fitted ones, computed from the parameters of
        the linear form, and the dimensions of the muscle.
        """
        dimensions = {name: np.asarray(value) for name, value in self.given.items()}
        values = {**problem.values(beta, c), **dimensions}
        printed = {} if self.form is None else self.form.printed
        return {
            name: float(evaluate(parse(printed.get(name, name)), values, 1)[0])
            for name in self.parameters
        }

    def _jacobian(self, values: Mapping[str, float], columns: Columns, n: int) -> Array:
        """Return the derivatives of the formula with respect to the fitted parameters, at the
        parameter values `values`, shape (n, p).
        """
        numbers = {name: np.asarray(value) for name, value in values.items()}
        gradient = [derivative(self.expression, name) for name in self.fitted]
        return dictionary_matrix(gradient, {**columns, **numbers}, n)


def with_numbers(expression: Expression, numbers: Mapping[str, float]) -> Expression:
    """Return the expression with each name in `numbers` replaced by its number."""
    return substitute(expression, {name: Number(value) for name, value in numbers.items()})
