"""Compare the inputs of held-out samples with the inputs of training samples. A model extrapolates
if an input is outside its training range, or if two inputs have a combination of values that no
training sample has.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, blocks_where, stacked
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.modelling.forecast import outside
from mapmore_cli.modelling.signals.sampling import even_share

MARGIN = 0.1
"""Distance from the convex hull of the training samples, in units of the ranges of both inputs, up
to which a combination is treated as known. Repeated loops differ by less.
"""

ANGLES = np.pi * np.arange(1, 24) / 24
"""Directions in half a circle in which combinations of two inputs are compared."""


def share_outside(model: Model, dataset: Dataset) -> float:
    """Return the fraction of the held-out samples at which an input lies outside its training
    range; 0 if no samples are held out.
    """
    outside = _outside(model, dataset)
    return float(outside.mean()) if outside.size else 0.0


def new_combinations(model: Model, dataset: Dataset) -> Iterator[tuple[float, str, str]]:
    """Find pairs of inputs with new combinations of values: combinations that occur in held-out
    samples, but lie outside those of all training samples. Held-out samples with an input outside
    its training range are not considered. For each such pair, yield the fraction of all held-out
    samples that have a new combination, and the names of both inputs. Long data are thinned evenly.
    """
    known, asked = (_inputs(model, dataset, rows) for rows in ("training", "held_out"))
    inside = ~even_share(_outside(model, dataset))
    for pair in combinations(known, 2):
        points = (np.array([columns[name] for name in pair]) for columns in (known, asked))
        beyond = outside_hull(*points) & inside
        if beyond.any():
            yield float(beyond.mean()), *pair


def outside_hull(known: Array, asked: Array) -> BoolArray:
    """Return a mask, (m,), of the points `asked`, (2, m), that lie more than `MARGIN` outside the
    convex hull of the points `known`, (2, n), in a plane.

    Both coordinates are divided by their range over the known points. If such a range is zero, no
    point is outside.

    A point is outside the hull if there is a direction in which it lies farther than every known
    point. A fixed number of evenly spaced directions is tested, so that a point slightly outside a
    corner of the hull may be treated as inside.
    """
    spans = np.ptp(known, axis=1) if known.size else np.zeros(2)
    if not spans.all():
        return np.zeros(asked.shape[1], dtype=np.bool_)
    directions = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)]) / spans
    reached = directions @ known
    along = (directions @ asked).T
    outside: BoolArray = (
        (along > reached.max(axis=1) + MARGIN) | (along < reached.min(axis=1) - MARGIN)
    ).any(axis=1)
    return outside


def _outside(model: Model, dataset: Dataset) -> BoolArray:
    """Return a mask of the held-out samples at which an input lies outside its training range."""
    masks = [
        outside(model, curve)[curve.held_out]
        for curve in _with_inputs(model, dataset)
        if curve.held_out.any()
    ]
    return np.concatenate(masks or [np.empty(0, np.bool_)])


def _inputs(model: Model, dataset: Dataset, rows: str) -> dict[str, Array]:
    """Return the inputs of the model at the training samples of all curves if `rows` is `training`,
    or at the held-out samples if it is `held_out`. Long data are thinned evenly.
    """
    parts = [(curve.columns, getattr(curve, rows)) for curve in _with_inputs(model, dataset)]

    def blocks(name: str) -> Iterator[list[Array]]:
        yield [np.empty(0)]
        for columns, mask in parts:
            yield from ([block] for block in blocks_where(columns[name], mask))

    return {name: even_share(stacked(blocks(name))[0]) for name in model.input_names}


def _with_inputs(model: Model, dataset: Dataset) -> list[Curve]:
    """Return the curves that have columns for all inputs of the model."""
    return [curve for curve in dataset.curves if {*model.input_names} <= {*curve.columns}]
