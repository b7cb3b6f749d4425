"""Write every kind of model as a program; `modelling.kinds` says which kind a model is."""

from __future__ import annotations

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.expressions import Expression, Name
from mapmore_cli.modelling.kinds import kind_of
from mapmore_cli.modelling.memory.records import UNEVEN
from mapmore_cli.modelling.program.statements import Program
from mapmore_cli.modelling.program.values import INPUT
from mapmore_cli.modelling.program.writing import Inputs, Writer


def program_of(model: Model) -> Program:
    """Return a model of any kind as a program.

    Raises DataError where parts have different times between samples or go on from different outputs, or one is no closed expression.
    """
    m = Writer()
    names = {quantity.name: Name(f"{INPUT}{quantity.name}") for quantity in model.inputs}
    value = write(m, model, names)
    steps = m.kept.steps
    if steps and max(steps) > min(steps) * (1 + UNEVEN):
        raise DataError(
            f"the parts of {model.name} count samples of {min(steps):g} s and of {max(steps):g} s", "train them at the same time steps"
        )
    if len(m.kept.fed_back) > 1:
        raise DataError(f"the parts of {model.name} go on from {', '.join(m.kept.fed_back)}", "export the parts one by one")
    return m.program(tuple(names), value)


def write(m: Writer, model: Model, inputs: Inputs) -> Expression:
    """Write a model of any kind; return its output."""
    value: Expression = kind_of(model).verb("write")(m, model, inputs)
    return value
