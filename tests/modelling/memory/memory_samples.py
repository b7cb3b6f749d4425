"""Recordings with known memory, and how far a run lies from the measurement; samples that are its history have no prediction (NaN)."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.fits import MemoryModel, StateSet
from mapmore_cli.modelling.expressions.operator import Setting, along
from mapmore_cli.modelling.expressions.operators import OPERATORS
from mapmore_cli.modelling.memory.records import Record
from mapmore_cli.modelling.selection import MemoryRecipe
from mapmore_cli.modelling.validation.metrics import relative

STEP = 0.01


def state_set(*names, ranges=None, resonances=None, low=(), high=(), margin=0.15):
    return StateSet(names, STEP, ranges or {}, resonances or {}, np.array(low, dtype=float), np.array(high, dtype=float), margin)


def memory_model(terms, theta, states, constant=0.0, limits=(-1.0, 1.0), output="y"):
    theta = np.array(theta, dtype=float)
    return MemoryModel(output, states, tuple(terms), theta, np.zeros(len(theta)), constant, limits)


def recipe_of(target, dictionary, step=STEP, *, max_terms, **changed):
    """Plain FROLS of so many terms, but for what is `changed`."""
    plain = {"scaling": "none", "tolerance": 0.0}
    return MemoryRecipe(target=target, dictionary=tuple(dictionary), step=step, max_terms=max_terms, **{**plain, **changed})


def record(training=True, **columns):
    n = len(next(iter(columns.values())))
    return Record(columns, np.broadcast_to(np.asarray(training, dtype=bool), (n,)))


def wandering(n, seed=0, step=0.3):
    """An input that moves smoothly up and down."""
    rng = np.random.default_rng(seed)
    walk = np.cumsum(rng.normal(0, step, n + 40))
    return np.convolve(walk, np.ones(41) / 41, "valid") + np.sin(np.arange(n) / 25)


def narx_truth(x, y0=0.0, y1=0.0):
    """y[k] = 0.6 x[k-2] - 0.5 y[k-2] + 0.7 x[k-1] y[k-1] + 0.2 y[k-1]^2."""
    y = np.zeros(len(x))
    y[:2] = y0, y1
    for k in range(2, len(x)):
        y[k] = 0.6 * x[k - 2] - 0.5 * y[k - 2] + 0.7 * x[k - 1] * y[k - 1] + 0.2 * y[k - 1] ** 2
    return y


def slow(x, tau, step):
    """A first-order lag of x."""
    return along(OPERATORS["slow"], x, Setting((tau,), step))


def resonance(x, frequency, damping, step, name="resonance"):
    """Position of the oscillator that x drives, or its velocity by the other name."""
    return along(OPERATORS[name], x, Setting((frequency, damping), step))


def rrse(measured: Array, predicted: Array) -> float:
    """Root relative squared error, `sqrt(sum (y - yhat)^2 / sum (y - mean y)^2)`.

    The first sum is over the samples with a prediction, the second over all, as it is usual: the history counts as predicted exactly.
    NaN where nothing is predicted, or the measured values do not vary.
    """
    known = np.isfinite(predicted)
    return relative((predicted - measured)[known], measured) if known.any() else float("nan")


def rmse(measured: Array, predicted: Array) -> float:
    """`sqrt(mean (y - yhat)^2)` over the samples with a prediction; NaN where there is none."""
    error = (predicted - measured)[np.isfinite(predicted)]
    return float(np.sqrt(np.mean(error**2))) if len(error) else float("nan")


def nrmse_by_range(measured: Array, predicted: Array) -> float:
    """RMSE over the range of the measured values among the samples with a prediction; NaN where there is none."""
    known = np.isfinite(predicted)
    span = float(np.ptp(measured[known])) if known.any() else 0.0
    return rmse(measured, predicted) / span if span > 0 else float("nan")
