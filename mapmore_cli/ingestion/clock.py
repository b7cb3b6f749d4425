"""Treat time stamps: resets, repeated stamps, gaps, equal time steps and second logs. Faults are
reported, and corrected only as the spec says.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import Array, row_numbers
from mapmore_cli.domain.errors import DataError
from mapmore_cli.ingestion.files import Log, Meter, Source
from mapmore_cli.ingestion.samples import TURNS, Samples, going_on, read_tables, without_missing
from mapmore_cli.modelling.signals import sampling
from mapmore_cli.modelling.signals.shift import find_shift
from mapmore_cli.study.sections.data import Data
from mapmore_cli.study.sections.logs import Join
from mapmore_cli.study.units import convert

REPEATS = "time stamps repeat"
# glitches are removed only up to this share of the samples; otherwise the clock was set back
MOST_GLITCHES = 0.01
# without `gaps` in the spec, a gap longer than this multiple of the usual step gets a warning
CONSPICUOUS = 10

MOST_SAMPLES, MOST_TIMES = 10_000_000, 100
"""Largest number of samples of a resampled recording, and its largest ratio to the measured number.
Beyond both, a mistyped step would fill the memory.
"""


def clocked(samples: Samples, data: Data, units: Mapping[str, str]) -> list[Samples]:
    """Return the samples in the order of time, cut at gaps and where the clock was set back, and
    resampled to equal steps, as the spec says.

    A piece that is shorter than a time step of `resample` has no samples. Raises DataError for
    faults that the spec does not allow to be corrected.
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
    found = [piece for run in ordered for piece in _at_gaps(run, data, unit)]
    if data.resample is not None:
        step = convert(data.resample, "s", unit)
        found = [_resampled(piece, step) for piece in found]
    return found


SHORT_TURNS = (1.0, 60.0)
"""Times at which columns of milliseconds and of seconds restart, s."""


def without_glitches(samples: Samples, rule: str) -> Samples:
    """Remove the smallest number of samples so that the stamps never decrease, if the spec says
    `drop`; if too many would have to be removed, remove none.
    """
    time = samples.columns["time"]
    if rule != "drop" or not len(sampling.find_resets(time)):
        return samples
    kept = sampling.longest_ascent(time)
    return samples.keep(kept, "glitch of the clock") if np.mean(~kept) <= MOST_GLITCHES else samples


def in_time_order(samples: Samples, repeated: str, unit: str) -> Samples:
    """Refuse time that runs backwards, and treat repeated stamps as the spec says."""
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
        what = (
            f"{samples.at(at)}: the time {time[at]:.9g} occurs twice ({len(repeats)} "
            "repeated time stamps in all)"
        )
        raise DataError(
            what,
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
    found = (
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
                    f"{found}; set `data.gaps` to split the recording there, or to accept the gap",
                ),
            )
        ]
    if data.gaps.action == "error":
        raise DataError(
            found,
            "`data.gaps` has `action: error`: write `gaps: "
            "{longer_than: ..., action: split}` to make a recording of each piece, or "
            "raise `longer_than`.",
        )
    return replace(samples, notes=(*samples.notes, f"{found}: split")).cut(
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


# Second logs
# --------------------------------------------------------------------------------------------------


def with_joined(
    tables: Sequence[Samples], source: Source, data: Data, units: Mapping[str, str], meter: Meter
) -> list[Samples]:
    """Return the recordings of a file with the quantities of the logs that are joined to it; NaN at
    samples for which a log has no value.

    Raises DataError for logs that do not fit: another number of recordings or rows.
    """
    found = list(tables)
    for join, log in zip(data.join, source.joined, strict=True):
        others = _read(log, join, data, units, meter)
        if len(others) not in (1, len(found)):
            what = (
                f"{log.name}: contains {len(others)} recordings, but {source.name} contains "
                f"{len(found)}"
            )
            raise DataError(
                what,
                "Join a file with as many recordings, or a file with a single recording, which is "
                "then joined to all of them.",
            )
        pairs = zip(found, others if len(others) > 1 else others * len(found), strict=True)
        both = _by_row if join.on == "row" else _by_time
        found = [
            replace(both(first, second, join, units), doubts=(*first.doubts, *second.doubts))
            for first, second in pairs
        ]
    return found


def _read(
    log: Log, join: Join, data: Data, units: Mapping[str, str], meter: Meter
) -> list[Samples]:
    tables = read_tables(log, join, data, units, meter)
    if join.on == "row":
        return tables
    whole = [
        without_glitches(without_missing(samples, join, data.missing), data.glitches)
        for samples in tables
    ]
    return [in_time_order(samples, data.repeated_time, units["time"]) for samples in whole]


def _by_row(first: Samples, second: Samples, join: Join, _units: Mapping[str, str]) -> Samples:
    if first.size != second.size:
        what = f"{second.label}: has {second.size} rows, but {first.label} has {first.size}"
        raise DataError(
            what,
            "`on: row` can pair the rows only if both logs have the same number of rows; if both "
            "logs have a clock, remove `on: row`, and give the `shift` between the clocks.",
        )
    return first.with_columns({name: second.columns[name] for name in join.quantities})


def _by_time(first: Samples, second: Samples, join: Join, units: Mapping[str, str]) -> Samples:
    shift, note = (
        (convert(join.shift, "s", units["time"]), "")
        if join.shift != "auto"
        else _found_shift(first, second, join, units)
    )
    max_gap = None if join.max_gap is None else convert(join.max_gap, "s", units["time"])
    stamps, time = first.columns["time"], second.columns["time"] + shift
    columns = {
        name: sampling.align(stamps, time, second.columns[name], max_gap)
        for name in join.quantities
    }
    if np.isnan(columns[join.quantities[0]]).all():
        raise DataError(
            f"{second.label}: has no sample at the times of {first.label}. With its shift, it "
            f"covers {time[0]:g} to {time[-1]:g} {units['time']}; the first log covers "
            f"{np.nanmin(stamps):g} to {np.nanmax(stamps):g}",
            "Correct `shift`, which is added to the time of the second log, or increase `max_gap`.",
        )
    return replace(first.with_columns(columns), notes=(*first.notes, *([note] if note else [])))


def _found_shift(
    first: Samples, second: Samples, join: Join, units: Mapping[str, str]
) -> tuple[float, str]:
    """Return the shift in the model's unit of time, and a note on its uncertainty.

    Two records with the same unit must rise together. With different units, one may fall while the
    other rises.

    Raises DataError if nothing changes in a record, if noise alone could give the same result, or
    if another shift is nearly as good.
    """
    match = join.match
    assert match is not None
    time, values = _ordered_signal(first, match.first)
    same_sign = units[match.first] == units[match.second]
    found = find_shift(
        time,
        values,
        second.columns["time"],
        second.columns[match.second],
        same_sign=same_sign,
    )
    pair = f"{match.second} of {second.label} and {match.first} of {first.label}"
    others = "name other quantities in `match`, or give the shift, for example `shift: -40.2 s`"
    if found is None:
        raise DataError(
            f"no shift can be found from {pair}, because one of them never changes", others
        )
    # the number is shown with one digit more than is certain
    value = f"{found.value:.{max(0, 1 - math.floor(math.log10(found.half_width)))}f}"
    best = f"{value} {units['time']} (correlation of their changes {found.correlation:.3f})"
    if found.lost_in_noise:
        raise DataError(
            f"no shift can be found from {pair}: the best candidate, {best}, is no better "
            "than noise",
            others,
        )
    if found.ambiguous:
        assert found.rival is not None
        raise DataError(
            f"the shift cannot be determined from {pair}: a shift of {found.rival:.6g} "
            f"{units['time']} (correlation {found.next_best:.3f}) fits nearly as well as {best}",
            others,
        )
    lag = (
        ""
        if same_sign
        else (
            f"; if {match.second} physically lags behind {match.first}, the shift includes this lag"
        )
    )
    next_best = (
        "no other shift fits nearly as well"
        if math.isinf(found.ratio)
        else f"{found.ratio:.2f} times that of the next best shift"
    )
    return found.value, (
        f"{second.label}: shift {value} ± {found.half_width:.2g} {units['time']}, found from "
        f"{match.second} and {match.first} "
        f"(correlation of their changes {found.correlation:.3f}, {next_best}){lag}"
    )


def _ordered_signal(samples: Samples, name: str) -> tuple[Array, Array]:
    """Return the time stamps and the values of the first log, without missing values. Of several
    samples with the same stamp, only the first is returned.
    """
    time, values = samples.columns["time"], samples.columns[name]
    there = np.flatnonzero(np.isfinite(time) & np.isfinite(values))
    time, values = time[there], values[there]
    steps = np.diff(time)
    if (steps < 0).any():
        at = int(np.argmax(steps < 0)) + 1
        raise DataError(
            f"{samples.at(int(there[at]))}: time runs backwards, so that no shift of a "
            "second log can be found",
            "sort the file by time, cut it where the clock was set back, or give the shift "
            "itself, for example `shift: -40.2 s`",
        )
    new = np.concatenate([[True], steps > 0]) if len(time) else np.zeros(0, dtype=np.bool_)
    return time[new], values[new]
