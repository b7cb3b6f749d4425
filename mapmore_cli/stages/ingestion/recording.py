"""From one file to a recording: samples in the model's units, with everything that was left out counted."""

from __future__ import annotations

import graphlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Recording
from mapmore_cli.modelling import terms
from mapmore_cli.modelling.signals.rates import rate
from mapmore_cli.modelling.signals.stamps import average_repeated, spread_repeated
from mapmore_cli.spec.models import Data, Keep, Rate
from mapmore_cli.spec.units import convert
from mapmore_cli.stages.ingestion.files import Source
from mapmore_cli.storage.readers import READERS, TableRequest


@dataclass(frozen=True)
class Samples:
    """Samples on their way from the file: quantities `(n,)` by name, their rows in the file, and counts of those left out."""

    label: str
    columns: Mapping[str, Array]
    rows: IntArray
    dropped: Mapping[str, int]

    def keep(self, mask: BoolArray, reason: str) -> Samples:
        """Return the samples where `mask`, the others counted under `reason`."""
        left_out = len(mask) - int(mask.sum())
        if not left_out:
            return self
        dropped = {**self.dropped, reason: self.dropped.get(reason, 0) + left_out}
        return Samples(self.label, {name: values[mask] for name, values in self.columns.items()}, self.rows[mask], dropped)

    def with_columns(self, columns: Mapping[str, Array]) -> Samples:
        """Return the samples with quantities added or replaced."""
        return replace(self, columns={**self.columns, **columns})


def read_recording(source: Source, data: Data, units: Mapping[str, str]) -> Recording:
    """Read a file and bring it into the model's `units`.

    In this order: missing values, scale and offset, constants, time stamps, derived quantities, conditions to keep samples.
    Raises DataError naming file, row and column.
    """
    table = READERS[data.reader](source.path, _request(source, data))
    raw = Samples(source.name, {name: table.columns[column.column] for name, column in data.columns.items()}, table.rows, {})
    samples = _some(_without_missing(raw, data))
    samples = samples.with_columns(_in_model_units(samples.columns, data, units))
    samples = samples.with_columns({name: np.full(len(samples.rows), value) for name, value in source.constants.items()})
    samples = _in_time_order(samples, data.repeated_time)
    samples = _derived(samples, data.derive, units)
    for condition in data.keep:
        samples = _kept(samples, condition, units)
    samples = _some(samples)
    return Recording(source.id, source.name, samples.columns, len(table.rows), samples.dropped)


@contextmanager
def located(label: str) -> Iterator[None]:
    """Put the file's name before the message of a DataError from within."""
    try:
        yield
    except DataError as error:
        raise DataError(f"{label}: {error.message}", error.remedy) from error


def _some(samples: Samples) -> Samples:
    """Refuse a recording of which nothing is left."""
    if not len(samples.rows):
        reasons = "; ".join(f"{count}: {reason}" for reason, count in samples.dropped.items())
        raise DataError(f"{samples.label}: no sample is left ({reasons})", "Loosen `keep` or `missing`, or leave the file out.")
    return samples


def _request(source: Source, data: Data) -> TableRequest:
    return TableRequest(source.name, tuple(dict.fromkeys(column.column for column in data.columns.values())), data.header)


def _without_missing(samples: Samples, data: Data) -> Samples:
    """Treat NaN and infinity as the spec says: an error, or samples to leave out."""
    finite = {name: np.isfinite(values) for name, values in samples.columns.items()}
    complete = np.logical_and.reduce(list(finite.values()))
    if data.missing == "error" and not complete.all():
        row = int(np.argmin(complete))
        name = next(name for name, mask in finite.items() if not mask[row])
        raise DataError(
            f"{samples.label}:row {samples.rows[row]}, column {data.columns[name].column}: the value of {name} is missing",
            f"Set `missing: drop` to leave out such samples ({np.count_nonzero(~complete)} of {len(complete)} in this file).",
        )
    return samples.keep(complete, "missing value")


def _in_model_units(raw: Mapping[str, Array], data: Data, units: Mapping[str, str]) -> dict[str, Array]:
    """Return `value * scale + offset`, converted from the column's unit to the model's."""
    columns = {}
    for name, column in data.columns.items():
        values = raw[name] * column.scale + column.offset
        columns[name] = values if column.unit is None else convert(values, column.unit, units[name])
    return columns


def _in_time_order(samples: Samples, repeated: str) -> Samples:
    """Refuse time that runs backwards, and treat stamps that repeat as the spec says."""
    time = samples.columns.get("time")
    if time is None:
        return samples
    steps = np.diff(time)
    if (steps < 0).any():
        at = int(np.argmax(steps < 0)) + 1
        raise DataError(
            f"{samples.label}:row {samples.rows[at]}: time runs backwards, from {time[at - 1]:.9g} to {time[at]:.9g}",
            "Sort the file by time, or split it where the clock was set back.",
        )
    if (steps > 0).all():
        return samples
    if repeated == "error":
        at = int(np.argmax(steps == 0)) + 1
        raise DataError(
            f"{samples.label}:row {samples.rows[at]}: the time {time[at]:.9g} stands twice ({np.count_nonzero(steps == 0)} stamps repeat)",
            "Set `repeated_time: average` or `repeated_time: spread`.",
        )
    if repeated == "spread":
        return samples.with_columns({"time": spread_repeated(time)})
    first = np.concatenate([[True], steps > 0])
    _, averaged = average_repeated(time, samples.columns)
    return samples.keep(first, "repeated time").with_columns({**averaged, "time": time[first]})


def _derived(samples: Samples, derive: Mapping[str, str | Rate], units: Mapping[str, str]) -> Samples:
    """Add the quantities of `derive`, each after those that it depends on."""
    expressions = {name: terms.parse(rule) for name, rule in derive.items() if isinstance(rule, str)}
    needs = {name: {rule.rate_of} if isinstance(rule, Rate) else set(expressions[name].names) for name, rule in derive.items()}
    order = [name for name in graphlib.TopologicalSorter(needs).static_order() if name in derive]
    for name in order:
        rule = derive[name]
        if isinstance(rule, Rate):
            values = _rate(samples, rule, units, units[name])
        else:
            values = terms.evaluate(expressions[name], samples.columns, len(samples.rows))
        if not np.isfinite(values).all():
            at = int(np.argmin(np.isfinite(values)))
            raise DataError(f"{samples.label}:row {samples.rows[at]}: derive.{name} gives {values[at]}", "Mend the expression or the data.")
        samples = samples.with_columns({name: values})
    return samples


def _rate(samples: Samples, rule: Rate, units: Mapping[str, str], unit: str) -> Array:
    seconds = convert(samples.columns["time"], units["time"], "s")
    with located(samples.label):
        values = rate(seconds, samples.columns[rule.rate_of], rule.window, rule.order)
    return convert(values, f"{units[rule.rate_of]}/s", unit)


def _kept(samples: Samples, condition: Keep, units: Mapping[str, str]) -> Samples:
    name = condition.quantity
    values = samples.columns[name]
    unit = "" if units[name] == "1" else f" {units[name]}"
    if condition.abs_below is not None:
        return samples.keep(np.abs(values) < condition.abs_below, f"|{name}| >= {condition.abs_below:g}{unit}")
    if condition.below is not None:
        return samples.keep(values < condition.below, f"{name} >= {condition.below:g}{unit}")
    if condition.above is not None:
        return samples.keep(values > condition.above, f"{name} <= {condition.above:g}{unit}")
    low, high = condition.between or (-np.inf, np.inf)
    return samples.keep((values >= low) & (values <= high), f"{name} outside {low:g} to {high:g}{unit}")
