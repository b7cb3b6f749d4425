"""MAPMORE as a model: its prediction, its training range, its equations."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.models import Equation, Model, Pieces
from mapmore_cli.domain.results import Run
from mapmore_cli.modelling.equations import equation
from mapmore_cli.modelling.expressions import Expression, parse
from mapmore_cli.modelling.literature.model import (
    backbone_values,
    formula_equations,
    formula_value,
    where_finite,
)
from mapmore_cli.modelling.pieces.definition import pieces_program, pieces_value
from mapmore_cli.modelling.program.values import evaluator
from mapmore_cli.modelling.program.writing import Inputs, Writer, limit


def simulate(model: Model, columns: Columns) -> Run:
    """Return `backbone(inputs) + sum_i f_i(E(x)) prod_j w_ij(x_j)` at every row, (n,) (M1 eq 5, M2
    eq 9); NaN where an input is.
    """
    body = _pieces_body(model)
    pieces = (
        _ready(body, tuple(quantity.name for quantity in model.inputs)) if body.segments else None
    )

    def value(inputs: dict[str, Array], n: int) -> Array:
        base = backbone_values(body.backbone, inputs, n)
        return base if pieces is None else base + pieces(inputs)[0]

    return Run(where_finite(model.inputs, columns, value))


@lru_cache(maxsize=8)
def _ready(body: Pieces, names: tuple[str, ...]) -> Callable[[Columns], list[Array]]:
    """Return the pieces ready for many calls; to write their program takes ten times as long as to
    predict a few rows.
    """
    return evaluator(pieces_program(body, names))


def equations(model: Model, units: Mapping[str, float]) -> tuple[Equation, ...]:
    """Return the backbone first, then every segment function, in the model's units or in others."""
    body = _pieces_body(model)
    segments = (
        (one, {**curve.limits, **one.limits}) for curve in body.curves for one in curve.segments
    )
    pieces = (
        equation(one.id, one.terms, one.theta, one.scaling, limits, units)
        for one, limits in segments
    )
    return *formula_equations(body.backbone, units), *pieces


def parameters(model: Model) -> int:
    """Return the number of coefficients of all segments and of parameters of the backbone."""
    body = _pieces_body(model)
    return sum(len(one.theta) for one in body.segments) + (
        0 if body.backbone is None else len(body.backbone.parameters)
    )


def _pieces_body(model: Model) -> Pieces:
    assert isinstance(model.body, Pieces)
    return model.body


def write(m: Writer, model: Model, inputs: Inputs) -> Expression:
    """Write pieces, on their backbone where they have one."""
    body = _pieces_body(model)
    limit(m, body.ranges, body.level, inputs)
    base = formula_value(m, body.backbone, inputs)
    if not body.segments:
        return base
    return m.let(
        "model",
        base
        + pieces_value(
            m, body, {quantity.name: inputs[quantity.name] for quantity in model.inputs}
        ),
    )


def faults(model: Model) -> Iterator[str]:
    """Say what of a stored model no prediction would notice."""
    levels = np.array([curve.level for curve in _pieces_body(model).curves], dtype=np.float64)
    if model.level is not None and not (np.isfinite(levels).all() and (np.diff(levels) > 0).all()):
        yield "the levels of its curves do not ascend"
    for segment in _pieces_body(model).segments:
        if not frozenset().union(*(parse(text).names for text in segment.terms)) <= {
            *segment.scaling.variables
        }:
            yield f"the terms of {segment.id} are of other quantities than its scaling"
