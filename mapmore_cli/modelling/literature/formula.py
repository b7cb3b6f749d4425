"""A formula as one line of text, from which prediction, derivatives, fitting and equation follow;
and what every model offers.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar, Self

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
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
from mapmore_cli.modelling.literature.identifiability import hints
from mapmore_cli.modelling.literature.problem import (
    Nonlinear,
    Problem,
    Solution,
    dependence,
    finite,
    needed,
)

TARGET = "target"
LOAD_CYCLES = "load_cycles"
RANDOM = "random"
DEFAULT = "variable_projection"


@dataclass(frozen=True)
class LiteratureModel(ABC):
    """A parametric model with a name; its output may stand against any target.

    - `name`, `reference`: as in the spec, and where it is published.
    - `title`: as people write the name; the name where there is none.
    - `about`: what it is, where the docstring of its file does not say it.
    - `inputs`: quantities that it predicts from.
    - `parameters`: in the order of the publication.
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
    title: str = field(default="", kw_only=True)
    about: str = field(default="", kw_only=True)
    component: str = field(default="static", kw_only=True)
    dimensions: tuple[str, ...] = field(default=(), kw_only=True)
    given: Mapping[str, float] = field(default_factory=dict, kw_only=True)
    units: Mapping[str, str] = field(default_factory=dict, kw_only=True)
    definition: str = field(default="", kw_only=True)

    fitted_to: ClassVar[str] = TARGET

    def of_muscle(self, lengths: Mapping[str, float | None]) -> Self:
        """Return the model with the dimensions of a muscle, in m, those that it needs among
        `lengths`.

        Raises `SpecError` where one of them is not known.
        """
        given = {
            name: value for name in self.dimensions if (value := lengths.get(name)) is not None
        }
        for name in self.dimensions:
            if name not in given:
                raise SpecError(
                    f"{self.name} needs the {name} of the muscle",
                    f"add `{name}: 10 mm` (with your own number) to `muscle`",
                )
        return replace(self, given=given) if given else self

    def starting_from(self, start: str) -> LiteratureModel:
        """Return the model fitted from starting values that a paper prints; raises `SpecError`
        where none are published.
        """
        raise SpecError(
            f"{self.name} has no starting values called `{start}`", "leave out `starts`"
        )

    @abstractmethod
    def fit(
        self, columns: Columns, y: Array, method: str | None = None, *, advice: bool = True
    ) -> FormulaFit:
        """Fit to the target `y`, `(n,)`, with the inputs among `columns`; raises `DataError` where
        that is impossible.

        Without `advice`, notes do not say what to measure for parameters that the data do not show.
        """

    @abstractmethod
    def predict(self, parameters: Mapping[str, float], columns: Columns) -> Array:
        """Return the model on every row, `(n,)`; NaN with the parameters of a failed fit."""

    @abstractmethod
    def equations(self, fit: FormulaFit) -> dict[str, Expression]:
        """Return the model with the numbers of a fit that has not failed, in physical units: one
        equation, or one for each of its parts.
        """


SEVERITY = ("converged", "at_bound", "stopped_by_limit", "rank_deficient", "failed")
"""The statuses of `FormulaFit`, the better ones first."""


def renamed(fit: FormulaFit, name: Callable[[str], str]) -> FormulaFit:
    """Return the fit with `name(parameter)` for every parameter."""

    def named(values: Mapping[str, float]) -> dict[str, float]:
        return {name(parameter): value for parameter, value in values.items()}

    rivals = tuple(replace(rival, parameters=named(rival.parameters)) for rival in fit.rivals)
    return replace(fit, parameters=named(fit.parameters), errors=named(fit.errors), rivals=rivals)


def merged(name: str, parts: Mapping[str, FormulaFit]) -> FormulaFit:
    """Return the fit called `name` of independent parts, whose parameters have different names, by
    what their notes are headed with.

    Status and condition are those of the worst part; ranks, sums of squares and samples add up. A
    rival is that of one part, with the others as they are.
    """
    fits = parts.values()
    parameters = {parameter: value for fit in fits for parameter, value in fit.parameters.items()}
    sse = sum(fit.sse for fit in fits)
    return FormulaFit(
        name=name,
        parameters=parameters,
        errors={parameter: value for fit in fits for parameter, value in fit.errors.items()},
        status=max((fit.status for fit in fits), key=SEVERITY.index),
        method=", ".join(dict.fromkeys(fit.method for fit in fits)),
        rank=sum(fit.rank for fit in fits),
        condition=max(fit.condition for fit in fits),
        sse=sse,
        samples=sum(fit.samples for fit in fits),
        notes=tuple(f"{part}: {note}" for part, fit in parts.items() for note in fit.notes),
        rivals=tuple(
            Optimum({**parameters, **r.parameters}, sse - fit.sse + r.sse)
            for fit in fits
            for r in fit.rivals
        ),
    )


@dataclass(frozen=True)
class LinearForm:
    """A formula in other parameters than the printed ones: in those that make it linear.

    `text` is the same function of the inputs, `linear` names the parameters in which it is linear,
    and `printed` has every printed parameter as an expression of these and of the nonlinear ones.
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
    - `nonlinear`: the parameters in which it is not linear, and where to seek them; every term must
      be linear in one of the others, or hold
      a dimension of the muscle.
    - `form`: how it is fitted, where it is printed in parameters in which it is not linear.
    - `published_starts`: starting values that papers print for it, by the names that specs have for
      them.
    - `start`: the one of them that `levenberg_marquardt` starts from, or `random`.
    """

    text: str
    nonlinear: tuple[Nonlinear, ...] = ()
    form: LinearForm | None = None
    published_starts: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    start: str = RANDOM

    def checked(self) -> Self:
        """Return the formula; raises ValueError where its text is not what it declares."""
        if self.expression.names != {*self.inputs, *self.parameters}:
            raise ValueError(
                f"{self.name}: the names in the text are not the inputs and parameters"
            )
        without = substitute(self._fitted_expression, dict.fromkeys(self.linear, Number(0.0)))
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
        """Names of the parameters in which the formula is linear, those of its linear form where it
        has one.
        """
        nonlinear = {parameter.name for parameter in self.nonlinear}
        return (
            self.form.linear
            if self.form is not None
            else tuple(name for name in self.fitted if name not in nonlinear)
        )

    @cached_property
    def _fitted_expression(self) -> Expression:
        return self.expression if self.form is None else self.form.expression

    def fit(
        self, columns: Columns, y: Array, method: str | None = None, *, advice: bool = True
    ) -> FormulaFit:
        """Least-squares fit to the target `y`, `(n,)`, with the inputs among `columns`.

        `method` is `variable_projection` (the default: no starting values with at most one
        nonlinear parameter, bounds and ten starts with more; for a linear formula, linear least
        squares), `levenberg_marquardt` (ten starts, no bounds) or `simplex` (the same, without
        derivatives). A poor fit is told by the status and the notes, never raised. With `advice`,
        notes name the parameters that the data do not show, and what to measure for them.

        Raises DataError for a value that is not finite, an absent input, or fewer samples than
        parameters; SpecError for a dimension of the muscle that `of_muscle` has not put in;
        ValueError for an unknown method.
        """
        method = method or DEFAULT
        if method not in solvers.METHODS:
            raise ValueError(f"unknown method `{method}`; there are {', '.join(solvers.METHODS)}")
        if self.start != RANDOM and method != solvers.LEVENBERG_MARQUARDT:
            raise SpecError(
                f"the method {method} takes no starting values",
                f"write `method: {solvers.LEVENBERG_MARQUARDT}` beside `starts`",
            )
        problem = self._problem(columns, y)
        return self._result(problem, self._solved(problem, method), advice)

    def _solved(self, problem: Problem, method: str) -> Solution:
        return solvers.METHODS[method if self.fitted else DEFAULT](
            problem
        )  # without parameters there is nothing to descend to

    def predict(self, parameters: Mapping[str, float], columns: Columns) -> Array:
        """Return the formula on every row, `(n,)`; NaN with the parameters of a failed fit."""
        inputs = {name: columns[name] for name in self.inputs if name in columns}
        rows = len(next(iter(columns.values()), ()))
        return evaluate(
            self.expression,
            {**inputs, **{name: np.asarray(parameters[name]) for name in self.parameters}},
            rows,
        )

    def equations(self, fit: FormulaFit) -> dict[str, Expression]:
        """`equation`, by the name of the formula."""
        return {self.name: self.equation(fit)}

    def equation(self, fit: FormulaFit) -> Expression:
        """Return the formula with the numbers of a fit that has not failed, in physical units."""
        return substitute(
            self.expression, {name: Number(value) for name, value in fit.parameters.items()}
        )

    def _problem(self, columns: Columns, y: Array) -> Problem:
        """Return the rows in canonical order, so that the order of the samples cannot change a
        digit of the fit.
        """
        inputs = {name: finite(name, needed(name, columns)) for name in self.inputs}
        target = finite("the target", y)
        if len(target) < len(self.fitted):
            raise DataError(
                f"{self.name} has {len(self.fitted)} parameters, but there are only "
                f"{len(target)} samples to fit them to",
                "give it more training data, or leave the formula out",
            )
        order = np.lexsort([target, *inputs.values()])
        ordered = {name: column[order] for name, column in inputs.items()}
        start = self.published_starts.get(self.start)
        return Problem(*self.of_muscle(self.given)._sought, ordered, target[order], start=start)

    @cached_property
    def _sought(
        self,
    ) -> tuple[Expression, tuple[str, ...], tuple[Nonlinear, ...], Mapping[str, Expression]]:
        """The formula with its dimensions put in, the parameters to be found in it, and its
        derivatives for them.
        """
        expression = substitute(
            self._fitted_expression, {name: Number(value) for name, value in self.given.items()}
        )
        names = (*self.linear, *(parameter.name for parameter in self.nonlinear))
        return (
            expression,
            self.linear,
            self.nonlinear,
            {name: derivative(expression, name) for name in names},
        )

    def _result(self, problem: Problem, solution: Solution, advice: bool = True) -> FormulaFit:
        values, notes = self._printed(problem.values(solution.beta, solution.c)), solution.notes
        if not np.isfinite(list(values.values())).all():
            if solution.status != "failed":
                notes = (*notes, "the printed parameters have no finite value")
            nan, nothing = float("nan"), dict.fromkeys(self.parameters, float("nan"))
            samples = len(problem.y)
            return FormulaFit(
                self.name,
                nothing,
                nothing,
                "failed",
                solution.method,
                0,
                nan,
                nan,
                samples,
                notes,
                (),
                self.definition,
            )
        count, sse = len(self.fitted), problem.sse(solution.beta, solution.c)
        jacobian = self._jacobian_at(values)
        slopes = jacobian(problem.at_levels.columns) if count else np.empty((len(problem.y), 0))
        deviations, rank, condition = linear.standard_errors(slopes, sse)
        errors = dict(zip(self.fitted, map(float, deviations), strict=True))
        if rank < count:
            choice = (
                "the solution of least norm was taken"
                if len(self.nonlinear) <= 1
                else "one of many equally good solutions was taken"
            )
            notes = (*notes, dependence(rank, count, problem.columns, choice))
        if count and advice:
            notes = (*notes, *hints(values, errors, jacobian, problem.columns))
        return FormulaFit(
            name=self.name,
            parameters=self._with_dimensions(values),
            errors={name: errors.get(name, float("nan")) for name in self.parameters},
            status=solution.status if rank == count else "rank_deficient",
            method=solution.method,
            rank=rank,
            condition=condition,
            sse=sse,
            samples=len(problem.y),
            notes=notes,
            rivals=tuple(
                Optimum(self._with_dimensions(self._printed(problem.values(*at))), problem.sse(*at))
                for at in solution.rivals
            ),
            definition=self.definition,
        )

    def _with_dimensions(self, values: Mapping[str, float]) -> dict[str, float]:
        return {
            name: values[name] if name in values else self.given[name] for name in self.parameters
        }

    def _printed(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the fitted parameters as printed, from those of the linear form."""
        if self.form is None:
            return {name: values[name] for name in self.fitted}
        scalars = {name: np.asarray(value) for name, value in values.items()}
        return {
            name: float(evaluate(parse(text), scalars, 1)[0])
            for name, text in self.form.printed.items()
        }

    def _jacobian_at(self, values: Mapping[str, float]) -> Callable[[Columns], Array]:
        """Return derivatives for the fitted parameters at `values`, `(n, p)`, as a function of the
        inputs.
        """
        numbers = {name: np.asarray(value) for name, value in {**values, **self.given}.items()}
        gradient = [self.gradient[name] for name in self.fitted]
        return lambda columns: dictionary_matrix(
            gradient, {**columns, **numbers}, len(next(iter(columns.values())))
        )
