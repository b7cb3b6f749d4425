"""Find training samples that lie far from a robust fit, and their places in the files."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapmore_cli.domain.recording import Dataset, uncertainty_of
from mapmore_cli.domain.results import Forecast, Outlier
from mapmore_cli.modelling.frols.weighing import LOSSES, scale_of
from mapmore_cli.modelling.selection import Fit

FAR = LOSSES["bisquare"].tuning
"""A sample is listed if its residual is larger than this number of scales. The `bisquare` loss
ignores such residuals.
"""

MOST = 500  # largest number of outliers that are listed


def outliers(dataset: Dataset, forecasts: Sequence[Forecast], fit: Fit) -> tuple[Outlier, ...]:
    """Return the training samples whose residuals are larger than `FAR` times the scale of the
    residuals. At most `MOST` samples are returned, the farthest first. A model with memory predicts
    one step ahead.

    Because a model with memory uses measured outputs, it may also be wrong at the sample after an
    outlier. Residuals are divided by their uncertainty if it is known. The scale is the number
    `scale` in the section `fit` of the spec; without this number, it is 1.4826 times the median
    absolute residual of all training samples.
    """
    curves = dataset.curves
    target = dataset.target
    predicted = np.concatenate(
        [
            forecast.values if forecast.one_step is None else forecast.one_step
            for forecast in forecasts
        ]
    )
    y = np.concatenate([curve.columns[target] for curve in curves])
    equal = np.ones(len(y))
    unit = np.concatenate([c.columns.get(uncertainty_of(target), equal[: c.size]) for c in curves])
    known = np.concatenate([curve.training for curve in curves]) & np.isfinite(predicted)
    left = np.where(known, y - predicted, 0.0) / unit
    scales = left / (fit.known_scale or scale_of(left[known], (y / unit)[known]))
    far = min(MOST, np.count_nonzero(np.abs(scales) > FAR))
    ranked = np.argsort(-np.abs(scales), kind="stable")[:far]
    return tuple(
        Outlier(*_found_at(dataset, at), float(y[at] - predicted[at]), float(scales[at]))
        for at in ranked.tolist()
    )


def _found_at(dataset: Dataset, at: int) -> tuple[str, str, str]:
    """Return the curve of a sample, the file from which the sample was read, and its row in this
    file. `at` is the number of the sample if the samples of all curves are counted one after the
    other.
    """
    ends = np.cumsum([curve.size for curve in dataset.curves])
    number = int(np.searchsorted(ends, at, side="right"))
    curve = dataset.curves[number]
    row = at - int(ends[number]) + curve.size
    name = curve.recordings[0 if curve.origin is None else int(curve.origin[row])]
    recording = next(recording for recording in dataset.recordings if recording.id == name)
    same = [
        x == curve.columns[quantity][row]
        for quantity, x in recording.columns.items()
        if quantity in curve.columns and quantity not in (dataset.target, dataset.level)
    ]
    rows = np.flatnonzero(np.logical_and.reduce(same))
    known = recording.first_row and rows.size == 1
    place = f"row {recording.first_row + int(rows[0])}" if known else f"sample {row + 1}"
    return recording.source, place, curve.id
