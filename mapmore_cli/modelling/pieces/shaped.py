"""Fit the coefficients of all segments together, with constraints on the coefficients and on the
output of the fused model.

The terms are those that FROLS has chosen. The sum of squares over all segments is minimised again
with linear inequalities as constraints. These are the bounds of coefficients, and the shape of the
fused output on a grid (`shape.exchange`). With `levels: linear`, the model is linear in its
coefficients; with `pchip`, it is not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns, row_count
from mapmore_cli.domain.fits import SegmentedCurve
from mapmore_cli.domain.models import Model, Pieces, SegmentFunction
from mapmore_cli.domain.recording import Curve, uncertainty_of
from mapmore_cli.modelling.expressions import dictionary_matrix, parse
from mapmore_cli.modelling.literature.model import backbone_values
from mapmore_cli.modelling.pieces.definition import pieces_program
from mapmore_cli.modelling.pieces.recipe import Recipe
from mapmore_cli.modelling.pieces.segmentation import samples_at, scaled_inputs, training_curves
from mapmore_cli.modelling.program.values import evaluator
from mapmore_cli.modelling.shape.exchange import Exchange, Values
from mapmore_cli.modelling.shape.region import region_of
from mapmore_cli.modelling.shape.stencils import asked_of
from mapmore_cli.modelling.shape.support import refuse_unsupported
from mapmore_cli.modelling.shape.violations import verified, with_shape

# change of a coefficient in a difference quotient (see `step` of the class `Exchange`)
STEPS = {"linear": 1.0, "pchip": 1e-4}


def shaped(
    model: Model, curves: Sequence[Curve], segmentation: Sequence[SegmentedCurve], recipe: Recipe
) -> Model:
    """Return the fused model, with coefficients that satisfy the bounds and the shape in the
    recipe. If the recipe has neither, return the model unchanged.

    Raises FitError if the chosen terms cannot satisfy these conditions with any coefficients.
    """
    body = model.body_of(Pieces)
    asked = asked_of(recipe.fit)
    if not body.segments:  # without segments, there are no coefficients to change
        return verified(model, curves, recipe.fit)
    region = region_of(model, curves, recipe.fit) if asked else None
    if region is None and not recipe.bounds:
        return model
    if region is not None:
        names = model.input_names
        refuse_unsupported(curves, recipe.target, names, recipe.level, recipe.fit, fewest=0)
    start = np.concatenate([segment.theta for segment in body.segments])
    exchange = Exchange(
        model,
        _fused_output(model, body, len(start)),
        start,
        _triangular_factor(body, curves, segmentation, recipe),
        _coefficient_bounds(body, recipe.bounds),
        STEPS[body.fusion.levels],
    )
    if region is not None:
        exchange.until_kept(region.asks(asked), region)
    kept = replace(model, body=_with_coefficients(body, exchange.theta))
    return with_shape(model, kept, curves, region, recipe.fit, exchange.where())


def _triangular_factor(
    body: Pieces, curves: Sequence[Curve], segmentation: Sequence[SegmentedCurve], recipe: Recipe
) -> Array:
    """Return the triangular factor of the regressors of all segments, in the unit of the target,
    shape (k, k). With it, the sum of squares can be computed without the samples.
    """
    from scipy.linalg import block_diag

    training = {curve.id: curve for curve in training_curves(curves, recipe.level is not None)}
    rows = {
        segment.id: (curve.curve, segment.rows)
        for curve in segmentation
        for segment in curve.segments
    }
    blocks: list[Any] = []
    unsure = uncertainty_of(recipe.target)
    for segment in body.segments:
        curve, own_rows = rows[segment.id]
        unsure_columns = [unsure] if unsure in training[curve].columns else []
        samples = samples_at(
            training[curve].columns, own_rows, (*segment.scaling.variables, *unsure_columns)
        )
        z = scaled_inputs(segment.scaling, samples)
        P = dictionary_matrix([parse(text) for text in segment.terms], z, len(own_rows))
        P = P / samples[unsure][:, None] if unsure_columns else P
        blocks.append(np.linalg.qr(segment.scaling.y_slope * P, mode="r"))
    return block_diag(*blocks)


def _with_coefficients(body: Pieces, theta: Array) -> Pieces:
    """Return the pieces with the given coefficients. A coefficient that changes loses its standard
    error, which becomes NaN.
    """
    parts = iter(np.split(theta, np.cumsum([len(segment.theta) for segment in body.segments])))

    def changed(segment: SegmentFunction) -> SegmentFunction:
        coefficients = next(parts)
        same = np.allclose(coefficients, segment.theta, rtol=1e-9, atol=0.0)
        return (
            segment
            if same
            else replace(
                segment, theta=coefficients, theta_error=np.full(len(coefficients), np.nan)
            )
        )

    curves = [replace(c, segments=tuple(map(changed, c.segments))) for c in body.curves]
    return replace(body, curves=tuple(curves))


def _of_coefficients(body: Pieces, names: Sequence[str]) -> Pieces:
    """Return the pieces with their coefficients as further inputs. Each term becomes `name*term`
    with the coefficient 1, and its `name` in `names` is a new input.
    """
    left = iter(names)
    everywhere = dict.fromkeys(names, (-1e300, 1e300))
    sides = {**body.fusion.extrapolation, **dict.fromkeys(names, ("continue", "continue"))}

    def opened(segment: SegmentFunction) -> SegmentFunction:
        factors = [next(left) for _ in segment.terms]
        ones = np.ones(len(factors))
        scaling = segment.scaling
        return replace(
            segment,
            terms=tuple(
                f"{factor}*({term})" for factor, term in zip(factors, segment.terms, strict=True)
            ),
            theta=ones,
            scaling=replace(
                scaling,
                variables=(*scaling.variables, *factors),
                slope=np.append(scaling.slope, ones),
                intercept=np.append(scaling.intercept, 0 * ones),
            ),
        )

    curves = [
        replace(c, segments=tuple(map(opened, c.segments)), limits={**c.limits, **everywhere})
        for c in body.curves
    ]
    return replace(body.joined(extrapolation=sides), curves=tuple(curves))


def _fused_output(model: Model, body: Pieces, count: int) -> Values:
    """Return the fused output as a function of the coefficients and of the inputs of the model."""
    inputs = model.input_names
    names = [f"coefficient_{number}" for number in range(count)]
    program = evaluator(pieces_program(_of_coefficients(body, names), [*inputs, *names]))

    def value(theta: Array, columns: Columns) -> Array:
        n = row_count(columns)
        pieces = program({**columns, **dict(zip(names, theta, strict=True))})[0]
        return pieces + backbone_values(body.backbone, columns, n)

    return value


def _coefficient_bounds(
    body: Pieces, bounds: Mapping[str, tuple[float, float]]
) -> tuple[Array, Array]:
    """Return the bounds of the coefficients as linear inequalities. `bounds` holds the bounds of
    each term, in the unit of the target.
    """
    terms = [(term, segment.scaling.y_slope) for segment in body.segments for term in segment.terms]
    low, high = np.array([bounds.get(term, (-np.inf, np.inf)) for term, _ in terms]).T
    slopes = np.diag([slope for _, slope in terms])
    D = np.vstack([slopes, -slopes])
    d = np.append(low, -high)
    return D[np.isfinite(d)], d[np.isfinite(d)]
