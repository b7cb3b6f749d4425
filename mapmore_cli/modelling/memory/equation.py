"""A model with memory as an equation."""

from __future__ import annotations

from mapmore_cli.domain.memory import MemoryModel
from mapmore_cli.modelling.terms import Expression, Name, Number, add, affine, multiply, parse, substitute


def memory_equation(model: MemoryModel) -> Expression:
    """`constant + sum_j theta_j D_j` in physical units.

    Scaled states are written out as `(state - low)/(high - low)`; that they are clipped beyond their training range is left out.
    """
    states = model.states
    scales = zip(states.names, states.low.tolist(), states.high.tolist(), strict=True) if states.scaled else ()
    physical = {name: _scaled(name, low, high) for name, low, high in scales}
    terms = (
        multiply(Number(float(theta)), substitute(parse(text), physical)) for text, theta in zip(model.terms, model.theta, strict=True)
    )
    return add(Number(model.constant), *terms)


def _scaled(name: str, low: float, high: float) -> Expression:
    width = high - low
    return affine(Name(name), 1 / width, -low / width) if width > 0 else Number(0.0)
