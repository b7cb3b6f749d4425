"""Fit black boxes (`modelling/learners.py`) as competitors, and predict with them.

The inputs of a black box are those of the run's own model, scaled to mean 0 and standard deviation
1 on the training samples. If the run's own model uses the past, the black boxes also get each input
delayed by some samples (`DELAYS`), so that the comparison is fair. The output is never fed back.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.modelling.kinds import runs_over_time
from mapmore_cli.modelling.learners import LEARNERS
from mapmore_cli.modelling.signals.sampling import even_share

DELAYS = (0, 1, 2, 4, 8, 16, 32)
"""Delays of the inputs, in samples, if the run's own model uses the past."""


def predictions(name: str, dataset: Dataset, model: Model) -> list[Array]:
    """Fit the black box to the training samples, and return its predictions for every sample of
    every curve, (n_c,) each.

    - `name`: one of `LEARNERS`.
    - `model`: the run's own model. The inputs of the black box are the inputs of this model without
      the target. If the model has memory, the inputs are also delayed by `DELAYS` samples.
    """
    names = [name for name in model.input_names if name != dataset.target]
    delays = DELAYS if runs_over_time(model) else (0,)
    inputs = [features(curve, names, delays) for curve in dataset.curves]
    x = np.concatenate(
        [of[curve.training] for of, curve in zip(inputs, dataset.curves, strict=True)]
    )
    y = np.concatenate([curve.columns[dataset.target][curve.training] for curve in dataset.curves])
    known = np.isfinite(x).all(axis=1) & np.isfinite(y)
    most = LEARNERS[name].most_samples
    x, y = even_share(x[known], most), even_share(y[known], most)
    predict = learned(name, x, y)
    return [predict(of) for of in inputs]


def learned(name: str, x: Array, y: Array) -> Callable[[Array], Array]:
    """Fit a black box to inputs, (n, features), and outputs, (n,). Return a function that takes
    inputs, (m, features), and returns predictions, (m,).
    """
    centre, width = x.mean(axis=0), _width(x)
    middle, height = float(y.mean()), float(_width(y))
    learner = LEARNERS[name].make(x.shape[1])
    with warnings.catch_warnings():
        # if scikit-learn stops a search early, its result is still valid
        warnings.filterwarnings("ignore", module="sklearn")
        learner.fit((x - centre) / width, (y - middle) / height)
    return lambda of: _learner_says(learner, (of - centre) / width) * height + middle


def features(curve: Curve, names: Sequence[str], delays: Sequence[int]) -> Array:
    """Return the inputs and the delayed inputs of every sample, (n, features). A delayed input that
    would come from a time before the recording has the value of the first sample of the recording.
    """
    delayed = np.empty((curve.size, len(names) * len(delays)))
    for rows in curve.logs:
        places = np.arange(len(rows))
        columns = [
            curve.columns[name][rows][np.maximum(places - delay, 0)]
            for name in names
            for delay in delays
        ]
        delayed[rows] = np.column_stack(columns)
    return delayed


def _width(values: Array) -> Array:
    """Return the standard deviation of each column. For a constant column, return 1, so that the
    column can be divided by it.
    """
    deviation = values.std(axis=0)
    return np.where(deviation > 0, deviation, 1.0)


def _learner_says(learner: Any, inputs: Array) -> Array:
    """Return the predictions of a fitted black box, (n,); NaN if an input is NaN."""
    output = np.full(len(inputs), np.nan)
    known = np.isfinite(inputs).all(axis=1)
    if known.any():
        output[known] = learner.predict(inputs[known])
    return output
