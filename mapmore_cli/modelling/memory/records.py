"""Uninterrupted pieces of recordings, the unit within which memory lasts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, IntArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.signals.gaps import find_resets, pieces

UNEVEN = 1e-3
"""Of a time step: more than this apart from an even grid, samples are not evenly spaced. Stamps are often rounded so far."""


@dataclass(frozen=True)
class Record:
    """One piece: quantities by name, (n,) each, at even time steps; `training` (n,) marks the samples to learn from."""

    columns: Columns
    training: BoolArray

    @property
    def size(self) -> int:
        """Number of samples, n."""
        return len(self.training)


def uninterrupted(time: Array, step: float) -> list[slice]:
    """The pieces of a record: it is cut where a step is longer than `step`, and where time runs backwards.

    Parameters
    ----------
    time
        Stamps, (n,), s.
    step
        Time between samples, s.

    Raises
    ------
    DataError
        Where stamps are neither `step` apart nor a gap: the memory of the model counts samples.
    """
    distances = np.diff(time)
    slack = UNEVEN * step + 4 * np.finfo(np.float64).eps * float(np.abs(time).max(initial=0.0))
    early = np.flatnonzero((distances >= 0) & (distances < step - slack))
    if len(early):
        at = int(early[0])
        raise DataError(
            f"the samples {at} and {at + 1} are {distances[at]:.6g} s apart; a model with memory needs even steps of {step:.6g} s",
            "bring the recording onto even time steps, as `resample` does",
        )
    breaks = np.union1d(np.flatnonzero(distances > step + slack), find_resets(time))
    return pieces(len(time), breaks)


def time_step(curves: Sequence[Curve], tolerance: float = 1e-3) -> float:
    """The time between samples that all curves have in common, s: the median.

    Raises
    ------
    DataError
        Where a curve has another one: lags count samples, so all recordings must be sampled alike.
    """
    steps = {curve.id: float(np.median(np.diff(curve.columns["time"]))) for curve in curves if curve.size > 1}
    usual = float(np.median(list(steps.values()))) if steps else float("nan")
    for name, step in steps.items():
        if not abs(step - usual) <= tolerance * usual:
            raise DataError(
                f"{name}: its samples are {step:.6g} s apart, those of other recordings {usual:.6g} s",
                "bring all recordings onto the same time steps with `resample`",
            )
    if not usual > 0:
        raise DataError("there is no time step: models with memory need samples in order of time", "name a column of stamps, `time`")
    return usual


def records_of(curves: Sequence[Curve], step: float) -> tuple[Record, ...]:
    """The recordings of all curves cut into uninterrupted pieces; samples that are held out, or at rest, do not train.

    Raises
    ------
    DataError
        Where samples are not at even time steps.
    """
    return tuple(
        Record({name: values[rows][piece] for name, values in curve.columns.items()}, curve.training[rows][piece])
        for curve in curves
        for rows in curve.logs
        for piece in _pieces(curve, rows, step)
    )


def _pieces(curve: Curve, rows: IntArray, step: float) -> list[slice]:
    try:
        return uninterrupted(curve.columns["time"][rows], step)
    except DataError as error:
        raise DataError(f"{curve.id}: {error.message}", error.remedy) from error
