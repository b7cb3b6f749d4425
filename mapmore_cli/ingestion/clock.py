"""Treat time stamps: resets, repeated stamps, gaps and equal time steps. Faults are reported, and
corrected only as the spec says.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import Array, row_numbers
from mapmore_cli.domain.errors import DataError
from mapmore_cli.ingestion.samples import Samples
from mapmore_cli.modelling.signals import sampling
from mapmore_cli.study.sections.data import Data
from mapmore_cli.study.units import convert

REPEATS = "time stamps repeat"
# largest fraction of samples that is removed because their stamps are wrong (`glitches: drop`);
# if more samples are affected, the clock was probably set back, and all samples are kept
MOST_GLITCHES = 0.01
# without `gaps` in the spec, a gap longer than this multiple of the usual step gets a warning
CONSPICUOUS = 10

MOST_SAMPLES, MOST_TIMES = 10_000_000, 100
"""Limits for resampling: a number of samples, and a ratio of this number to the measured number of
samples. If a resampled recording exceeds both, an error is raised, because the step is probably
mistyped and the samples would fill the memory.
"""


def clocked(samples: Samples, data: Data, units: Mapping[str, str]) -> list[Samples]:
    """Return a recording as a list of pieces, each with its samples in the order of time. As the
    spec says, the recording is cut at gaps and at the points where the clock was set back, and the
    pieces are resampled to equal time steps.

    If a piece is shorter than the time step of `resample`, the resampled piece has no samples.
    Raises DataError for faults that the spec does not allow to be corrected.
    """
    if "time" not in samples.columns:
        return [samples]
    unit = units["time"]
    samples = without_glitches(samples, data.glitches)
    split = data.gaps is not None and data.gaps.action == "split"
    ordered = [
        in_time_order(run, data.repeated_time, unit)
        for run in (_cut_at_resets(samples, unit) if split else [samples])
    ]
    pieces = [piece for run in ordered for piece in _at_gaps(run, data, unit)]
    if data.resample is not None:
        step = convert(data.resample, "s", unit)
        pieces = [_resampled(piece, step) for piece in pieces]
    return pieces


TURNS = (3600.0, 86400.0)
"""Times in s after which clocks restart. A clock that shows only minutes and seconds restarts after
an hour; a clock that shows the time of day restarts at midnight.
"""

NEAR_TURN = 0.9
"""Smallest step backwards that is regarded as a restart of the clock, as a fraction of the time
after which the clock restarts. The step can be smaller than this time, because the log may have
paused at the restart.
"""

SHORT_TURNS = (1.0, 60.0)
"""Times in s after which a column of milliseconds (1 s) and a column of seconds (60 s) restart."""


def without_glitches(samples: Samples, rule: str) -> Samples:
    """Remove samples with wrong time stamps if the spec says `glitches: drop`. As few samples as
    possible are removed, so that the remaining stamps never decrease. If more than the fraction
    `MOST_GLITCHES` would have to be removed, all samples are kept.
    """
    time = samples.columns["time"]
    if rule != "drop" or not len(sampling.find_resets(time)):
        return samples
    kept = sampling.longest_ascent(time)
    return samples.keep(kept, "glitch of the clock") if np.mean(~kept) <= MOST_GLITCHES else samples


def in_time_order(samples: Samples, repeated: str, unit: str) -> Samples:
    """Treat repeated time stamps as the spec says, for example average their samples. Raises
    DataError for time that runs backwards.
    """
    time = samples.columns["time"]
    resets = sampling.find_resets(time)
    if len(resets):
        at = int(resets[0]) + 1
        turns = [convert(turn, "s", unit) for turn in (*TURNS, 2.0**32 * 1e-6, 2.0**32 * 1e-3)]
        around, short = time[at - 1 : at + 1], [convert(turn, "s", unit) for turn in SHORT_TURNS]
        turned, minute = going_on(around, turns)[1], max(going_on(around, [x])[1] for x in short)
        anew = ""
        if turned:
            anew = f"The clock restarts at {turned:.9g} {unit}: write `unwrap: true` at `time`. "
        elif minute:
            anew = (
                f"If the clock restarts at {minute:.9g} {unit}, write `unwrap: {minute:.9g}` "
                f"at `time`, converted to the unit of its column if that is not {unit}. "
            )
        raise DataError(
            f"{samples.at(at)}: time runs backwards, from {time[at - 1]:.9g} to {time[at]:.9g}",
            f"{anew}Sort the file by time. If single time stamps are wrong, `glitches: "
            "drop` leaves them out. If the clock was set back, `gaps: "
            f"{{longer_than: ..., action: split}}` splits the recording there.",
        )
    repeats = sampling.find_repeats(time)
    if not len(repeats):
        return samples
    if repeated == "error":
        at = int(repeats[0]) + 1
        message = (
            f"{samples.at(at)}: the time {time[at]:.9g} occurs twice ({len(repeats)} "
            "repeated time stamps in all)"
        )
        raise DataError(
            message,
            "Set `repeated_time: average` to use the mean of such samples, or `repeated_time: "
            "spread` to move them apart.",
        )
    if repeated == "spread":
        note = f"{samples.label}: {len(repeats)} {REPEATS}, and are spread until the next one"
        spread = samples.with_columns({"time": sampling.spread_repeated(time)})
        return replace(spread, notes=(*samples.notes, note))
    first = np.concatenate([[True], np.diff(time) > 0])
    _, averaged = sampling.average_repeated(time, samples.columns)
    return samples.keep(first, "repeated time").with_columns({**averaged, "time": time[first]})


def _cut_at_resets(samples: Samples, unit: str) -> list[Samples]:
    time = samples.columns["time"]
    resets = sampling.find_resets(time)
    if not len(resets):
        return [samples]
    at = int(resets[0]) + 1
    again = f", and {len(resets) - 1} times more" if len(resets) > 1 else ""
    note = (
        f"{samples.at(at)}: the clock was set back, from {time[at - 1]:.9g} to "
        f"{time[at]:.9g} {unit}{again}; the recording is split there"
    )
    return replace(samples, notes=(*samples.notes, note)).cut(
        sampling.cut_after(samples.size, resets)
    )


def _at_gaps(samples: Samples, data: Data, unit: str) -> list[Samples]:
    time = samples.columns["time"]
    limit = (
        CONSPICUOUS * sampling.typical_step(time)
        if data.gaps is None
        else convert(data.gaps.longer_than, "s", unit)
    )
    gaps = sampling.find_gaps(time, limit)
    if not len(gaps):
        return [samples]
    longest = int(np.argmax(gaps.lengths))
    which = "a gap" if len(gaps) == 1 else f"the first of {len(gaps)} gaps"
    gap = (
        f"{samples.at(int(gaps.after[0]))}: {which} longer than {limit:.4g} {unit} follows; "
        f"the longest lasts {gaps.lengths[longest]:.4g} {unit}, after {samples.place} "
        f"{samples.rows[gaps.after[longest]]}; about {gaps.samples_missing} samples are "
        "missing"
    )
    if data.gaps is None:
        return [
            replace(
                samples,
                doubts=(
                    *samples.doubts,
                    f"{gap}; set `data.gaps` to split the recording there, or to accept the gap",
                ),
            )
        ]
    if data.gaps.action == "error":
        raise DataError(
            gap,
            "`data.gaps` has `action: error`: write `gaps: "
            "{longer_than: ..., action: split}` to make a recording of each piece, or "
            "raise `longer_than`.",
        )
    return replace(samples, notes=(*samples.notes, f"{gap}: split")).cut(
        sampling.cut_after(samples.size, gaps.after)
    )


def _resampled(samples: Samples, step: float) -> Samples:
    """Return the samples at equal time steps. Each sample gets the row number of the measured
    sample before it.
    """
    time = samples.columns["time"]
    wanted = np.ptp(time) / step
    if wanted > max(MOST_SAMPLES, MOST_TIMES * samples.size):
        raise DataError(
            f"{samples.label}: `resample` would make {wanted:.3g} samples from {samples.size}",
            f"use a longer time step; a step of {np.ptp(time) / samples.size:.3g} would keep the "
            "number of samples",
        )
    stamps, columns = sampling.resample(time, samples.columns, step)
    follows = (np.searchsorted(time, stamps, side="right") - 1).clip(0)
    if len(stamps):
        return replace(
            samples,
            rows=row_numbers(samples.rows)[follows],
            columns={**columns, "time": stamps},
            merged=samples.size - len(stamps),
        )
    return samples.keep(
        np.zeros(samples.size, dtype=np.bool_), "piece shorter than a step of `resample`"
    )


def going_on(time: Array, turns: Sequence[float]) -> Array:
    """Return the offsets, (n,), that must be added to the stamps of a clock so that it continues
    after each restart. A restart is a step backwards of about one of the durations in `turns`, for
    example 3600 s for a clock that shows minutes and seconds.
    """
    before, steps = time[:-1], np.diff(time)
    added = np.sum(
        [turn * ((steps <= -NEAR_TURN * turn) & (before <= turn)) for turn in turns], axis=0
    )
    return np.concatenate([[0.0], np.cumsum(added)])[: len(time)]
