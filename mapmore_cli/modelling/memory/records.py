"""Cut recordings into uninterrupted pieces. The memory of a model starts again in every piece."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, IntArray, columns_at, extremes
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.signals.sampling import UNEVEN, cut_after, steps_where, typical_step


class AtSample(DataError):
    """An error at one `sample`, counted from 0 in the given columns. `fault` is the message without
    the number of the sample.
    """

    def __init__(self, sample: int, fault: str, remedy: str | None) -> None:
        super().__init__(f"sample {sample}: {fault}", remedy)
        self.sample = sample
        self.fault = fault


@contextmanager
def numbered(rows: IntArray) -> Iterator[None]:
    """Convert an error at a sample of a piece into an error at a row of the recording. `rows` holds
    the row of each sample of the piece.
    """
    try:
        yield
    except AtSample as error:
        raise AtSample(int(rows[error.sample]), error.fault, error.remedy) from error


def complete(columns: Iterable[Array], n: int) -> BoolArray:
    """Return a mask, (n,), which is True for the rows in which every column has a finite value."""
    return np.asarray(
        np.logical_and.reduce([np.ones(n, dtype=np.bool_), *map(np.isfinite, columns)])
    )


@dataclass(frozen=True)
class Record:
    """One uninterrupted piece of a recording: quantities by name, shape (n,) each, at equal time
    steps. `training`, shape (n,), marks the training samples.
    """

    columns: Columns
    training: BoolArray

    @property
    def size(self) -> int:
        """Number of samples, n."""
        return len(self.training)


def uninterrupted(time: Array, step: float) -> list[slice]:
    """Return the pieces of a recording with the time stamps `time`, shape (n,). The recording is
    cut at steps longer than `step` (s), and at steps backwards in time. If `step` is infinite, it
    is cut only at steps backwards in time.

    Raises AtSample if a step is clearly shorter or longer than `step`, but is no gap, because the
    memory of the model assumes equal steps.
    """
    if math.isinf(step):
        return cut_after(len(time), steps_where(time, lambda steps: steps < 0))
    largest = max(map(abs, extremes(time))) if len(time) else 0.0
    slack = UNEVEN * step + 4 * np.finfo(np.float64).eps * largest
    early = steps_where(time, lambda steps: (steps >= 0) & (steps < step - slack))
    if len(early):
        first = int(early[0])
        raise AtSample(
            first + 1,
            f"only {time[first + 1] - time[first]:.6g} s after the previous sample, but a "
            f"model with memory needs even steps of {step:.6g} s",
            f"resample the recording to even steps of {step:.6g} s",
        )
    breaks = steps_where(time, lambda steps: (steps > step + slack) | (steps < 0))
    return cut_after(len(time), breaks)


def time_step(curves: Sequence[Curve]) -> float:
    """Return the time between samples in s, which is the median over all curves. It is rounded to
    twelve digits, because the difference of two stamps contains their rounding errors.

    Raises DataError if a curve has another time step. A model with memory counts delays in samples,
    so that all recordings must have the same time step.
    """
    steps = {curve.id: typical_step(curve.columns["time"]) for curve in curves if curve.size > 1}
    usual = float(np.median(list(steps.values()))) if steps else float("nan")
    for name, step in steps.items():
        if not abs(step - usual) <= UNEVEN * usual:
            raise DataError(
                f"{name}: its samples are {step:.6g} s apart, but those of other recordings are "
                f"{usual:.6g} s apart",
                "resample all recordings to the same time step with `resample`",
            )
    if not usual > 0:
        raise DataError(
            "the time step is unknown, but a model with memory needs samples in the order of time",
            "add the column of time stamps to `columns`, as `time`",
        )
    return float(f"{usual:.12g}")


def sampled(
    curves: Sequence[Curve], ordered: bool = False
) -> tuple[float, bool, tuple[Record, ...]]:
    """Return three values: the time between samples in s, True if the time steps are uneven, and
    the recordings cut into uninterrupted pieces.

    Time steps may be uneven if the model depends only on the order of the samples (`ordered`). The
    returned time is then the median step, and pieces end only at steps backwards in time. Raises
    DataError if steps are uneven although the model needs even ones.
    """
    try:
        step = time_step(curves)
        return step, False, records_of(curves, step)
    except DataError:
        typical = [typical_step(curve.columns["time"]) for curve in curves if curve.size > 1]
        if not (ordered and typical and np.median(typical) > 0):
            raise
    return float(np.median(typical)), True, records_of(curves, math.inf)


def begun(curve: Curve, lag: int, step: float) -> Curve:
    """Shorten every uninterrupted piece of a curve at its beginning, until it begins with `lag`
    consecutive samples that are not held out. A free run starts from these samples. A piece without
    such samples is not cut, and a piece without training samples is left out.

    Raises AtSample like `uninterrupted`.
    """
    kept = []
    for log in curve.logs:
        for piece in uninterrupted(curve.columns["time"][log], step):
            rows = log[piece]
            known = np.convolve(~curve.held_out[rows], np.ones(lag), "valid") == lag
            first = np.argmax(known) if curve.training[rows].any() else rows.size
            kept.append(rows[first:])
    return curve.at(np.sort(np.concatenate(kept)))


def records_of(curves: Sequence[Curve], step: float) -> tuple[Record, ...]:
    """Return the recordings of all curves cut into uninterrupted pieces. Held-out samples and
    samples at rest are not training samples.

    Raises DataError if the time steps are not equal.
    """
    records: list[Record] = []
    for curve in curves:
        for name, rows in zip(curve.recordings, curve.stretches, strict=True):
            columns = columns_at(curve.columns, rows)
            time, training = columns["time"], curve.training[rows]
            try:
                parts = uninterrupted(time, step)
            except AtSample as error:
                raise DataError(
                    f"{name}: sample {error.sample} (at {time[error.sample]:.9g} s): {error.fault}",
                    f"add `resample: {step:.6g} s` to `data`, and `gaps: "
                    f"{{longer_than: ..., action: split}}` if recordings are interrupted",
                ) from error
            records += [Record(columns_at(columns, part), training[part]) for part in parts]
    return tuple(records)
