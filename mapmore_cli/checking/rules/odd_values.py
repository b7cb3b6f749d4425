"""Check single values: spikes of one sample, numbers in place of missing values, and pressures that
no gauge can read.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from mapmore_cli.checking.evidence import spikes
from mapmore_cli.checking.rules import Issue, Issues, Subject
from mapmore_cli.domain.arrays import WIDE, Array, IntArray, by_blocks, extremes, in_blocks
from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.recording import Recording
from mapmore_cli.study.units import convert

VACUUM = -101.4  # lowest pressure that a gauge can show, kPa, if it reads zero in the open air
# A number stands for a missing value if it occurs at least twice, in at most this fraction of the
# samples, and is this many times the range of all other values away from them.
SHARE_OF_FILLS, FAR = 0.1, 5
WITH_ROWS = ("csv", "xlsx")  # names of the readers whose files have numbered rows


def spikes_in(subject: Subject) -> Issues:
    """Find spikes: single samples far from their neighbours, caused by a dropout or a mistyped
    digit.
    """
    for name, recording, values in _columns(subject):
        # blocks are examined one by one, because a signal may behave differently later on
        blocks = enumerate(in_blocks(values, rows=WIDE))
        rows = np.concatenate([number * WIDE + spikes(x) for number, (x,) in blocks])
        limit = _vacuum(subject, name)
        rows = rows if limit is None else rows[values[rows] >= limit]
        if not rows.size:
            continue
        first, unit = int(rows[0]), subject.units[name]
        between = f"between {values[first - 1]:.6g} and {values[first + 1]:.6g} {unit}".rstrip()
        yield Issue(
            "warning",
            "spike",
            subject.source(name),
            f"{_first_of(subject, recording, rows)}: {name} is {values[first]:.6g} in "
            f"one sample only, {between}",
            "if the value is wrong, leave it out (`keep: "
            f"[{{quantity: {name}, above: ...}}]`) or empty its cell; if it stands for a "
            "missing value, write `missing: {tokens: [...]}` with the number; if it was really "
            "measured, do nothing",
            "data",
        )


def fill_values(subject: Subject) -> Issues:
    """Find numbers that a logger writes in place of missing values, for example -9999."""
    for name, recording, values in _columns(subject):
        for end in dict.fromkeys(extremes(values)):
            filled = by_blocks(partial(np.equal, end), values)
            rows = np.flatnonzero(filled)
            # zero is what a sensor reads at rest, for example before a step of the pressure
            if end == 0 or not 1 < rows.size <= SHARE_OF_FILLS * len(values):
                continue
            low, high = extremes(values[~filled])
            if 0 < FAR * (high - low) < min(abs(end - low), abs(end - high)):
                yield Issue(
                    "warning",
                    "fill-value",
                    subject.source(name),
                    f"{_first_of(subject, recording, rows)}: {name} is exactly {end:.6g}, "
                    f"and otherwise between {low:.6g} and {high:.6g} {subject.units[name]}",
                    "if the logger writes this number in place of a missing value, name it as "
                    "the file shows it, for example `missing: {tokens: [-9999]}`; if it was "
                    "really measured, do nothing",
                    "data",
                )


def below_vacuum(subject: Subject) -> Issues:
    """Find pressures below absolute zero, for example because a current loop reads 0 mA, or an
    offset is applied twice.
    """
    for name, recording, values in _columns(subject):
        if (limit := _vacuum(subject, name)) is None:
            continue
        rows = np.flatnonzero(by_blocks(partial(np.greater, limit), values))
        if rows.size:
            lowest = f"{values[rows].min():.6g} {subject.units[name]}"
            below = (
                f"below absolute zero, which is a gauge pressure of {limit:.4g} "
                f"{subject.units[name]}"
            )
            yield Issue(
                "warning",
                "below-vacuum",
                subject.source(name),
                f"{_first_of(subject, recording, rows)}: {name} is {lowest}, {below}",
                "correct `unit`, `scale` or `offset`, or leave these samples out: "
                f"`keep: [{{quantity: {name}, above: {limit:.4g}}}]`",
                "data",
            )


def _columns(subject: Subject) -> Iterator[tuple[str, Recording, Array]]:
    """Yield every column of every recording that has values, except the time: the name of the
    quantity, the recording and the values, (n,).
    """
    for name in subject.spec.data.columns:
        for recording in subject.recordings if name != "time" else ():
            values = recording.columns.get(name, np.zeros(0))
            if values.size:
                yield name, recording, values


def _vacuum(subject: Subject, name: str) -> float | None:
    """Return the gauge pressure of a vacuum, in the unit of the quantity. Return None if the
    quantity is not a pressure, according to its name or its unit.
    """
    if name != "pressure" and not name.startswith("pressure_"):
        return None
    try:
        return convert(VACUUM, "kPa", subject.units[name])
    except SpecError:
        return None


def _first_of(subject: Subject, recording: Recording, rows: IntArray) -> str:
    """Return a text with the position of the first of some samples, and the number of further
    samples. The position is the row in the file if the format has numbered rows and all rows were
    kept, and otherwise the sample's number in the recording; the time is added if it is known.
    """
    data, first = subject.spec.data, int(rows[0])
    by_rows = (
        data.reader in WITH_ROWS
        and recording.rows_kept == recording.rows_read
        and data.every == 1
        and not recording.log
    )
    place = (
        f"{recording.source}:row {data.skip_rows + int(data.header) + first + 1}"
        if by_rows
        else f"{recording.id}: sample {first + 1}"
    )
    time = recording.columns.get("time")
    at = "" if time is None else f" (time {time[first]:.6g} {subject.units['time']})"
    return place + at + (f" and {rows.size - 1} more" if rows.size > 1 else "")
