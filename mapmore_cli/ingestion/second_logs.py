"""Join the logs of a second logger to recordings: add their quantities, either interpolated at the
times of the samples, or row by row.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.ingestion.clock import in_time_order, without_glitches
from mapmore_cli.ingestion.files import Log, Meter, Source
from mapmore_cli.ingestion.reading import read_tables
from mapmore_cli.ingestion.samples import Samples, without_missing
from mapmore_cli.modelling.signals import sampling
from mapmore_cli.modelling.signals.shift import find_shift
from mapmore_cli.study.sections.data import Data
from mapmore_cli.study.sections.logs import Join
from mapmore_cli.study.units import convert


def with_joined(
    tables: Sequence[Samples], source: Source, data: Data, units: Mapping[str, str], meter: Meter
) -> list[Samples]:
    """Return the recordings of a file, with the quantities of all joined logs added. A value is NaN
    if the joined log has no value for the time of the sample.

    Raises DataError for a joined log that has another number of recordings or rows, or that covers
    another time.
    """
    recordings = list(tables)
    for join, log in zip(data.join, source.joined, strict=True):
        others = _read(log, join, data, units, meter)
        if len(others) not in (1, len(recordings)):
            message = (
                f"{log.name}: contains {len(others)} recordings, but {source.name} contains "
                f"{len(recordings)}"
            )
            raise DataError(
                message,
                "Join a file with as many recordings, or a file with a single recording, which is "
                "then joined to all of them.",
            )
        pairs = zip(
            recordings, others if len(others) > 1 else others * len(recordings), strict=True
        )
        both = _by_row if join.on == "row" else _by_time
        recordings = [
            replace(both(first, second, join, units), doubts=(*first.doubts, *second.doubts))
            for first, second in pairs
        ]
    return recordings


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
        message = f"{second.label}: has {second.size} rows, but {first.label} has {first.size}"
        raise DataError(
            message,
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
    """Find the shift between the clocks of two logs by comparing the two quantities in
    `join.match`. Return the shift in the model's unit of time, and a note on its uncertainty.

    If both quantities have the same unit, both must rise at the same time. If their units differ,
    one may also fall while the other rises.

    Raises DataError if one of the quantities never changes or has too few values, if the logs
    overlap at no shift, if noise alone could give the same result, or if another shift is nearly as
    good.
    """
    match = join.match
    assert match is not None
    time, values = _ordered_signal(first, match.first)
    same_sign = units[match.first] == units[match.second]
    shift = find_shift(
        time,
        values,
        second.columns["time"],
        second.columns[match.second],
        same_sign=same_sign,
    )
    pair = f"{match.second} of {second.label} and {match.first} of {first.label}"
    others = "name other quantities in `match`, or give the shift, for example `shift: -40.2 s`"
    if shift is None:
        raise DataError(
            f"no shift can be found from {pair}, because one of them never changes", others
        )
    # the shift is printed with one decimal more than its uncertainty justifies
    value = f"{shift.value:.{max(0, 1 - math.floor(math.log10(shift.half_width)))}f}"
    best = f"{value} {units['time']} (correlation of their changes {shift.correlation:.3f})"
    if shift.lost_in_noise:
        raise DataError(
            f"no shift can be found from {pair}: the best candidate, {best}, is no better "
            "than noise",
            others,
        )
    if shift.ambiguous:
        assert shift.rival is not None
        raise DataError(
            f"the shift cannot be determined from {pair}: a shift of {shift.rival:.6g} "
            f"{units['time']} (correlation {shift.next_best:.3f}) fits nearly as well as {best}",
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
        if math.isinf(shift.ratio)
        else f"{shift.ratio:.2f} times that of the next best shift"
    )
    return shift.value, (
        f"{second.label}: shift {value} ± {shift.half_width:.2g} {units['time']}, found from "
        f"{match.second} and {match.first} "
        f"(correlation of their changes {shift.correlation:.3f}, {next_best}){lag}"
    )


def _ordered_signal(samples: Samples, name: str) -> tuple[Array, Array]:
    """Return the time stamps and the values of the quantity `name`, (n,) each, without missing
    values. Of several samples with the same stamp, only the first is returned. Raises DataError if
    time runs backwards.
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
