"""Choose the samples of a validation that the report shows. The samples are chosen while all of
them are in memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray, Ranges, extremes, picked
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.results import Validation
from mapmore_cli.modelling.kinds import runs_over_time
from mapmore_cli.modelling.signals.sampling import MANY, envelope
from mapmore_cli.modelling.validation.metrics import bands
from mapmore_cli.modelling.validation.residuals import residual_tests


def for_report(validation: Validation, model: Model, dataset: Dataset) -> Validation:
    """Return the validation with error bands and residual tests, and with the samples that figures
    show. Error bands and residual tests are computed from all samples.

    If a curve has more than `MANY` samples, its rows are divided into `MANY / 4` consecutive parts.
    From each part, figures show four samples: those with the smallest and the largest measured
    value, and those with the smallest and the largest error. Long recordings are divided into parts
    too; from each part, figures show the samples with the smallest and the largest value of each
    quantity.
    """
    predictions = validation.predictions
    predicted = next(iter(predictions.values()))
    course = course_quantity(model, dataset)
    order = model.output.name if is_turned(model, dataset) else course
    tests = residual_tests(model, dataset, predicted, None if in_time(model, dataset) else order)
    made = replace(
        validation, along=course, bands=bands(dataset, predictions), residual_tests=tests
    )
    recordings = dataset.recordings
    curves = dataset.curves
    if (
        max([recording.rows_kept for recording in recordings] + [curve.size for curve in curves])
        <= MANY
    ):
        return made
    of_curves = [
        _extremes([(curve.columns[dataset.target],), (values, curve.columns[dataset.target])])
        for curve, values in zip(curves, predicted, strict=True)
    ]
    shown = replace(
        dataset,
        recordings=tuple(
            recording.at(_extremes([*zip(recording.columns.values())])) for recording in recordings
        ),
        curves=tuple(curve.at(rows) for curve, rows in zip(curves, of_curves, strict=True)),
    )
    kept = {
        name: tuple(picked(values, rows) for values, rows in zip(every, of_curves, strict=True))
        for name, every in predictions.items()
    }
    return replace(made, predictions=kept, shown=shown)


def _extremes(columns: Sequence[tuple[Array, ...]]) -> IntArray:
    """Return at most `MANY` row numbers. The rows are divided into consecutive parts, and the rows
    with the smallest and the largest value of each column in each part are returned. If an element
    of `columns` has two columns, the differences of both are used as values.
    """
    rows = [envelope(values[0], MANY // len(columns), *values[1:]) for values in columns]
    return np.unique(np.concatenate(rows))


def in_time(model: Model, dataset: Dataset) -> bool:
    """Return True if curves are shown over time, because the model has memory or the curves are
    step responses.
    """
    return runs_over_time(model) or any(curve.at_rest is not None for curve in dataset.curves)


def is_turned(model: Model, dataset: Dataset) -> bool:
    """Return True if the model must be inverted for the scores, because the target is one of its
    inputs.
    """
    inputs = {*model.input_names}
    return dataset.target in inputs and dataset.target != model.output.name


def course_quantity(model: Model, dataset: Dataset) -> str:
    """Return the input of the model that varies within a curve. For a model without inputs, return
    a measured quantity other than the time and, if possible, other than the target.
    """
    ranges = [
        {name: extremes(x) for name, x in curve.columns.items()}
        for curve in dataset.curves
        if curve.size
    ]
    measured = (name for name in dataset.quantities if name != "time")
    return varying_input(model, ranges) or min(measured, key=lambda name: name == dataset.target)


def varying_input(model: Model, ranges: Sequence[Ranges]) -> str:
    """Return the name of the input that varies within a curve; empty for a model without inputs.

    It is the first segmented variable. If nothing is segmented, the range of each input within a
    curve is divided by its range over all curves, and averaged over the curves. The input with the
    largest mean is returned, because this ratio is small for an input that is nearly constant
    within a curve. `ranges` holds the ranges of the inputs for each curve.
    """
    pieces = model.pieces
    if pieces is not None and pieces.variables:
        return pieces.variables[0]

    def covered(name: str) -> float:
        ends = np.array([limits[name] for limits in ranges if name in limits])
        whole = float(np.ptp(ends)) if len(ends) else 0.0
        return round(float(np.mean(np.ptp(ends, axis=1))) / whole, 2) if whole > 0 else 0.0

    names = model.input_names
    free = [name for name in names if name != model.level] or names
    return max(free, key=covered, default="")
