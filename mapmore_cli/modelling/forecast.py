"""What a model says of a measured recording: its prediction, where it has one, and one step ahead."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.memory import AtSample, free_run, one_step_ahead


@dataclass(frozen=True)
class Forecast:
    """Predictions of the samples of a curve, (n,) each.

    Attributes
    ----------
    values
        The model's prediction, in free run where it has memory; NaN before there is history, and from where a run diverged.
    ready
        Samples with enough history to be predicted; what is NaN among them has diverged.
    one_step
        Prediction of every sample from the measured past; None for a model without memory.
    """

    values: Array
    ready: BoolArray
    one_step: Array | None = None

    @classmethod
    def of(cls, values: Array) -> Forecast:
        """Predictions that need no history; what is NaN among them is none."""
        return cls(values, np.ones(len(values), dtype=np.bool_))

    @property
    def diverged(self) -> tuple[int, ...]:
        """Rows at which a free run diverges."""
        if self.one_step is None:
            return ()
        lost = self.ready & np.isnan(self.values)
        return tuple(np.flatnonzero(lost & ~np.concatenate([[False], lost[:-1]])).tolist())


def forecast(model: Model, curve: Curve) -> Forecast:
    """Predict every sample of a curve, recording by recording; raises as `model.predict`, naming the recording."""
    memories = model.memories
    if not memories:
        return Forecast.of(predict(model, curve.columns))
    static = _without_memory(model)
    values, one_step, ready = np.empty(curve.size), np.empty(curve.size), np.empty(curve.size, dtype=np.bool_)
    for log, rows in enumerate(curve.logs):
        columns = {name: column[rows] for name, column in curve.columns.items()}
        try:
            steps = [one_step_ahead(memory, columns) for memory in memories]
            runs = [free_run(memory, columns).values for memory in memories]
        except AtSample as error:
            raise DataError(f"{model.name} on {curve.recordings[log]}: {error.message}", error.remedy) from error
        ready[rows] = np.logical_and.reduce([np.isfinite(step) for step in steps])
        rest = predict(static, columns)
        one_step[rows], values[rows] = rest + np.sum(steps, axis=0), rest + np.sum(runs, axis=0)
    return Forecast(values, ready, one_step)


def _without_memory(model: Model) -> Model:
    return replace(model, memory=None, summands=tuple(_without_memory(summand) for summand in model.summands))
