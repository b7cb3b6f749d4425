"""Where, and by how much, a model does not have a shape."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import cast

import numpy as np

from mapmore_cli.domain.arrays import Ranges
from mapmore_cli.domain.errors import FitError
from mapmore_cli.domain.models import KeptShape, Model, Shape
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.kinds import predict, runs_over_time
from mapmore_cli.modelling.literature.backbone import pooled
from mapmore_cli.modelling.program.model import program_of
from mapmore_cli.modelling.selection import Fit, Word
from mapmore_cli.modelling.shape.region import Region, grid_of, region_of
from mapmore_cli.modelling.shape.stencils import POINTS, Along, Asked, asked_of

KINDS = ("mckibben", "peano")
IMPLIED: Mapping[str, Mapping[str, Word]] = MappingProxyType(
    {
        "force": MappingProxyType({"pressure": "increasing", "strain": "decreasing"}),
        "strain": MappingProxyType({"pressure": "increasing", "force": "decreasing"}),
    }
)
"""What the force, or the strain, of muscles of these kinds (`muscle.kind`) does along inputs."""


def implied(kind: str | None, model: Model) -> list[Asked]:
    """Return what the kind of muscle implies of a model."""
    words = IMPLIED.get(model.output.name, {}) if kind in KINDS else {}
    return [Asked(one.name, words[one.name]) for one in model.inputs if one.name in words]


NODES = 2500
"""Nodes of the grid on which a model is looked at."""

WRONG = 1e-9
"""A smaller fall, as a share of the range of the training output, is none."""


@dataclass(frozen=True)
class Violation:
    """By how much the output falls where it must not, without a break along a grid line (`convex`:
    by how much it misses a chord), and where that is worst; 0 where it nowhere does.

    `span` is the range of the training output, `share` the part of the region where it does.
    """

    asked: Asked
    amount: float
    span: float
    place: Mapping[str, float]
    share: float

    def told(self, model: Model) -> str:
        """By how much and where, in words."""
        places = ", ".join(f"{name} = {x:.4g}" for name, x in self.place.items())
        by = f"{self.amount:.3g} {model.output.unit}"
        return f"{self.asked.quantity}: {self.asked.word} by {by} at {places}"


def known_shape(kind: str | None, model: Model, curves: Sequence[Curve]) -> tuple[Violation, ...]:
    """Return what a model without memory does against the shape that it was asked to keep, or else
    its kind of muscle implies.
    """
    if runs_over_time(model):
        return ()
    shape = model.shape
    asked = [Asked(one.quantity, cast(Word, one.word)) for one in (shape.kept if shape else ())]
    fit = Fit() if shape is None else Fit(slack=shape.slack, beyond=shape.beyond, shape={})
    words = asked or implied(kind, model)
    region = region_of(model, curves, fit) if words else None
    return () if region is None else tuple(violations(model, words, region))


def violations(
    model: Model, asked: Sequence[Asked], region: Region, nodes: int = NODES
) -> list[Violation]:
    """Return what the model does against each word, on a grid over the region."""
    grid = grid_of(region, program_of(model).knots, nodes)
    values, inside = predict(model, grid.columns), region.holds(grid.columns)
    return [
        _violation(grid.along(one, values, inside), region.output.span)
        for one in region.asks(asked)
    ]


def _violation(along: Along, span: float) -> Violation:
    asked, wrong = along.stencils.asked, along.rises < 0
    if not wrong.any():
        return Violation(asked, 0.0, span, {}, 0.0)
    fall = along.falls if POINTS[asked.word] == 2 else -along.rises
    worst = int(np.argmax(fall))
    place = {name: float(x[worst].mean()) for name, x in along.stencils.points.items()}
    return Violation(asked, float(fall[worst]), span, place, float(wrong.mean()))


CLEARLY = 1.1
"""Times the training error without a shape, from which on a user is warned of the one with it."""


def with_shape(
    plain: Model,
    model: Model,
    curves: Sequence[Curve],
    fit: Fit,
    before: Sequence[Violation],
    binds: Mapping[Asked, Ranges] = MappingProxyType({}),
) -> Model:
    """Return the model with what it keeps, where that decides about its coefficients, and what it
    costs beside the `plain` model, whose violations are `before`.
    """
    kept = tuple(
        KeptShape(one.asked.quantity, one.asked.word, one.amount, binds.get(one.asked, {}))
        for one in before
    )
    errors = [
        _error(each, curves, training) for training in (True, False) for each in (model, plain)
    ]
    notes, unit = model.notes, model.output.unit
    if errors[0] > CLEARLY * errors[1]:
        notes += (
            f"the shape costs: the training error is {errors[0]:.4g} {unit} with it, "
            f"{errors[1]:.4g} {unit} without",
        )
    return replace(model, shape=Shape(kept, fit.slack, fit.beyond, *errors), notes=notes)


def _error(model: Model, curves: Sequence[Curve], training: bool) -> float:
    """Return the root mean square error on training or held-out samples; NaN without any."""
    rows = pooled([(curve, curve.training if training else curve.held_out) for curve in curves])
    errors = predict(model, rows) - rows[model.output.name]
    known = errors[np.isfinite(errors)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else math.nan


def verified(model: Model, curves: Sequence[Curve], fit: Fit) -> Model:
    """Return a formula with the shape that it keeps by itself, or by the bounds of its parameters;
    raises FitError where it does not.
    """
    asked = asked_of(fit)
    region = region_of(model, curves, fit) if asked else None
    if region is None:
        return model
    found = violations(model, asked, region)
    for one in found:
        if one.amount > WRONG * region.output.span:
            raise FitError(
                f"fit.shape: the fitted formula does not keep it, {one.told(model)}",
                "bound its parameters (formulas: parameters: bounds) so that it does, or take "
                "another formula",
            )
    return with_shape(model, model, curves, fit, found)
