"""A model with memory as an equation."""

from __future__ import annotations

from collections.abc import Mapping

from mapmore_cli.domain.memory import MemoryModel
from mapmore_cli.modelling.terms import Expression, Name, Number, add, affine, multiply, parse, state, substitute

MODEL_UNITS: Mapping[str, float] = {}


def memory_equation(model: MemoryModel, units: Mapping[str, float] = MODEL_UNITS) -> Expression:
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
