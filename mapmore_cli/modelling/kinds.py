"""Evaluation of a fused model: `y(x) = sum_i f_i(E(x)) prod_j w_ij(x_j)` (M1 eq 5, M2 eq 9)."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.memory import Run, free_run
from mapmore_cli.modelling.pieces.evaluation import FusedPieces, level_values
from mapmore_cli.modelling.pieces.weights import level_weights

BLOCK = 2**18
"""Rows at a time: few enough to stay in the processor's cache, and enough for every region to have many."""

OUTSIDE_TOLERANCE = 1e-9
"""Inputs within this fraction of a range beyond its end still count as inside: the end itself must not be flagged by rounding."""


def predict(model: Model, columns: Columns) -> Array:
    """Output of the model at every row, (n,), as `simulate` has it."""
    return simulate(model, columns).values


def simulate(model: Model, columns: Columns) -> Run:
    """Output of the model at every row, (n,), NaN where an input is NaN; and the rows at which a free run diverges.

    A model with memory runs free along one recording (`memory.free_run`): it has no prediction before there is history, and starts anew
    after rows with a NaN.

    Parameters
    ----------
    columns
        The model's inputs by name, each (n,), in the model's units; with memory also `time`, and the output where it is fed back.

    Raises
    ------
    KeyError
        Where an input is missing.
    DataError
        Where a free run has nothing to begin from, or samples are not at the model's time steps.
    """
    inputs = {quantity.name: np.asarray(columns[quantity.name], dtype=np.float64) for quantity in model.inputs}
    pieces = FusedPieces(model) if any(curve.segments for curve in model.curves) else None
    y = np.empty(len(next(iter(columns.values()))))
    for start in range(0, len(y), BLOCK):
        block = {name: x[start : start + BLOCK] for name, x in inputs.items()}
        with np.errstate(all="ignore"):  # a term may overflow far outside, and what follows from a NaN is replaced
            y[start : start + BLOCK] = _block(model, pieces, block, len(y[start : start + BLOCK]))
    runs = [] if model.memory is None else [free_run(model.memory, columns)]
    runs += [simulate(summand, columns) for summand in model.summands]
    for run in runs:
        y += run.values
    return Run(y, tuple(sorted({row for run in runs for row in run.diverged})))


def _block(model: Model, pieces: FusedPieces | None, inputs: Columns, n: int) -> Array:
    finite = np.logical_and.reduce([np.ones(n, dtype=bool), *(np.isfinite(x) for x in inputs.values())])
    y = np.zeros(n) if pieces is None else pieces.values(inputs)
    if model.backbone is not None:
        y += literature.get(model.backbone.name).predict(model.backbone.parameters, inputs)
    y[~finite] = np.nan
    return y


def outside_range(model: Model, columns: Columns) -> BoolArray:
    """True where an input lies beyond the training range, of any summand where the model is a sum, (n,).

    The range of the level quantity is that of its levels; the range of any other input is interpolated between the curves, since each
    curve has its own (free strain grows with pressure).
    """
    level, others = model.level, [q.name for q in model.inputs if q.name != model.level]
    n = len(next(iter(columns.values())))
    outside = np.zeros(n, dtype=bool)
    for summand in model.summands:
        outside |= outside_range(summand, columns)
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
