"""A formula as one line of text, from which prediction, derivatives, fitting and the printed equation follow."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeGuard

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.domain.fits import FormulaFit, Optimum
from mapmore_cli.modelling.expressions import Expression, Number, derivative, dictionary_matrix, evaluate, parse, substitute
from mapmore_cli.modelling.literature import errors_in, levenberg_marquardt, linear, varpro
from mapmore_cli.modelling.literature.cells import finite, needed
from mapmore_cli.modelling.literature.identifiability import hints
from mapmore_cli.modelling.literature.literature_model import LiteratureModel
from mapmore_cli.modelling.literature.problem import Nonlinear, Problem, Solution

VARIABLE_PROJECTION = "variable_projection"
LEVENBERG_MARQUARDT = "levenberg_marquardt"
SIMPLEX = "simplex"
RANDOM = "random"

_SOLVERS: Mapping[str, Callable[[Problem], Solution]] = {
    VARIABLE_PROJECTION: varpro.fit,
    LEVENBERG_MARQUARDT: levenberg_marquardt.fit,
    SIMPLEX: levenberg_marquardt.fit_simplex,
}


@dataclass(frozen=True)
class LinearForm:
    """A formula in other parameters than the printed ones: in those that make it linear.

    `text` is the same function of the inputs, `linear` names the parameters in which it is linear, and `printed` has every printed
    parameter as an expression of these and of the nonlinear ones.
    """

    text: str
    linear: tuple[str, ...]
    printed: Mapping[str, str]

    @cached_property
    def expression(self) -> Expression:
        """The text, parsed."""
        return parse(self.text)


@dataclass(frozen=True)
class Formula(LiteratureModel):
    """A formula that one expression holds.

    - `text`: the formula as an expression of inputs and parameters.
    - `nonlinear`: the parameters in which it is not linear, and where to seek them; every term must be linear in one of the others, or hold
      a dimension of the muscle.
    - `form`: how it is fitted, where it is printed in parameters in which it is not linear.
    - `published_starts`: starting values that papers print for it, by the names that specs have for them.
    - `start`: the one of them that `levenberg_marquardt` starts from, or `random`.
    """

    text: str
    nonlinear: tuple[Nonlinear, ...] = ()
    form: LinearForm | None = None
    published_starts: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    start: str = RANDOM

    def __post_init__(self) -> None:
        if self.expression.names != {*self.inputs, *self.parameters}:
            raise ValueError(f"{self.name}: the names in the text are not the inputs and parameters")
        self._check_linearity()

    def _check_linearity(self) -> None:
        if not (self.dimensions or self.definition) and substitute(
            self._fitted_expression, dict.fromkeys(self.linear, Number(0.0))
        ) != Number(0.0):
            raise ValueError(f"{self.name}: a term has no linear parameter")
        if any(derivative(self._fitted_expression, name).names & {*self.linear} for name in self.linear):
            raise ValueError(f"{self.name}: a parameter is nonlinear without being declared so")

    def starting_from(self, start: str) -> Formula:
        """Return the formula fitted from published starting values, or from random ones.

        Raises `SpecError` for starting values that nobody has published for it.
        """
        known = (RANDOM, *self.published_starts)
        if start not in known:
            raise SpecError(f"{self.name} has no starting values called `{start}`", f"write one of {', '.join(known)}")
        return replace(self, start=start)

    @cached_property
    def expression(self) -> Expression:
        """The formula with its parameters as names."""
        return parse(self.text)

    @cached_property
    def fitted(self) -> tuple[str, ...]:
        """Names of the parameters that a fit finds: all but the dimensions of the muscle."""
        return tuple(name for name in self.parameters if name not in self.dimensions)

    @cached_property
    def gradient(self) -> Mapping[str, Expression]:
        """Derivative for every fitted parameter."""
        return {name: derivative(self.expression, name) for name in self.fitted}

    @cached_property
    def linear(self) -> tuple[str, ...]:
        """Names of the parameters in which the formula is linear, those of its linear form where it has one."""
        if self.form is not None:
            return self.form.linear
        return tuple(name for name in self.fitted if name not in {parameter.name for parameter in self.nonlinear})

    @cached_property
    def _fitted_expression(self) -> Expression:
        return self.expression if self.form is None else self.form.expression

    def fit(self, columns: Columns, y: Array, method: str | None = None, *, advice: bool = True) -> FormulaFit:
        """Least-squares fit to the target `y`, `(n,)`, with the inputs among `columns`.

        `method` is `variable_projection` (the default: no starting values with at most one nonlinear parameter, bounds and ten starts with
        more; for a linear formula, linear least squares), `levenberg_marquardt` (ten starts, no bounds) or `simplex` (the same, without
        derivatives). A poor fit is told by the status and the notes, never raised. With `advice`, notes name the parameters that the data
        do not show, and what to measure for them.

        Raises DataError for a value that is not finite, an absent input, or fewer samples than parameters; SpecError for a dimension of the
        muscle that `of_muscle` has not put in; ValueError for an unknown method.
        """
        method = method or VARIABLE_PROJECTION
        if method not in _SOLVERS:
            raise ValueError(f"unknown method `{method}`; there are {', '.join(_SOLVERS)}")
        if self.start != RANDOM and method != LEVENBERG_MARQUARDT:
            raise SpecError(f"the method {method} takes no starting values", f"write `method: {LEVENBERG_MARQUARDT}` beside `starts`")
        problem = self._problem(columns, y)
        return self._result(problem, self._solved(problem, method), advice)

    def _solved(self, problem: Problem, method: str) -> Solution:
        return (_SOLVERS[method] if self.fitted else varpro.fit)(problem)  # without parameters there is nothing to descend to

    def fit_along(self, columns: Columns, y: Array, name: str, method: str | None = None) -> FormulaFit:
        """Least-squares fit to the error of the input `name`, where the target was set and that input was measured.

        It goes on from `fit`. The sum of squares of the result is that of the target all the same; the standard errors and the first note
        are of the error of the input.

        Raises SpecError for what is no input, and as `fit`, as DataError.
        """
        if name not in self.inputs:
            raise SpecError(f"{self.name} has no input `{name}` that could be measured wrong", f"write one of {', '.join(self.inputs)}")
        problem = self._problem(columns, y)
        start = self._solved(problem, method or VARIABLE_PROJECTION)
        if start.status == "failed":
            return self._result(problem, start)
        told = errors_in.telling(problem, start, name)
        found = errors_in.refined(told, errors_in.moved(start, problem, told), name)
        fit = self._result(problem, errors_in.moved(found, told, problem))
        roots = errors_in.Along(told, name).roots(np.concatenate([found.beta, found.c]))
        slopes = self._jacobian_at({one: fit.parameters[one] for one in self.fitted})({**told.columns, name: roots})
        deviations, sse = errors_in.standard_errors(told, found, name, slopes)
        errors = {**fit.errors, **dict(zip(self.fitted, map(float, deviations), strict=True))}
        silent = len(problem.y) - len(told.y)
        without = f"; without {silent} sample(s) at which the formula does not depend on it" if silent else ""
        said = f"fitted to the error of {name}, whose RMSE is {math.sqrt(sse / len(told.y)):.4g}{without}"
        return replace(fit, errors=errors, notes=(said, *fit.notes))

    def predict(self, parameters: Mapping[str, float], columns: Columns) -> Array:
        """Return the formula on every row, `(n,)`; NaN with the parameters of a failed fit."""
        inputs = {name: columns[name] for name in self.inputs if name in columns}
        rows = len(next(iter(columns.values()), ()))
        return evaluate(self.expression, {**inputs, **{name: np.asarray(parameters[name]) for name in self.parameters}}, rows)

    def solved(self, fit: FormulaFit, columns: Columns, y: Array, name: str) -> Array:
        """Return the input `name` at which the fitted formula gives `y`, `(n,)`, nearest to what was measured; NaN without one near."""
        inputs = {one: columns[one] for one in self.inputs}
        return errors_in.Along(Problem(self.equation(fit), (), (), {}, inputs, y), name).solutions(np.empty(0))

    def equations(self, fit: FormulaFit) -> dict[str, Expression]:
        """`equation`, by the name of the formula."""
        return {self.name: self.equation(fit)}

    def equation(self, fit: FormulaFit) -> Expression:
        """Return the formula with the numbers of a fit that has not failed, in physical units."""
        return substitute(self.expression, {name: Number(value) for name, value in fit.parameters.items()})

    def _problem(self, columns: Columns, y: Array) -> Problem:
        """Return the rows in canonical order, so that the order of the samples cannot change a digit of the fit."""
        inputs = {name: finite(name, needed(name, columns)) for name in self.inputs}
        target = finite("the target", y)
        if len(target) < len(self.fitted):
            raise DataError(
                f"{self.name} has {len(self.fitted)} parameters, but there are only {len(target)} samples to fit them to",
                "give it more training data, or leave the formula out",
            )
        order = np.lexsort([target, *inputs.values()])
        ordered = {name: column[order] for name, column in inputs.items()}
        start = self.published_starts.get(self.start)
        return Problem(*self.of_muscle(self.given)._sought, ordered, target[order], start=start)

    @cached_property
    def _sought(self) -> tuple[Expression, tuple[str, ...], tuple[Nonlinear, ...], Mapping[str, Expression]]:
        """The formula with its dimensions put in, the parameters to be found in it, and its derivatives for them."""
        expression = substitute(self._fitted_expression, {name: Number(value) for name, value in self.given.items()})
        names = (*self.linear, *(parameter.name for parameter in self.nonlinear))
        return expression, self.linear, self.nonlinear, {name: derivative(expression, name) for name in names}

    def _result(self, problem: Problem, solution: Solution, advice: bool = True) -> FormulaFit:
        count = len(self.fitted)
        if solution.status == "failed":
            return self._failed(solution.method, len(problem.y), solution.notes)
        values = self._printed(problem.values(solution.beta, solution.c))
        if not np.isfinite(list(values.values())).all():
            return self._failed(solution.method, len(problem.y), (*solution.notes, "the printed parameters have no finite value"))
        residual = problem.residual(solution.beta, solution.c)
        sse = float(residual @ residual)
        jacobian = self._jacobian_at(values)
        slopes = jacobian(problem.at_levels.columns) if count else np.empty((len(residual), 0))
        deviations, rank, condition = linear.standard_errors(slopes, sse)
        errors = dict(zip(self.fitted, map(float, deviations), strict=True))
        choice = "the solution of least norm was taken" if len(self.nonlinear) <= 1 else "one of many equally good solutions was taken"
        notes = solution.notes if rank == count else (*solution.notes, dependence(rank, count, problem.columns, choice))
        given = {name: self.given[name] for name in self.dimensions}
        return FormulaFit(
            name=self.name,
            parameters={name: {**values, **given}[name] for name in self.parameters},
            errors={name: {**errors, **dict.fromkeys(given, float("nan"))}[name] for name in self.parameters},
            status=solution.status if rank == count else "rank_deficient",
            method=solution.method,
            rank=rank,
            condition=condition,
            sse=sse,
            samples=len(problem.y),
            notes=(*notes, *(hints(values, errors, jacobian, problem.columns) if count and advice else ())),
            rivals=tuple(self._optimum(problem, *rival, given) for rival in solution.rivals),
            definition=self.definition,
        )

    def _optimum(self, problem: Problem, beta: Array, c: Array, given: Mapping[str, float]) -> Optimum:
        values, residual = {**self._printed(problem.values(beta, c)), **given}, problem.residual(beta, c)
        return Optimum({name: values[name] for name in self.parameters}, float(residual @ residual))

    def _printed(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the fitted parameters as printed, from those of the linear form."""
        if self.form is None:
            return {name: values[name] for name in self.fitted}
        scalars = {name: np.asarray(value) for name, value in values.items()}
        return {name: float(evaluate(parse(text), scalars, 1)[0]) for name, text in self.form.printed.items()}

    def _jacobian_at(self, values: Mapping[str, float]) -> Callable[[Columns], Array]:
        """Return derivatives for the fitted parameters at `values`, `(n, p)`, as a function of the inputs."""
        numbers = {name: np.asarray(value) for name, value in {**values, **self.given}.items()}
        gradient = [self.gradient[name] for name in self.fitted]
        return lambda columns: dictionary_matrix(gradient, {**columns, **numbers}, len(next(iter(columns.values()))))

    def _failed(self, method: str, samples: int, notes: tuple[str, ...]) -> FormulaFit:
        nothing = dict.fromkeys(self.parameters, float("nan"))
        return FormulaFit(
            self.name, nothing, nothing, "failed", method, 0, float("nan"), float("nan"), samples, notes, definition=self.definition
        )


def can_be_solved(model: LiteratureModel) -> TypeGuard[Formula]:
    """Tell whether the errors of an input can be minimised: the model is fitted as a formula is."""
    return isinstance(model, Formula) and type(model).fit is Formula.fit


def dependence(rank: int, count: int, inputs: Columns, choice: str) -> str:
    """Return the note for data that leave parameters undetermined, and what was chosen then."""
    distinct = ", ".join(f"{len(np.unique(column))} of {name}" for name, column in inputs.items())
    return (
        f"rank {rank} of {count}: the data do not tell all parameters apart (distinct values: {distinct}); "
        f"{choice}, and values between the training levels are not to be trusted"
    )
