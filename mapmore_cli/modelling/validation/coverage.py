"""Compare the inputs of held-out samples with those of training samples: a model extrapolates if an
input is outside its training range, or if two inputs are combined as in no training sample.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import combinations
from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, row_by_row
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.modelling.kinds import outside_range
from mapmore_cli.modelling.signals.sampling import MANY, even_share

MARGIN = 0.1
"""Distance from the convex hull of the training samples, in units of the ranges of both inputs, up
to which a combination counts as known. Repeated loops differ by less.
"""

ANGLES = np.pi * np.arange(1, 24) / 24
"""Directions in half a circle in which combinations of two inputs are compared."""


class Combination(NamedTuple):
    """The share of the held-out samples that combine two inputs as no training sample does."""

    share: float
    first: str
    second: str


def share_outside(model: Model, dataset: Dataset) -> float:
    """Return the share of the held-out samples at which an input lies outside its training range;
    0 without held-out samples.
    """
    outside = [
        row_by_row(partial(outside_range, model), curve.columns)[curve.held_out]
        for curve in _held_out(model, dataset)
    ]
    return float(np.mean(np.concatenate(outside))) if outside else 0.0


def new_combinations(model: Model, dataset: Dataset) -> Iterator[Combination]:
    """Yield every two inputs that some held-out samples combine as no training sample does,
    although no input of these samples is outside its training range. Long data are thinned evenly.
    """
    held = _held_out(model, dataset)
    training = [curve for curve in dataset.curves if curve.training.any()]
    names = model.input_names if held and training else ()
    most = MANY // max(len(dataset.curves), 1) + 1
    asked = [curve.at(even_share(np.flatnonzero(curve.held_out), most)) for curve in held]
    inside = [~outside_range(model, curve.columns) for curve in asked]
    known = [curve.at(even_share(np.flatnonzero(curve.training), most)) for curve in training]
    for first, second in combinations(names, 2):
        points = [
            np.concatenate([[curve.columns[first], curve.columns[second]] for curve in curves], 1)
            for curves in (known, asked)
        ]
        share = float(np.mean(outside_hull(*points) & np.concatenate(inside)))
        if share > 0:
            yield Combination(share, first, second)


def outside_hull(known: Array, asked: Array) -> BoolArray:
    """Return True for points of a plane, (2, m), that lie further than `MARGIN` outside the convex
    hull of the `known` points, (2, n).

    Both coordinates are divided by their range among the known points; no point is outside if a
    range is zero. A point lies outside the hull if, in some direction, no known point is as far as
    it is. The directions are spaced evenly, so that near a corner of the hull, slightly farther
    points count as inside.
    """
    spans = np.ptp(known, axis=1)
    if not spans.all():
        return np.zeros(asked.shape[1], dtype=np.bool_)
    directions = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)]) / spans
    reached, along = directions @ known, directions @ asked
    beyond = np.maximum(along.T - reached.max(axis=1), reached.min(axis=1) - along.T)
    outside: BoolArray = (beyond > MARGIN).any(axis=1)
    return outside


def _held_out(model: Model, dataset: Dataset) -> list[Curve]:
    """Return the curves with held-out samples that have all inputs of the model."""
    return [
        curve
        for curve in dataset.curves
        if curve.held_out.any() and {*model.input_names} <= {*curve.columns}
    ]
