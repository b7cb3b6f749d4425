"""A model as equations in physical units."""

from __future__ import annotations

from mapmore_cli.domain.models import Equation, Model, SegmentFunction
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.terms import Expression, Name, Number, add, affine, multiply, parse, substitute, to_latex, to_text

DIGITS = 6
"""Digits of the printed numbers; model.h5 holds all of them."""


def segment_equation(segment: SegmentFunction) -> Expression:
    """`y_slope sum_k theta_k D_k(slope x + intercept) + y_intercept` with the scaling put in (M2 eq 8)."""
    scaling = segment.scaling
    physical = {
        name: affine(Name(name), float(m), float(c)) for name, m, c in zip(scaling.variables, scaling.slope, scaling.intercept, strict=True)
    }
    terms = [
        multiply(Number(scaling.y_slope * float(theta)), substitute(parse(term), physical))
        for theta, term in zip(segment.theta, segment.terms, strict=True)
    ]
    return add(Number(scaling.y_intercept), *terms)


def model_equations(model: Model) -> tuple[Equation, ...]:
    """The backbone first, then every segment function, in the model's units."""
    pieces = [(segment.id, segment_equation(segment)) for curve in model.curves for segment in curve.segments]
    if model.backbone is not None:
        pieces.insert(0, (model.backbone.name, literature.get(model.backbone.name).equation(model.backbone)))
    return tuple(Equation(name, to_text(e, DIGITS), to_latex(e, DIGITS)) for name, e in pieces)
