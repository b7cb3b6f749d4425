"""Write warnings and notes on how pieces continue outside the range of their curves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapmore_cli.domain.arrays import extremes
from mapmore_cli.domain.models import Model, Pieces
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.literature.backbone import pooled_training
from mapmore_cli.modelling.pieces.recipe import Recipe

# Pieces are evaluated up to this fraction of the range of an input beyond both ends of the range.
REACH = 0.1
# An output is extreme if its distance from the middle of the measured range is larger than this
# multiple of the range.
ASTRAY = 1.5
LOOKED_AT = 400  # largest number of samples at which pieces are evaluated


def beyond_remarks(model: Model, curves: Sequence[Curve], recipe: Recipe) -> tuple[str, ...]:
    """Return a warning about curves that take extreme values outside their data. If there are no
    such curves, and the spec does not set the extrapolation of every input, return a note: curves
    with several terms in a segment are constant outside their range.
    """
    body = model.body_of(Pieces)
    if not any(len(segment.terms) > 1 for segment in body.segments):
        return ()
    if exploding := exploding_curves(model, curves, recipe.target):
        going = sorted(
            name for name, side in body.fusion.extrapolation.items() if "continue" in side
        )
        along = ", ".join(name for name in going if name != body.level)
        return (
            (
                f"beyond the data, the polynomials along {along} go on and become very large on "
                f"{', '.join(exploding)}; write `fuse: {{extrapolation: saturate}}`, which "
                "keeps the output constant there"
            ),
        )
    sides = (side for quantity in model.inputs for side in recipe.fuse.beyond(quantity.name))
    if None not in sides:
        return ()
    return (
        (
            "outside the range of a curve the output is kept constant (`fuse.extrapolation: "
            "saturate`), because segments have more than one term"
        ),
    )


def exploding_curves(model: Model, curves: Sequence[Curve], target: str) -> list[str]:
    """Return the curves that take extreme values outside their data. Such a curve has several terms
    in a segment and continues outside its range. Its value there differs from the middle of all
    measured values by more than `ASTRAY` times the measured range.

    Between two levels, the curves of both levels are evaluated, even at a place at which only one
    of them has samples. The other curve is then evaluated beyond its own end. Therefore, each curve
    is checked at the samples of all curves, and slightly beyond.
    """
    body = model.body
    if not isinstance(body, Pieces):
        return []
    sides = body.fusion.extrapolation
    if not any("continue" in side for name, side in sides.items() if name != body.level):
        return []
    samples = pooled_training(curves)
    low, high = extremes(samples[target])
    rows = np.unique(np.linspace(0, len(samples[target]) - 1, LOOKED_AT).astype(int))
    places = {}
    for name in model.input_names:
        middle = sum(extremes(samples[name])) / 2
        places[name] = middle + (1 + 2 * REACH) * (samples[name][rows] - middle)
    exploding = []
    for curve in body.curves:
        if all(len(segment.terms) < 2 for segment in curve.segments):
            continue
        at = {} if body.level is None else {body.level: np.full(len(rows), curve.level)}
        values = predict(model, {**places, **at})
        if (np.abs(values - (low + high) / 2) > ASTRAY * (high - low)).any():
            exploding.append(curve.curve)
    return exploding
