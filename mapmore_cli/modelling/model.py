"""Evaluation of a fused model: `y(x) = sum_i f_i(E(x)) prod_j w_ij(x_j)` (M1 eq 5, M2 eq 9)."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns
from mapmore_cli.domain.models import CurveFunction, Model, SegmentFunction, Side
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.extrapolation import clamped, zeroed
from mapmore_cli.modelling.fusion import carried_share, cell_weights, level_weights, shape_preserving
from mapmore_cli.modelling.fusion.alignment import aligned
from mapmore_cli.modelling.scaling import scaled
from mapmore_cli.modelling.terms import Expression, derivative, evaluate, parse

OUTSIDE_TOLERANCE = 1e-9
"""Inputs within this fraction of a range beyond its end still count as inside: the end itself must not be flagged by rounding."""


def predict(model: Model, columns: Columns) -> Array:
    """Output of the model at every row, (n,); NaN where an input is NaN.

    Parameters
    ----------
    columns
        The model's inputs by name, each (n,), in the model's units.

    Raises
    ------
    KeyError
        Where an input is missing.
    """
    inputs = {quantity.name: np.asarray(columns[quantity.name], dtype=np.float64) for quantity in model.inputs}
    n = len(next(iter(inputs.values())))
    y = np.zeros(n)
    if any(curve.segments for curve in model.curves):
        y += _pieces(model, inputs)
    if model.backbone is not None:
        y += literature.get(model.backbone.name).predict(model.backbone.parameters, inputs)
    y[~np.isfinite(np.column_stack(list(inputs.values()))).all(axis=1)] = np.nan
    return y


def outside_range(model: Model, columns: Columns) -> BoolArray:
    """True where an input lies beyond the training range, (n,).

    The range of the level quantity is that of its levels; the range of any other input is interpolated between the curves, since each
    curve has its own (free strain grows with pressure).
    """
    level, others = model.level, [q.name for q in model.inputs if q.name != model.level]
    n = len(next(iter(columns.values())))
    outside = np.zeros(n, dtype=bool)
    weights = np.ones((n, 1))
    if level is not None:
        levels = level_values(model)
        outside |= _beyond(columns[level], np.full(n, levels[0]), np.full(n, levels[-1]))
        weights = level_weights(columns[level], levels)
    for name in others:
        limits = np.array([curve.limits[name] for curve in model.curves])
        if len(limits):
            outside |= _beyond(columns[name], weights @ limits[:, 0], weights @ limits[:, 1])
    return outside


def _beyond(x: Array, low: Array, high: Array) -> BoolArray:
    margin = OUTSIDE_TOLERANCE * np.maximum(high - low, np.maximum(np.abs(low), np.abs(high)))
    return (x < low - margin) | (x > high + margin)


def level_values(model: Model) -> Array:
    """The levels of the model's curves, ascending, (L,)."""
    return np.array([curve.level for curve in model.curves], dtype=np.float64)


def extrapolation(model: Model, name: str) -> tuple[Side, Side]:
    """What an input does below and above its limits."""
    return model.fusion.extrapolation[name]


def _pieces(model: Model, inputs: Columns) -> Array:
    if model.level is None:
        return evaluate_curve(model, model.curves[0], inputs)
    levels = level_values(model)
    below, above = extrapolation(model, model.level)
    held = ("continue", "continue_linear", "zero")  # these act on the weights; only `saturate` and a value move the level itself
    moved = tuple("continue" if side in held else side for side in (below, above))
    at_level = clamped(inputs[model.level], (levels[0], levels[-1]), (moved[0], moved[1]))
    inputs = {**inputs, model.level: at_level}
    weights = level_weights(at_level, levels, str(below), str(above))
    if model.fusion.levels == "linear":
        y: Array = np.einsum("nl,nl->n", weights, _curve_values(model, inputs, weights != 0))
    else:
        values = _curve_values(model, inputs, np.ones(weights.shape, dtype=bool))
        y = shape_preserving(at_level, levels, values, str(below), str(above))
    return y * carried_share(at_level, levels, model.fusion.shrink)


def _curve_values(model: Model, inputs: Columns, needed: BoolArray) -> Array:
    """Values of all curves at all rows, (n, L), each looked up at its own place where curves are aligned; zero where not needed."""
    values = np.zeros(needed.shape)
    places = _aligned_places(model, inputs)
    for number, curve in enumerate(model.curves):
        rows = np.flatnonzero(needed[:, number])
        if len(rows):
            own = {**inputs, **{name: at[:, number] for name, at in places.items()}}
            values[rows, number] = evaluate_curve(model, curve, {name: x[rows] for name, x in own.items()})
    return values


def _aligned_places(model: Model, inputs: Columns) -> dict[str, Array]:
    """Where each curve is looked up along the aligned variable, (n, L); empty where there is none."""
    name = model.fusion.aligned
    if name is None or model.level is None:
        return {}
    own = np.array([[curve.limits[name][0], curve.threshold, curve.limits[name][1]] for curve in model.curves], dtype=np.float64)
    marks = level_weights(inputs[model.level], level_values(model)) @ own
    return {name: np.column_stack([aligned(inputs[name], marks, curve) for curve in own])}


def evaluate_curve(model: Model, curve: CurveFunction, inputs: Columns) -> Array:
    """The fused segments of one curve, (n,), with the extrapolation of every input but the level."""
    free = [quantity.name for quantity in model.inputs if quantity.name != model.level]
    sides = {name: extrapolation(model, name) for name in free}
    within = {**inputs, **{name: clamped(inputs[name], curve.limits[name], sides[name]) for name in free}}
    linear = [name for name in free if "continue_linear" in sides[name]]
    y = np.zeros(len(next(iter(inputs.values()))))
    for segment, weight in zip(curve.segments, _segment_weights(model, curve, within), strict=True):
        rows = np.flatnonzero(weight)
        if len(rows) == 0:
            continue
        at = _in_reach(model, curve, segment, {name: x[rows] for name, x in within.items()})
        value = segment_value(segment, at)
        for name in linear:
            beyond = (inputs[name] - within[name])[rows]
            if beyond.any():
                value += segment_slope(segment, at, name) * beyond
        y[rows] += weight[rows] * value
    for name in free:
        y[zeroed(inputs[name], curve.limits[name], sides[name])] = 0.0
    return y


def _in_reach(model: Model, curve: CurveFunction, segment: SegmentFunction, inputs: Columns) -> Columns:
    """Inputs held where a segment function is carried beyond its samples by more than z_s of their width.

    M2 eq 10 and 11 make a transition zone z_s of *both* neighbours' widths: in the zone beside a wide segment, the function of a narrow one
    would be carried several times its width beyond its data, where a polynomial explodes. Segments of one width that are full of samples
    are not held. The outer ends of a curve are left to `extrapolation`.
    """
    held = dict(inputs)
    for name, boundaries, place in zip(model.variables, curve.boundaries, segment.cell, strict=True):
        low, high = segment.limits.get(name, (-np.inf, np.inf))
        reach = model.fusion.z_s * (high - low)
        lowest = -np.inf if place == 1 else low - reach
        highest = np.inf if place == len(boundaries) - 1 else high + reach
        held[name] = np.clip(inputs[name], lowest, highest)
    return held


def _segment_weights(model: Model, curve: CurveFunction, inputs: Columns) -> list[Array]:
    """Product over the segmented variables of each segment's weight; one where nothing is cut."""
    n = len(next(iter(inputs.values())))
    along = [
        cell_weights(inputs[name], boundaries, model.fusion.transition, model.fusion.z_s)
        for name, boundaries in zip(model.variables, curve.boundaries, strict=True)
    ]
    weights = []
    for segment in curve.segments:
        weight = np.ones(n)
        for place, table in zip(segment.cell, along, strict=True):
            weight = weight * table[:, place - 1]
        weights.append(weight)
    return weights


def segment_value(segment: SegmentFunction, columns: Columns) -> Array:
    """`y_slope sum_k theta_k D_k(z) + y_intercept` (M2 eq 8), (n,)."""
    z = scaled(segment.scaling, columns)
    n = len(next(iter(columns.values())))
    total = np.zeros(n)
    for theta, term in zip(segment.theta, segment.terms, strict=True):
        total += theta * evaluate(_parsed(term), z, n)
    return segment.scaling.y_slope * total + segment.scaling.y_intercept


def segment_slope(segment: SegmentFunction, columns: Columns, name: str) -> Array:
    """Derivative of `segment_value` with respect to one input, (n,)."""
    scaling = segment.scaling
    n = len(next(iter(columns.values())))
    if name not in scaling.variables:
        return np.zeros(n)
    z = scaled(scaling, columns)
    total = np.zeros(n)
    for theta, term in zip(segment.theta, segment.terms, strict=True):
        total += theta * evaluate(derivative(_parsed(term), name), z, n)
    return scaling.y_slope * float(scaling.slope[scaling.variables.index(name)]) * total


@lru_cache(maxsize=4096)
def _parsed(term: str) -> Expression:
    return parse(term)
