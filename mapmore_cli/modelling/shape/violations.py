"""Compute at which inputs and by how much a model violates a shape, and by how much its errors grow
if the shape is a constraint of the fit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray, Ranges, columns_at, root_mean_square
from mapmore_cli.domain.declared import Word
from mapmore_cli.domain.errors import FitError
from mapmore_cli.domain.models import KeptShape, Model, Shape
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.kinds import predict, runs_over_time, settled
from mapmore_cli.modelling.programs import program_of
from mapmore_cli.modelling.selection import Fit
from mapmore_cli.modelling.shape.region import Region, region_of
from mapmore_cli.modelling.shape.stencils import POINTS, ShapeWord, asked_of, nodes_of, stencils_on

KINDS = ("mckibben", "peano")
IMPLIED: Mapping[str, Mapping[str, Word]] = MappingProxyType(
    {
        "force": {"pressure": "increasing", "strain": "decreasing"},
        "strain": {"pressure": "increasing", "force": "decreasing"},
    }
)
"""Shape that the force, or the strain, of a muscle has along its inputs, for each kind of muscle
(`muscle.kind`).
"""

# number of nodes of the grid on which a model is checked
NODES = 2500
# smaller violations, as a fraction of the range of the training output, are ignored
WRONG = 1e-9
# A warning is given if the shape multiplies the training error by at least this factor.
CLEARLY = 1.1


@dataclass(frozen=True)
class Violation:
    """Violation of the condition `asked` of a shape by a model. The `amount` is 0 if the model
    satisfies the condition. Otherwise, it depends on the condition: for `increasing`, it is the
    largest total fall of the output along one grid line, and for `decreasing` the largest total
    rise. For `convex` and `concave`, it is the largest distance of the output from a chord on the
    wrong side. For `positive`, it is the magnitude of the lowest output. `share` is the amount
    divided by the range of the training output. `place` describes the point at which the violation
    is largest.
    """

    asked: ShapeWord
    amount: float
    share: float
    place: str


def violations(
    model: Model, asked: Sequence[ShapeWord], region: Region, nodes: int = NODES
) -> list[Violation]:
    """Return the violation of each condition of the shape by a model, computed on a grid over the
    region.
    """
    axes = region.axes(program_of(model).knots, nodes)
    result = []
    columns = nodes_of(axes)
    values = settled(model, columns)
    inside = region.holds(columns) & np.isfinite(values)
    for word in region.asks(asked):
        stencils = stencils_on(axes, word, inside)
        falls = np.maximum(-stencils.of(values), 0.0)
        lines = np.bincount(stencils.lines, falls) if POINTS[word.word] == 2 else falls
        amount = float(lines.max(initial=0.0))
        if amount <= WRONG * region.span:
            result.append(Violation(word, 0.0, 0.0, ""))
        else:
            worst = stencils.at(np.array([np.argmax(falls)])).told
            result.append(Violation(word, amount, amount / region.span, worst))
    return result


def known_shape(kind: str | None, model: Model, curves: Sequence[Curve]) -> list[Violation]:
    """Return the violations of the shape that the spec required for the model. If it required no
    shape, return the violations of the shape that is known for this kind of muscle. For a model
    with memory, this shape is not tested.
    """
    words = (
        IMPLIED.get(model.output.name, {}) if kind in KINDS and not runs_over_time(model) else {}
    )
    asked = [
        ShapeWord(quantity.name, words[quantity.name])
        for quantity in model.inputs
        if quantity.name in words
    ]
    fit = Fit()
    if model.shape is not None:
        asked = [ShapeWord(kept.quantity, kept.word) for kept in model.shape.kept] or asked
        fit = Fit(shape={}, slack=model.shape.slack, beyond=model.shape.beyond)
    region = region_of(model, curves, fit) if asked else None
    return [] if region is None else violations(model, asked, region)


def with_shape(
    unshaped: Model,
    model: Model,
    curves: Sequence[Curve],
    region: Region | None,
    fit: Fit,
    binds: Mapping[ShapeWord, Ranges] = MappingProxyType({}),
) -> Model:
    """Return the model with a record of its shape. The record contains the conditions of the shape,
    with the amount by which the `unshaped` model violates each of them, and the ranges of the
    inputs in which they change the coefficients. It also contains the errors of the model and of
    the `unshaped` model on training and on held-out samples.
    """
    kept = tuple(
        KeptShape(
            violation.asked.quantity,
            violation.asked.word,
            violation.amount,
            binds.get(violation.asked, {}),
        )
        for violation in (violations(unshaped, asked_of(fit), region) if region else ())
    )
    with_it, without = (
        [_rms_error(each, curves, training) for training in (True, False)]
        for each in (model, unshaped)
    )
    notes = model.notes
    unit = model.output.unit
    if with_it[0] > CLEARLY * without[0]:
        notes += (
            (
                f"the shape increases the training error from {without[0]:.4g} {unit} to "
                f"{with_it[0]:.4g} {unit}"
            ),
        )
    shape = Shape(kept, fit.slack, fit.beyond, *with_it, *without)
    return replace(model, shape=shape, notes=notes)


def _rms_error(model: Model, curves: Sequence[Curve], training: bool) -> float:
    """Return the root mean square error on the training or held-out samples; NaN if there are
    none.
    """

    def of_log(curve: Curve, rows: slice | IntArray) -> Array:
        log = columns_at(curve.columns, rows)
        counted = (curve.training if training else curve.held_out)[rows]
        return (predict(model, log) - log[model.output.name])[counted]

    errors = np.concatenate([of_log(curve, rows) for curve in curves for rows in curve.stretches])
    return root_mean_square(errors[np.isfinite(errors)])


def verified(
    model: Model,
    curves: Sequence[Curve],
    fit: Fit,
    kind: str = "formula",
    remedy: str = "give its parameters bounds that imply the shape, or use another formula",
) -> Model:
    """Check that a model keeps its shape, and return the model with a record of the shape. This is
    used for models that cannot be fitted with a shape as a constraint, for example formulas. Raises
    FitError if the model does not keep the shape.
    """
    asked = asked_of(fit)
    region = region_of(model, curves, fit) if asked else None
    if region is None:
        return model
    if wrong := [violation for violation in violations(model, asked, region) if violation.amount]:
        raise FitError(
            f"fit.shape: the fitted {kind} violates the shape by {wrong[0].amount:.3g} "
            f"{model.output.unit}, most at {wrong[0].place}",
            remedy,
        )
    return with_shape(model, model, curves, region, fit)
