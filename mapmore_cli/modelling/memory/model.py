"""A model with memory: its prediction along a recording, its training range, its equation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.fits import FormulaFit, SegmentedCurve
from mapmore_cli.domain.memory import PIECE, MemoryModel
from mapmore_cli.domain.models import CurveRange, Equation, Memory, Model
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.domain.results import Run
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.expressions import Expression, Name, Number, add, affine, multiply, parse, state, substitute
from mapmore_cli.modelling.literature.model import backbone_values, by_blocks, formula_equations, printed
from mapmore_cli.modelling.memory.feedback import fed_back_states
from mapmore_cli.modelling.memory.free_run import free_run, one_step_ahead
from mapmore_cli.modelling.memory.states import memory_inputs
from mapmore_cli.modelling.program.formula import formula_value
from mapmore_cli.modelling.program.memory import memory_value
from mapmore_cli.modelling.program.writing import Inputs, Writer, limit


def build(
    name: str,
    memory: MemoryModel,
    backbone: FormulaFit | None,
    training: Sequence[SegmentedCurve],
    quantities: Mapping[str, Quantity],
    notes: tuple[str, ...] = (),
) -> Model:
    """Return a model with memory, on the backbone that it was fitted on; the `training` curves say the range of the inputs."""
    formula = () if backbone is None else literature.of(backbone).inputs
    inputs = sorted({*memory_inputs(memory), *formula})
    ranges = tuple(CurveRange(c.curve, c.level, {name: c.limits[name] for name in inputs}) for c in training)
    return Model(name, quantities[memory.output], tuple(quantities[name] for name in inputs), Memory(memory, ranges, backbone), notes=notes)


def simulate(model: Model, columns: Columns) -> Run:
    """Return the model in free run along one recording, (n,), on its backbone where it has one."""
    run = free_run(_body(model).model, columns)
    return Run(_base(model, columns) + run.values, run.diverged)


def one_step(model: Model, columns: Columns) -> Array:
    """Prediction of every row from the measured past, (n,); NaN before there is history."""
    return _base(model, columns) + one_step_ahead(_body(model).model, columns)


def equations(model: Model, units: Mapping[str, float]) -> tuple[Equation, ...]:
    """Return the backbone first, then the equation of the next output."""
    body = _body(model)
    parts = [*formula_equations(body.backbone, units), (PIECE, memory_equation(body.model, units))]
    return tuple(printed(name, equation) for name, equation in parts)


def parameters(model: Model) -> int:
    """Return the coefficients of the terms, with the model's own constant where it has one, and the parameters of the backbone."""
    body = _body(model)
    own = len(body.model.theta) + (body.model.constant != 0.0)
    return own + (0 if body.backbone is None else len(body.backbone.parameters))


def fed_back(model: Model) -> tuple[str, ...]:
    """Return the output, where the model goes on from it."""
    memory = _body(model).model
    return (memory.output,) if fed_back_states(memory.states, memory.output) else ()


def memory_equation(model: MemoryModel, units: Mapping[str, float]) -> Expression:
    """`constant + sum_j theta_j D_j` in physical units.

    Scaled states are written out as `(state - low)/(high - low)`; that they are clipped beyond their training range is left out. `units`
    says how many of the model's units one unit of a quantity is, where it is to be in another: every state is proportional to its quantity.
    """
    scaling = model.scaling
    scales = zip(scaling.variables, scaling.slope.tolist(), scaling.intercept.tolist(), strict=True)
    physical = {name: affine(Name(name), slope * units.get(state(name).quantity, 1.0), intercept) for name, slope, intercept in scales}
    terms = (
        multiply(Number(float(theta)), substitute(parse(text), physical)) for text, theta in zip(model.terms, model.theta, strict=True)
    )
    return add(Number(model.constant), *terms)


def _base(model: Model, columns: Columns) -> Array:
    body = _body(model)
    if body.backbone is None and not model.inputs:
        return np.zeros(len(next(iter(columns.values()))))
    return by_blocks(model.inputs, columns, lambda inputs, n: backbone_values(body.backbone, inputs, n))


def _body(model: Model) -> Memory:
    assert isinstance(model.body, Memory)
    return model.body


def write(m: Writer, model: Model, inputs: Inputs) -> Expression:
    """Write a model with memory, on its backbone where it has one."""
    body = model.body
    assert isinstance(body, Memory)
    limit(m, body.ranges, None, inputs)
    m.kept.steps.append(body.model.states.step)
    return m.let("model", formula_value(m, body.backbone, inputs) + memory_value(m, body.model, inputs))
