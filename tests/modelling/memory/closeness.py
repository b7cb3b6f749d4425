"""How far a run lies from the measurement; the samples that are its history have no prediction (NaN)."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.validation.metrics import relative


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
