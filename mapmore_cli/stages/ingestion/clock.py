"""Time stamps: resets, repeated stamps, gaps, and even time steps. What is wrong is reported, and mended only as the spec says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.signals.sampling import (
    Gaps,
    average_repeated,
    find_gaps,
    find_repeats,
    find_resets,
    pieces,
    resample,
    spread_repeated,
    typical_step,
)
from mapmore_cli.spec.sections.data import Data
from mapmore_cli.spec.units import convert
from mapmore_cli.stages.ingestion.samples import Samples

CONSPICUOUS = 10  # times the usual step: a gap that is worth a warning where the spec does not say what a gap is

MOST_SAMPLES, MOST_TIMES = 10_000_000, 100
"""Samples of a resampled recording, and how many times those that were measured: beyond both, a slip of the pen would fill the memory."""


@dataclass(frozen=True)
class Clocked:
    """A log whose stamps increase within each of its `pieces`, and what was found in it."""

    pieces: tuple[Samples, ...]
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


def clocked(samples: Samples, data: Data, units: Mapping[str, str]) -> Clocked:
    """Return the samples in order of time: cut where the clock was set back and at gaps, and on even steps, as the spec says.

    A piece that is shorter than a time step of `resample` is left without samples. Raises DataError for what the spec does not mend.
    """
    if "time" not in samples.columns:
        return Clocked((samples,))
    unit = units["time"]
    split = data.gaps is not None and data.gaps.action == "split"
    runs = _cut_at_resets(samples, unit) if split else Clocked((samples,))
    ordered = [in_time_order(run, data.repeated_time) for run in runs.pieces]
    cut = [_at_gaps(run, data, unit) for run in ordered]
    found = [piece for run in cut for piece in run.pieces]
    if data.resample is not None:
        step = convert(data.resample, "s", unit)
        found = [_resampled(piece, step) for piece in found]
    notes = (*runs.notes, *(note for run in cut for note in run.notes))
    return Clocked(tuple(found), notes, tuple(warning for run in cut for warning in run.warnings))


def in_time_order(samples: Samples, repeated: str) -> Samples:
    """Refuse time that runs backwards, and treat stamps that repeat as the spec says."""
    time = samples.columns["time"]
    resets = find_resets(time)
    if len(resets):
        at = int(resets[0]) + 1
        raise DataError(
            f"{samples.at(at)}: time runs backwards, from {time[at - 1]:.9g} to {time[at]:.9g}",
            "Sort the file by time; where the clock was set back, `gaps: {longer_than: ..., action: split}` splits the recording.",
        )
    repeats = find_repeats(time)
    if not len(repeats):
        return samples
    if repeated == "error":
        at = int(repeats[0]) + 1
        raise DataError(
            f"{samples.at(at)}: the time {time[at]:.9g} stands twice ({len(repeats)} stamps repeat)",
            "Set `repeated_time: average` or `repeated_time: spread`.",
        )
    if repeated == "spread":
        return samples.with_columns({"time": spread_repeated(time)})
    first = np.concatenate([[True], np.diff(time) > 0])
    _, averaged = average_repeated(time, samples.columns)
    return samples.keep(first, "repeated time").with_columns({**averaged, "time": time[first]})


def _cut_at_resets(samples: Samples, unit: str) -> Clocked:
    time = samples.columns["time"]
    resets = find_resets(time)
    if not len(resets):
        return Clocked((samples,))
    at = int(resets[0]) + 1
    again = f", and {len(resets) - 1} times more" if len(resets) > 1 else ""
    note = f"{samples.at(at)}: the clock was set back, from {time[at - 1]:.9g} to {time[at]:.9g} {unit}{again}: split"
    return Clocked(tuple(samples.cut(pieces(samples.size, resets))), (note,))


def _at_gaps(samples: Samples, data: Data, unit: str) -> Clocked:
    time = samples.columns["time"]
    limit = CONSPICUOUS * typical_step(time) if data.gaps is None else convert(data.gaps.longer_than, "s", unit)
    gaps = find_gaps(time, limit)
    if not len(gaps):
        return Clocked((samples,))
    found = _described(samples, gaps, limit, unit)
    if data.gaps is None:
        return Clocked((samples,), warnings=(f"{found}; say in `gaps` what to do about it",))
    if data.gaps.action == "error":
        raise DataError(found, "Say `gaps: {longer_than: ..., action: split}` to make a recording of each piece, or raise `longer_than`.")
    return Clocked(tuple(samples.cut(pieces(samples.size, gaps.after))), (f"{found}: split",))


def _described(samples: Samples, gaps: Gaps, limit: float, unit: str) -> str:
    longest = int(np.argmax(gaps.lengths))
    which = "a gap" if len(gaps) == 1 else f"the first of {len(gaps)} gaps"
    return (
        f"{samples.at(int(gaps.after[0]))}: {which} longer than {limit:.4g} {unit} follows; the longest takes {gaps.lengths[longest]:.4g} "
        f"{unit}, after {samples.place} {samples.rows[gaps.after[longest]]}; about {gaps.samples_missing} samples are missing"
    )


def _resampled(samples: Samples, step: float) -> Samples:
    """Return the samples on even steps; the row of each is that of the sample which it follows."""
    time = samples.columns["time"]
    wanted = np.ptp(time) / step
    if wanted > max(MOST_SAMPLES, MOST_TIMES * samples.size):
        raise DataError(
            f"{samples.label}: `resample` would make {wanted:.3g} samples of {samples.size}",
            f"write a longer time step; {np.ptp(time) / samples.size:.3g} would keep the number of samples",
        )
    stamps, columns = resample(time, samples.columns, step)
    rows = samples.rows[(np.searchsorted(time, stamps, side="right") - 1).clip(0)]
    if len(stamps):
        return replace(samples, rows=rows, columns={**columns, "time": stamps}, merged=samples.size - len(stamps))
    return samples.keep(np.zeros(samples.size, dtype=np.bool_), "piece shorter than a step of `resample`")
