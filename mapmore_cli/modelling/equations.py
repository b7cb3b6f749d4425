"""A model as equations in physical units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.memory import PIECE
from mapmore_cli.domain.models import Equation, Model, SegmentFunction
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.memory.equation import MODEL_UNITS, memory_equation
from mapmore_cli.modelling.terms import (
    Expression,
    Name,
    Number,
    add,
    affine,
    exponents,
    multiply,
    parse,
    substitute,
    to_latex,
    to_text,
)

DIGITS = 6
"""Digits of the printed numbers; model.h5 holds all of them."""


def segment_equation(segment: SegmentFunction, units: Mapping[str, float] = MODEL_UNITS) -> Expression:
    """`y_slope sum_k theta_k D_k(slope x + intercept) + y_intercept` with the scaling put in (M2 eq 8).

    `units` says how many of the model's units one unit of a quantity is, where it is to be in another. A product of quantities that are
    scaled without an offset keeps its form, with one coefficient in front, as M2's table 5 prints them.
    """
    scaling = segment.scaling
    offsets = dict(zip(scaling.variables, zip(scaling.slope.tolist(), scaling.intercept.tolist(), strict=True), strict=True))
    terms = []
    for theta, text in zip(segment.theta, segment.terms, strict=True):
        term, size = parse(text), scaling.y_slope * float(theta)
        degrees = exponents(term)
        if degrees is not None and not scaling.intercept.any():
            size *= float(np.prod([(offsets[name][0] * units.get(name, 1.0)) ** degree for name, degree in degrees.items()]))
        else:
            term = substitute(term, {name: _scaled(name, *offset, units) for name, offset in offsets.items()})
        terms.append(multiply(Number(size), term))
    return add(Number(scaling.y_intercept), *terms)


def _scaled(name: str, slope: float, intercept: float, units: Mapping[str, float]) -> Expression:
    return affine(Name(name), slope * units.get(name, 1.0), intercept)


def model_equations(model: Model, units: Mapping[str, float] = MODEL_UNITS) -> tuple[Equation, ...]:
    """The backbone first, then every segment function, or the model with memory, in the model's units or in others.

    Of a sum, these are the equations of each summand.
    """
    inner = [replace(one, id=f"{summand.name}: {one.id}") for summand in model.summands for one in model_equations(summand, units)]
    pieces = [(segment.id, segment_equation(segment, units)) for curve in model.curves for segment in curve.segments]
    if model.memory is not None:
        pieces.append((PIECE, memory_equation(model.memory, units)))
    if model.backbone is not None:
        formulas = literature.get(model.backbone.name).equations(model.backbone)
        other = {name: multiply(Number(factor), Name(name)) for name, factor in units.items()}
        pieces = [*((name, substitute(formula, other)) for name, formula in formulas.items()), *pieces]
    return (*inner, *(Equation(name, to_text(e, DIGITS), to_latex(e, DIGITS)) for name, e in pieces))
