"""Fit the coefficients of all segments together, under conditions on the coefficients and on the
fused surface.

FROLS has chosen the terms. The sum of squares of all segments is minimised again under linear
inequalities: bounds of coefficients, and the shape on a grid of the fused model, including zones
and levels (`shape.exchange`). With `levels: linear`, the model is linear in its coefficients; with
`pchip`, it is not.
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

# step of a coefficient for numerical derivatives (`Exchange`)
STEPS = {"linear": 1.0, "pchip": 1e-4}


def shaped(
    model: Model, curves: Sequence[Curve], segmentation: Sequence[SegmentedCurve], recipe: Recipe
) -> Model:
    """Return the fused model with coefficients that fulfil the recipe's bounds and shape; the model
    itself if the recipe has none.

    Raises FitError if no coefficients of the chosen terms fulfil them.
    """
    body, asked = model.body_of(Pieces), asked_of(recipe.fit)
    if not body.segments:  # only the backbone is left, which has no coefficients to change
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
    """Return the triangular factor of the regressors of all segments, in the target's unit, shape
    (k, k). The sum of squares can be computed from this factor, without the samples.
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
    """Return the pieces with other coefficients. Coefficients that changed have no standard
    error.
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
    """Return the pieces with their coefficients turned into inputs. A term becomes `name*term` with
    the coefficient one, where `name` is one of `names`.
    """
    left, everywhere = iter(names), dict.fromkeys(names, (-1e300, 1e300))
    sides = {**body.fusion.extrapolation, **dict.fromkeys(names, ("continue", "continue"))}

    def opened(segment: SegmentFunction) -> SegmentFunction:
        factors = [next(left) for _ in segment.terms]
        ones, scaling = np.ones(len(factors)), segment.scaling
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
    """Return the fused output as a function of its coefficients: a program that has them as
    inputs.
    """
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
    """Return the bounds of coefficients as linear inequalities. `bounds` holds them by term, in the
    unit of the target.
    """
    terms = [(term, segment.scaling.y_slope) for segment in body.segments for term in segment.terms]
    low, high = np.array([bounds.get(term, (-np.inf, np.inf)) for term, _ in terms]).T
    slopes = np.diag([slope for _, slope in terms])
    D, d = np.vstack([slopes, -slopes]), np.append(low, -high)
    return D[np.isfinite(d)], d[np.isfinite(d)]
