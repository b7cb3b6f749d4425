"""Errors by the size of what is measured: a model that is good on the whole may be poor where little is pulled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.recording import Dataset

EDGES = (0.0, 0.1, 0.25, 0.5, 1.0)
"""Of the bands, as shares of the largest absolute value of the samples that are compared; low values have the narrower ones."""


@dataclass(frozen=True)
class Band:
    """Samples whose absolute value lies in one band."""

    low: float  # in the target's unit
    high: float
    samples: int
    rmse: Mapping[str, float]  # by model; NaN where the model has no prediction there


def bands(dataset: Dataset, predictions: Mapping[str, tuple[Array, ...]]) -> tuple[Band, ...]:
    """RMSE of every model in each band, over the held-out samples where there are any, else the training samples.

    `predictions` are by model, for every curve of the dataset. A band without samples is left out.
    """
    some_held_out = any(curve.held_out.any() for curve in dataset.curves)
    masks = [curve.held_out if some_held_out else curve.training for curve in dataset.curves]
    measured = np.concatenate([curve.columns[dataset.target][mask] for curve, mask in zip(dataset.curves, masks, strict=True)])
    errors = {
        model: np.concatenate([values[mask] for values, mask in zip(of_curves, masks, strict=True)]) - measured
        for model, of_curves in predictions.items()
    }
    size = np.abs(measured)
    edges = np.array(EDGES) * float(size.max(initial=0.0))
    inside = np.digitize(size, edges[1:-1], right=True)
    found = []
    for number, (low, high) in enumerate(pairwise(edges)):
        rows = inside == number
        if rows.any():
            found.append(Band(float(low), float(high), int(rows.sum()), {model: _rmse(error[rows]) for model, error in errors.items()}))
    return tuple(found)


def _rmse(error: Array) -> float:
    known = error[np.isfinite(error)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else float("nan")
