"""What every kind of model can do: the one place that tells kinds apart.

A kind is a folder of `modelling/` with a module `model` that holds its verbs. Whoever adds one adds it to `KINDS`, and to
`program.model` how it is written down. It is imported when a model of it is there: a table needs nothing of motion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.models import Body, Equation, Formula, Memory, Model, Pieces, StateSpace, Sum
from mapmore_cli.domain.results import Run

if TYPE_CHECKING:
    from mapmore_cli.modelling.program.statements import Program

MODEL_UNITS: Mapping[str, float] = {}
"""Quantities in the units of the model."""


@dataclass(frozen=True)
class Kind:
    """The verbs of a kind.

    Attributes
    ----------
    simulate
        Output at every row, NaN where an input is NaN or there is no history; and the rows at which a free run diverges.
    outside_range
        True where an input lies beyond the training range, (n,).
    equations
        The model as equations in physical units, given how many of the model's units one unit of a quantity is.
    parameters
        How many numbers the fit was free to choose.
    one_step
        Prediction of every row from the measured past, (n,); None for kinds that know no past.
    fed_back
        The measured outputs that a run begins from.
    """

    simulate: Callable[[Model, Columns], Run]
    outside_range: Callable[[Model, Columns], BoolArray]
    equations: Callable[[Model, Mapping[str, float]], tuple[Equation, ...]]
    parameters: Callable[[Model], int]
    one_step: Callable[[Model, Columns], Array] | None = None
    fed_back: Callable[[Model], tuple[str, ...]] = lambda _model: ()


def kind_of(model: Model) -> Kind:
    """The verbs for a model."""
    return KINDS[type(model.body)]()


def predict(model: Model, columns: Columns) -> Array:
    """Output of the model at every row, (n,), as `simulate` has it."""
    return simulate(model, columns).values


def simulate(model: Model, columns: Columns) -> Run:
    """Output of the model at every row, (n,), NaN where an input is NaN; and the rows at which a free run diverges.

    A model with memory runs free along one recording: it has no prediction before there is history, and starts anew after rows with a NaN.

    Parameters
    ----------
    columns
        The model's inputs by name, each (n,), in the model's units; with memory also `time`, and the output where it is fed back.

    Raises
    ------
    KeyError
        Where an input is missing.
    DataError
        Where a free run has nothing to begin from, or samples are not at the model's time steps.
    """
    return kind_of(model).simulate(model, columns)


def outside_range(model: Model, columns: Columns) -> BoolArray:
    """True where an input lies beyond the training range, of any summand where the model is a sum, (n,)."""
    return kind_of(model).outside_range(model, columns)


def equations(model: Model, units: Mapping[str, float] = MODEL_UNITS) -> tuple[Equation, ...]:
    """The model as equations, in its units or in others: of a sum, those of each summand.

    Raises
    ------
    DataError
        Where a coefficient is too large to be a number.
    """
    with _numbers_in_reach(model):
        return kind_of(model).equations(model, units)


def parameters(model: Model) -> int:
    """How many numbers the fit was free to choose: coefficients of terms and parameters of formulas, of a sum those of all its parts."""
    return kind_of(model).parameters(model)


def one_step_ahead(model: Model, columns: Columns) -> Array:
    """Prediction of every row from the measured past, (n,); NaN before there is history."""
    one_step = kind_of(model).one_step
    return predict(model, columns) if one_step is None else one_step(model, columns)


def runs_over_time(model: Model) -> bool:
    """True where rows are samples of a recording, which the model runs along."""
    if isinstance(model.body, Sum):
        return any(runs_over_time(part.model) for part in model.body.parts)
    return kind_of(model).one_step is not None


def fed_back(model: Model) -> tuple[str, ...]:
    """The measured outputs that a run begins from, each once."""
    return kind_of(model).fed_back(model)


def program_of(model: Model) -> Program:
    """Return the model as a program of one sample's numbers, from which other languages and derivatives follow.

    Raises
    ------
    DataError
        Where a part of the model is no closed expression, and where a coefficient is too large to be a number.
    """
    from mapmore_cli.modelling.program.model import program_of

    with _numbers_in_reach(model):
        return program_of(model)


@contextmanager
def _numbers_in_reach(model: Model) -> Iterator[None]:
    """Name the model whose scaling and coefficients multiply to what is no number, as in a file that somebody changed."""
    from mapmore_cli.modelling.terms import ExpressionError

    try:
        with np.errstate(over="ignore"):  # infinity is no number
            yield
    except ExpressionError as fault:
        raise DataError(f"the model {model.name} cannot be written out: {fault.message}", "make it anew by its spec") from fault


def slopes(model: Model, columns: Columns) -> dict[str, Array]:
    """Derivative of the output for every input by its name, (n,) each; NaN where an input is not finite.

    At a boundary it is that of the piece that holds there.

    Raises
    ------
    DataError
        For a model with memory, and where a part of the model is no closed expression.
    """
    from mapmore_cli.modelling.program.slopes import with_slopes
    from mapmore_cli.modelling.program.values import evaluator

    _, *found = evaluator(with_slopes(program_of(model)))(columns)
    return {quantity.name: slope for quantity, slope in zip(model.inputs, found, strict=True)}


@cache
def _pieces() -> Kind:
    from mapmore_cli.modelling.pieces import model as pieces

    return Kind(pieces.simulate, pieces.outside_range, pieces.equations, pieces.parameters)


@cache
def _formula() -> Kind:
    from mapmore_cli.modelling.literature import model as formula

    return Kind(formula.simulate, formula.outside_range, formula.equations, formula.parameters)


@cache
def _memory() -> Kind:
    from mapmore_cli.modelling.memory import model as memory

    return Kind(memory.simulate, memory.outside_range, memory.equations, memory.parameters, memory.one_step, memory.fed_back)


@cache
def _motion() -> Kind:
    from mapmore_cli.modelling.motion import model as motion

    return Kind(motion.simulate, motion.outside_range, motion.equations, motion.parameters, motion.one_step)


@cache
def _sum() -> Kind:
    from mapmore_cli.modelling.sums import model as sums

    return Kind(
        lambda model, columns: sums.simulate(model, columns, simulate),
        lambda model, columns: sums.outside_range(model, columns, outside_range),
        lambda model, units: sums.equations(model, units, equations),
        lambda model: sums.parameters(model, parameters),
        lambda model, columns: sums.one_step(model, columns, one_step_ahead),
        lambda model: sums.fed_back(model, fed_back),
    )


KINDS: Mapping[type[Body], Callable[[], Kind]] = {
    Pieces: _pieces,
    Formula: _formula,
    Memory: _memory,
    StateSpace: _motion,
    Sum: _sum,
}
