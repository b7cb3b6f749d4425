"""A fused model written out from the equations, row by row: what `predict` has to agree with."""

import numpy as np

from mapmore_cli.modelling import literature
from mapmore_cli.modelling.expressions import derivative, evaluate, parse

S = {
    "linear": lambda t: t,
    "quadratic": lambda t: 2 * t**2 if t < 0.5 else 1 - 2 * (1 - t) ** 2,
    "cubic": lambda t: 3 * t**2 - 2 * t**3,
}


def dense(model, columns):
    """`y = backbone + sum_l w_l(level) sum_i f_i(E(x)) prod_j w_ij(x_j)` row by row, (n,)."""
    names = [quantity.name for quantity in model.inputs]
    rows = [
        dict(zip(names, map(float, values), strict=True))
        for values in zip(*(columns[name] for name in names), strict=True)
    ]
    y = np.array([pieces(model, row) for row in rows])
    if model.backbone is not None:
        y = y + literature.get(model.backbone.name).predict(model.backbone.parameters, columns)
    return y


def pieces(model, row):
    if model.level is None:
        return curve_value(model, model.body.curves[0], row)
    at = np.array([curve.level for curve in model.body.curves])
    below, above = model.body.fusion.extrapolation[model.level]
    x = row[model.level]
    if x < at[0]:
        x = at[0] if below == "saturate" else below if isinstance(below, float) else x
    elif x > at[-1]:
        x = at[-1] if above == "saturate" else above if isinstance(above, float) else x
    row = {**row, model.level: x}
    if (x < at[0] and below == "zero") or (x > at[-1] and above == "zero"):
        return 0.0
    straight = (x < at[0] and below == "continue_linear") or (
        x > at[-1] and above == "continue_linear"
    )
    within = x if straight else min(max(x, at[0]), at[-1])
    f = {
        number: curve_value(model, model.body.curves[number], row)
        for number in counting(at, within, model.body.fusion.levels == "pchip")
    }
    if len(f) == 1:
        return next(iter(f.values()))
    share = 1.0
    if at[0] <= x <= at[-1]:
        left = min(int(np.searchsorted(at, x, side="right")) - 1, len(at) - 2)
        t = (x - at[left]) / (at[left + 1] - at[left])
        share = model.body.fusion.shrink + (1 - model.body.fusion.shrink) * (1 - 2 * t) ** 2
    return share * across(model, at, f, within)


def counting(at, x, pchip):
    """Numbers of the curves that matter: the others may have no value there."""
    if x in at:
        return [int(np.flatnonzero(at == x)[0])]
    if pchip or len(at) == 1:
        return range(len(at))
    left = min(max(int(np.searchsorted(at, x)) - 1, 0), len(at) - 2)
    return [left, left + 1]


def across(model, at, f, x):
    if model.body.fusion.levels == "linear":
        (i, a), (j, b) = f.items()
        return a + (b - a) * (x - at[i]) / (at[j] - at[i])
    from scipy.interpolate import PchipInterpolator

    interpolant = PchipInterpolator(at, [f[i] for i in range(len(at))])
    inside = min(max(x, at[0]), at[-1])
    return float(interpolant(inside) + interpolant.derivative()(inside) * (x - inside))


def curve_value(model, curve, row):
    at, beyond = dict(row), {}
    for name in row:
        if name == model.level:
            continue
        low, high = curve.limits[name]
        for side, limit, out in zip(
            model.body.fusion.extrapolation[name],
            (low, high),
            (row[name] < low, row[name] > high),
            strict=True,
        ):
            if out and side == "zero":
                return 0.0
            if out and side != "continue":
                at[name] = side if isinstance(side, float) else limit
            if out and side == "continue_linear":
                beyond[name] = row[name] - limit
    total = 0.0
    for segment in curve.segments:
        weight = 1.0
        for name, boundaries, place in zip(
            model.body.variables, curve.boundaries, segment.cell, strict=True
        ):
            weight *= cell_weight(
                at[name], boundaries, place, S[model.body.fusion.transition], model.body.fusion.z_s
            )
        if weight != 0.0:
            total += weight * segment_at(model, curve, segment, at, beyond)
    return total


def cell_weight(x, boundaries, place, s, z_s):
    """M2 eq 10 and 11: rises in the zone at the left boundary of the segment, falls in that at its
    right one.
    """

    def rise(i):
        if i == 0:
            return 1.0
        if i == len(boundaries) - 1:
            return 0.0
        start = boundaries[i] - z_s * (boundaries[i] - boundaries[i - 1])
        end = boundaries[i] + z_s * (boundaries[i + 1] - boundaries[i])
        return 0.0 if x <= start else 1.0 if x >= end else s((x - start) / (end - start))

    return rise(place - 1) - rise(place)


def segment_at(model, curve, segment, at, beyond):
    held = dict(at)
    for name, boundaries, place in zip(
        model.body.variables, curve.boundaries, segment.cell, strict=True
    ):
        if name not in segment.limits or model.body.fusion.hold == "none":
            continue
        low, high = segment.limits[name]
        reach = model.body.fusion.z_s * (high - low)
        held[name] = max(held[name], low - reach) if place > 1 else held[name]
        held[name] = min(held[name], high + reach) if place < len(boundaries) - 1 else held[name]
    scaling = segment.scaling
    slopes = dict(zip(scaling.variables, scaling.slope, strict=True))
    z = {
        n: np.array([held[n] * m + c])
        for n, m, c in zip(scaling.variables, scaling.slope, scaling.intercept, strict=True)
    }
    terms = [parse(term) for term in segment.terms]
    value = sum(
        theta * evaluate(term, z, 1)[0] for theta, term in zip(segment.theta, terms, strict=True)
    )
    for name, distance in beyond.items():
        if name in slopes:
            steep = sum(
                theta * evaluate(derivative(term, name), z, 1)[0]
                for theta, term in zip(segment.theta, terms, strict=True)
            )
            value += steep * slopes[name] * distance
    return scaling.y_slope * value + scaling.y_intercept
