"""The shift of a second log whose clock nobody read: found where the data tell it, refused where they do not."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.signals.shift import Shift, find_shift
from mapmore_cli.spec.sections.logs import Join
from mapmore_cli.spec.units import convert
from mapmore_cli.stages.ingestion.samples import Samples

BY_HAND = "or write the shift, as `shift: -40.2 s`"


def found_shift(first: Samples, second: Samples, join: Join, units: Mapping[str, str]) -> tuple[float, str]:
    """The shift in the model's unit of time, and a note that says how sure it is.

    Two records of one unit are taken to rise together; of different units, one may fall while the other rises.

    Raises
    ------
    DataError
        Where nothing changes, where noise would do as well, and where another shift is nearly as good.
    """
    match = join.match
    assert match is not None
    time, values = _in_order(first, match.first)
    within = None if match.within is None else convert(match.within, "s", units["time"])
    same_sign = units[match.first] == units[match.second]
    found = find_shift(time, values, second.columns["time"], second.columns[match.second], within, same_sign=same_sign)
    pair = f"{match.second} of {second.label} and {match.first} of {first.label}"
    if found is None:
        raise DataError(
            f"no shift can be found from {pair}: nothing changes in one of them", f"name other quantities in `match`, {BY_HAND}"
        )
    _refuse_unsure(found, pair, units["time"])
    lag = "" if same_sign else f"; where {match.second} lags behind {match.first} by nature, that is part of it"
    next_best = "no other shift comes near" if math.isinf(found.ratio) else f"{found.ratio:.2f} times that of the next best shift"
    return found.value, (
        f"{second.label}: shift {_digits(found)} ± {found.half_width:.2g} {units['time']}, found from {match.second} and {match.first} "
        f"(correlation of their changes {found.correlation:.3f}, {next_best}){lag}"
    )


def _refuse_unsure(found: Shift, pair: str, unit: str) -> None:
    best = f"{_digits(found)} {unit} (correlation of their changes {found.correlation:.3f})"
    if found.lost_in_noise:
        raise DataError(
            f"no shift can be found from {pair}: the best, {best}, is no better than noise", f"name other quantities in `match`, {BY_HAND}"
        )
    if found.ambiguous:
        assert found.rival is not None
        raise DataError(
            f"the shift is ambiguous by {pair}: {found.rival:.6g} {unit} ({found.next_best:.3f}) is nearly as good as {best}",
            f"say in `match` within which time the shift lies, as `within: {_within(found):.3g} {unit}`, name other quantities, {BY_HAND}",
        )


def _digits(found: Shift) -> str:
    """The shift with one digit more than is sure."""
    return f"{found.value:.{max(0, 1 - math.floor(math.log10(found.half_width)))}f}"


def _within(found: Shift) -> float:
    """Half of the way from the best shift to the next one, beyond the best: an example that leaves one of them."""
    assert found.rival is not None
    return (abs(found.value) + abs(found.rival)) / 2


def _in_order(samples: Samples, name: str) -> tuple[Array, Array]:
    """Stamps and values of the first log, without missing ones; of stamps that repeat the first."""
    time, values = samples.columns["time"], samples.columns[name]
    there = np.flatnonzero(np.isfinite(time) & np.isfinite(values))
    time, values = time[there], values[there]
    steps = np.diff(time)
    if (steps < 0).any():
        at = int(np.argmax(steps < 0)) + 1
        raise DataError(
            f"{samples.at(int(there[at]))}: time runs backwards, so that no shift of a second log can be found",
            "sort the file by time, cut it where the clock was set back, or write the shift itself, as `shift: -40.2 s`",
        )
    new = np.concatenate([[True], steps > 0]) if len(time) else np.zeros(0, dtype=np.bool_)
    return time[new], values[new]
