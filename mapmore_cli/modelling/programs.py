"""Write a model of any kind as a program, and compute its derivatives."""

from __future__ import annotations

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.expressions import Expression, Name
from mapmore_cli.modelling.kinds import alone, numbers_in_reach, verbs_of
from mapmore_cli.modelling.program.slopes import with_slopes
from mapmore_cli.modelling.program.statements import Program
from mapmore_cli.modelling.program.values import INPUT, evaluator
from mapmore_cli.modelling.program.writing import Inputs, Writer
from mapmore_cli.modelling.signals.sampling import UNEVEN


def program_of(model: Model) -> Program:
    """Return the model as a program that computes one sample. Exported code and derivatives are
    made from it.

    Raises DataError if parts have different times between samples or need different measured
    outputs, if a part has no closed expression, or if a coefficient is too large to be a number.
    """
    m = Writer()
    names = {quantity.name: Name(f"{INPUT}{quantity.name}") for quantity in model.inputs}
    with numbers_in_reach(model):
        values = [write(m, part, names) for part in model.each]
    steps = m.kept.steps
    if steps and max(steps) > min(steps) * (1 + UNEVEN):
        reason = (
            f"the parts of {model.name} were trained with different time steps, "
            f"{min(steps):g} s and {max(steps):g} s"
        )
        raise DataError(reason, "train them with the same time step (`resample`)")
    if len(m.kept.fed_back) > 1:
        raise DataError(
            f"the parts of {model.name} must start from measured values of different outputs "
            f"({', '.join(m.kept.fed_back)}), but an exported model can start from one only",
            "export the parts one by one",
        )
    with numbers_in_reach(model):
        return m.program(tuple(names), *values)


def write(m: Writer, model: Model, inputs: Inputs) -> Expression:
    """Write the statements of a model of any kind, and return its output."""
    return verbs_of(model).write(m, model, inputs)


def slopes(model: Model, columns: Columns) -> dict[str, Array]:
    """Return the derivative of the output with respect to every input, shape (n,) each; NaN in rows
    in which an input is not finite.

    Raises DataError for a model with memory, and if a part of the model has no closed expression.
    """
    _, *slopes_of_inputs = evaluator(with_slopes(program_of(alone(model))))(columns)
    return {
        quantity.name: slope for quantity, slope in zip(model.inputs, slopes_of_inputs, strict=True)
    }
