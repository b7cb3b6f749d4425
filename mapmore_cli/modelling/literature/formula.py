"""A formula as one line of text, from which prediction, derivatives, fitting and the printed equation follow."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.modelling.literature import levenberg_marquardt, linear, varpro
from mapmore_cli.modelling.literature.checks import finite, needed
from mapmore_cli.modelling.literature.literature_model import LiteratureModel
from mapmore_cli.modelling.literature.problem import Nonlinear, Problem
from mapmore_cli.modelling.literature.solution import Solution
from mapmore_cli.modelling.terms import Expression, Number, derivative, evaluate, parse, substitute

VARIABLE_PROJECTION = "variable_projection"
LEVENBERG_MARQUARDT = "levenberg_marquardt"

_SOLVERS: Mapping[str, Callable[[Problem], Solution]] = {VARIABLE_PROJECTION: varpro.fit, LEVENBERG_MARQUARDT: levenberg_marquardt.fit}


@dataclass(frozen=True)
class Formula(LiteratureModel):
    """A formula that one expression holds.

    Attributes
    ----------
    text
        The formula as an expression of inputs and parameters.
    nonlinear
        The parameters in which it is not linear, and where to seek them; every term must be linear in one of the others.
    """

    text: str
    nonlinear: tuple[Nonlinear, ...] = ()

    def __post_init__(self) -> None:
        if self.expression.names != {*self.inputs, *self.parameters}:
            raise ValueError(f"{self.name}: the names in the text are not the inputs and parameters")
        self._check_linearity()

    def _check_linearity(self) -> None:
        if substitute(self.expression, dict.fromkeys(self.linear, Number(0.0))) != Number(0.0):
            raise ValueError(f"{self.name}: a term has no linear parameter")
        if any(self.gradient[name].names & {*self.linear} for name in self.linear):
            raise ValueError(f"{self.name}: a parameter is nonlinear without being declared so")

    @cached_property
    def expression(self) -> Expression:
        """The formula with its parameters as names."""
        return parse(self.text)

    @cached_property
    def gradient(self) -> Mapping[str, Expression]:
        """Derivative for every parameter."""
        return {name: derivative(self.expression, name) for name in self.parameters}

    @cached_property
    def linear(self) -> tuple[str, ...]:
        """Names of the parameters in which the formula is linear."""
        return tuple(name for name in self.parameters if name not in {parameter.name for parameter in self.nonlinear})

    def fit(self, columns: Columns, y: Array, method: str | None = None) -> FormulaFit:
        """Least-squares fit to the target `y`, `(n,)`, with the inputs among `columns`.

        `method` is `variable_projection` (the default: no starting values with at most one nonlinear parameter, bounds and ten starts with
        more; for a linear formula, linear least squares) or `levenberg_marquardt` (ten starts, no bounds). A poor fit is told by the
        status and the notes, never raised.

        Raises
        ------
        DataError
            For a value that is not finite, an absent input, or fewer samples than parameters.
        ValueError
            For an unknown method.
        """
        method = method or VARIABLE_PROJECTION
        if method not in _SOLVERS:
            raise ValueError(f"unknown method `{method}`; there are {', '.join(_SOLVERS)}")
        problem = self._problem(columns, y)
        solve = _SOLVERS[method] if self.parameters else varpro.fit  # without parameters there is nothing to descend to
        return self._result(problem, solve(problem))

    def predict(self, parameters: Mapping[str, float], columns: Columns) -> Array:
        """The formula on every row, `(n,)`; NaN with the parameters of a failed fit."""
        inputs = {name: columns[name] for name in self.inputs if name in columns}
        rows = len(next(iter(columns.values()), ()))
        return evaluate(self.expression, {**inputs, **{name: np.asarray(parameters[name]) for name in self.parameters}}, rows)

    def equations(self, fit: FormulaFit) -> dict[str, Expression]:
        """`equation`, by the name of the formula."""
        return {self.name: self.equation(fit)}

    def equation(self, fit: FormulaFit) -> Expression:
        """The formula with the numbers of a fit that has not failed, in physical units."""
        return substitute(self.expression, {name: Number(value) for name, value in fit.parameters.items()})

    def _problem(self, columns: Columns, y: Array) -> Problem:
        """The rows in canonical order, so that the order of the samples cannot change a digit of the fit."""
        inputs = {name: finite(name, needed(name, columns)) for name in self.inputs}
        target = finite("the target", y)
        if len(target) < len(self.parameters):
            raise DataError(
                f"{self.name} has {len(self.parameters)} parameters, but there are only {len(target)} samples to fit them to",
                "give it more training data, or leave the formula out",
            )
        order = np.lexsort([target, *inputs.values()])
        ordered = {name: column[order] for name, column in inputs.items()}
        return Problem(self.expression, self.linear, self.nonlinear, self.gradient, ordered, target[order])

    def _result(self, problem: Problem, solution: Solution) -> FormulaFit:
        values = problem.values(solution.beta, solution.c)
        count = len(self.parameters)
        if solution.status == "failed":
            return self._failed(solution.method, len(problem.y), solution.notes)
        residual = problem.residual(solution.beta, solution.c)
        sse = float(residual @ residual)
        deviations, rank, condition = linear.standard_errors(problem.jacobian(solution.beta, solution.c), sse)
        errors = problem.values(deviations[: len(self.linear)], deviations[len(self.linear) :])
        choice = "the solution of least norm was taken" if len(self.nonlinear) <= 1 else "one of many equally good solutions was taken"
        notes = solution.notes if rank == count else (*solution.notes, dependence(rank, count, problem.columns, choice))
        return FormulaFit(
            name=self.name,
            parameters={name: values[name] for name in self.parameters},
            errors={name: errors[name] for name in self.parameters},
            status=solution.status if rank == count else "rank_deficient",
            method=solution.method,
            rank=rank,
            condition=condition,
            sse=sse,
            samples=len(problem.y),
            notes=notes,
        )

    def _failed(self, method: str, samples: int, notes: tuple[str, ...]) -> FormulaFit:
        nothing = dict.fromkeys(self.parameters, float("nan"))
        return FormulaFit(self.name, nothing, nothing, "failed", method, 0, float("nan"), float("nan"), samples, notes)


def dependence(rank: int, count: int, inputs: Columns, choice: str) -> str:
    """The note for data that leave parameters undetermined, and what was chosen then."""
    distinct = ", ".join(f"{len(np.unique(column))} of {name}" for name, column in inputs.items())
    return (
        f"rank {rank} of {count}: the data do not tell all parameters apart (distinct values: {distinct}); "
        f"{choice}, and values between the training levels are not to be trusted"
    )
