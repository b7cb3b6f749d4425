"""Predict every sample of a curve with a model."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from mapmore_cli.domain.arrays import (
    ROWS,
    Array,
    BoolArray,
    by_blocks,
    columns_at,
    joined,
    row_by_row,
)
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Curve
from mapmore_cli.domain.results import Forecast
from mapmore_cli.modelling.inverse import solve_for_input
from mapmore_cli.modelling.kinds import (
    one_step_ahead,
    outside_range,
    predict,
    runs_over_time,
    simulate,
)
from mapmore_cli.modelling.memory.records import AtSample


def forecast_each(model: Model, curves: Sequence[Curve], target: str) -> tuple[Forecast, ...]:
    """Predict every sample of several curves, as `forecast` does. If the model has no memory, short
    curves are joined and predicted in one call, because a call takes longer than the prediction of
    a hundred samples.
    """
    if target != model.output.name or runs_over_time(model):
        return tuple(forecast(model, curve, target) for curve in curves)
    waiting, forecasts, names = [*curves], list[Forecast](), model.input_names
    while waiting:
        sizes = np.cumsum([curve.size for curve in waiting[:TOGETHER]])
        together = waiting[: max(1, int(np.searchsorted(sizes, ROWS)))]
        del waiting[: len(together)]
        columns = {name: joined([curve.columns[name] for curve in together]) for name in names}
        values = row_by_row(partial(predict, model), columns)
        forecasts += map(Forecast.of, np.split(values, sizes[: len(together) - 1]))
    return tuple(forecasts)


TOGETHER = 1000
"""Largest number of curves that are predicted together."""


def forecast(model: Model, curve: Curve, target: str | None = None) -> Forecast:
    """Predict every sample of a curve, recording by recording. Raises the same errors as `predict`,
    with the name of the recording.

    If the `target` is an input of the model, the model is inverted: the input is computed from the
    output (`inverse.solve_for_input`).
    """
    if target is not None and target != model.output.name:
        return Forecast.of(
            row_by_row(lambda block: solve_for_input(model, block, target).values, curve.columns)
        )
    if not runs_over_time(model):
        return Forecast.of(row_by_row(partial(predict, model), curve.columns))
    runs: list[tuple[Array, Array]] = []
    for log, rows in enumerate(curve.stretches):
        columns = columns_at(curve.columns, rows)
        try:
            runs.append((one_step_ahead(model, columns), simulate(model, columns).values))
        except AtSample as error:
            raise DataError(
                f"{model.name} on {curve.recordings[log]}: {error.message}", error.remedy
            ) from error
    one_step, values = map(curve.together, zip(*runs, strict=True))
    return Forecast(values, by_blocks(np.isfinite, one_step), one_step)


def outside(model: Model, curve: Curve) -> BoolArray:
    """Return True for each sample of a curve at which an input lies outside its training range,
    (n,). For a model with memory, each recording is tested as a whole, because the state at a
    sample depends on earlier samples. For any other model, blocks of rows are tested.
    """
    of = partial(outside_range, model)
    if not runs_over_time(model):
        return np.asarray(row_by_row(of, curve.columns))
    is_outside = np.zeros(curve.size, dtype=np.bool_)
    for rows in curve.stretches:
        is_outside[rows] = of(columns_at(curve.columns, rows))
    return is_outside
