"""Read a file as samples in the model's units, with a record of everything that is left out."""

from __future__ import annotations

import graphlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from math import isclose

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray, by_blocks, picked, row_numbers
from mapmore_cli.domain.errors import DataError
from mapmore_cli.fitting.kinds.dictionary import signal_of
from mapmore_cli.ingestion.files import Log, Meter
from mapmore_cli.modelling import expressions as terms
from mapmore_cli.modelling.signals.rates import signal_values
from mapmore_cli.storage.readers import READERS
from mapmore_cli.storage.tables import RawTable, TableRequest
from mapmore_cli.storage.tables.cells import shortened
from mapmore_cli.study.sections.data import Data, Direction, MissingRule, Rate
from mapmore_cli.study.sections.logs import Keep, Logs, SourceColumn
from mapmore_cli.study.units import convert, is_canonical, is_same, unit_of_file

TURNS = (3600.0, 86400.0)
"""Times after which clocks restart, s. A clock that shows minutes restarts after an hour, and one
that shows the time of day at midnight.
"""

NEAR_TURN = 0.9
"""Smallest step backwards that counts as a restart, as a fraction of the time after which the clock
restarts. The step can be smaller than the whole time, because the log may have paused.
"""


@dataclass(frozen=True)
class Samples(RawTable):
    """Samples of one table, with their `columns` by quantity in the model's units.

    - `left_out`: rows of samples that were left out, by reason.
    - `merged`: the number of samples by which resampling reduced the table.
    - `notes`: findings and corrections, for the reader of the report.
    """

    left_out: Mapping[str, IntArray] = field(default_factory=dict)
    merged: int = 0
    notes: tuple[str, ...] = ()

    def keep(self, mask: BoolArray, reason: str) -> Samples:
        """Return the samples in `mask`; the others are recorded under `reason`."""
        if mask.all():
            return self
        before = self.left_out.get(reason, np.zeros(0, dtype=np.int64))
        return replace(
            self,
            columns={name: picked(x, mask) for name, x in self.columns.items()},
            rows=picked(self.rows, mask),
            left_out={**self.left_out, reason: np.concatenate([before, picked(self.rows, ~mask)])},
        )

    def some(self) -> Samples:
        """Return the samples unchanged. Raises DataError if none is left."""
        if self.size:
            return self
        losses = "; ".join(f"{len(rows)}: {reason}" for reason, rows in self.left_out.items())
        raise DataError(
            f"{self.label}: no sample is left ({losses})",
            "Loosen `keep` or `missing`, or leave the file out.",
        )

    def with_columns(self, columns: Mapping[str, Array]) -> Samples:
        """Return the samples with quantities added or replaced."""
        return replace(self, columns={**self.columns, **columns})

    def cut(self, parts: Sequence[slice]) -> list[Samples]:
        """Return the samples of each part. Samples that were left out earlier belong to the part in
        which they lie; notes belong to the first part.
        """
        owners = {
            reason: np.searchsorted([self.rows[part.start] for part in parts[1:]], rows)
            for reason, rows in self.left_out.items()
        }
        return [
            replace(
                self,
                rows=self.rows[part],
                columns={name: values[part] for name, values in self.columns.items()},
                left_out={
                    reason: rows[owners[reason] == i]
                    for reason, rows in self.left_out.items()
                    if (owners[reason] == i).any()
                },
                notes=() if i else self.notes,
                doubts=() if i else self.doubts,
            )
            for i, part in enumerate(parts)
        ]


@contextmanager
def located(label: str) -> Iterator[None]:
    """Put the file's name before the message of a DataError that is raised inside."""
    try:
        yield
    except DataError as error:
        raise DataError(f"{label}: {error.message}", error.remedy) from error


def read_tables(
    log: Log, table: Logs, data: Data, units: Mapping[str, str], meter: Meter
) -> list[Samples]:
    """Return the samples of each recording in a file, with NaN for missing values.

    A table in memory is not read. If missing values are dropped, incomplete last records are
    dropped too. Raises DataError if the file cannot be read.
    """
    if log.columns:
        table = table.model_copy(update={"columns": {**table.columns, **log.columns}})
    if log.table is not None:
        return [_in_model_units(log.table, table, data, units)]
    request = TableRequest(
        label=log.name,
        columns=tuple(dict.fromkeys(at for one in table.columns.values() for at in one.places)),
        header=int(table.header),
        skip_rows=table.skip_rows,
        delimiter=table.delimiter,
        decimal=table.decimal,
        thousands=table.thousands,
        comment=table.comment,
        hidden=table.hidden,
        encoding=table.encoding,
        sheet=log.sheet or table.sheet,
        root=table.root,
        missing=data.missing_rule.texts,
        incomplete=data.missing != "error",
        progress=meter.within(log),
        clocks=table.clocks(),
        formats=table.columns["time"].formats if "time" in table.columns else {},
        second=_second(table, units),
        table=log.table_below or table.table,
        thousands_of={one.column: one.thousands for one in table.columns.values() if one.thousands},
        texts={
            one.column: meter.texts.setdefault(name, {})
            for name, one in table.columns.items()
            if one.texts
        },
    )
    return [
        _in_model_units(raw, table, data, units)
        for raw in READERS[table.reader].read(log.path, request)
    ]


def _second(table: Logs, units: Mapping[str, str]) -> float:
    """Return the length of a second in the unit of the time column. The length is 1 if there is no
    such column, and also for a clock in several columns, which have units of their own.
    """
    clock = table.columns.get("time")
    if clock is None or clock.columns:
        return 1.0
    return convert(1.0, "s", clock.unit or units["time"])


def _sum_of_parts(raw: RawTable, clock: SourceColumn) -> Array:
    """Return the time in s, (n,), of a clock in several columns, for example hours and minutes."""
    parts = clock.units_of_parts.items()
    time: Array = np.sum([convert(raw.columns[at], unit, "s") for at, unit in parts], axis=0)
    return time


def _filled_down(values: Array) -> Array:
    """Return a column, (n,), in which every NaN has the value above it, if there is one."""
    filled = np.where(np.isfinite(values), np.arange(len(values)), 0)
    return np.asarray(values[np.maximum.accumulate(filled)])


def _in_model_units(raw: RawTable, table: Logs, data: Data, units: Mapping[str, str]) -> Samples:
    """Return `value * scale + offset` in the model's unit, minus its mean at rest; NaN for numbers
    that mean missing values. A column of standard deviations is converted as differences.
    """
    missing, deviations = data.missing_rule.numbers, [*data.uncertainty.values()]
    doubts = [*raw.doubts, *_against_the_file(raw, table, units)]
    taken, second = slice(None, None, table.every), _second(table, units)
    columns: dict[str, Array] = {}
    for name, column in table.columns.items():
        as_is = (
            not missing
            and (column.scale, column.offset) == (1.0, 0.0)
            and column.unit in (None, units[name])
            and not column.columns
        )
        values = _sum_of_parts(raw, column) if column.columns else raw.columns[column.column]
        if column.unwrap is True:
            values, known = values.copy(), np.isfinite(values)
            values[known] += going_on(values[known], (*(second * turn for turn in TURNS), 2.0**32))
        elif column.unwrap is not None:
            values = unwrapped(values, column.unwrap)
        elif column.texts == "down":
            values = _filled_down(values)
        values = values[taken]
        columns[name] = (
            values
            if as_is
            else by_blocks(
                partial(
                    _converted,
                    column=column,
                    missing=missing,
                    unit=units[name],
                    difference=name in deviations,
                ),
                values,
            )
        )
    if table.sample_time is not None:
        step = convert(table.sample_time, "s", units["time"])
        columns["time"] = by_blocks(
            lambda rows: table.every * row_numbers(rows) * step, range(len(raw.rows[taken]))
        )
    for name, column in table.columns.items():
        if column.rest is not None:
            time, values = columns["time"], columns[name]
            since = time - next(iter(time[np.isfinite(time)]), np.nan)
            resting = np.isfinite(values) & (since <= convert(column.rest, "s", units["time"]))
            if not resting.any():
                raise DataError(
                    f"{raw.label}: {name} has no value in the first {column.rest:g} s",
                    "Make `rest` longer, or correct the file.",
                )
            columns[name] = by_blocks(partial(np.add, -float(values[resting].mean())), values)
    return Samples(
        columns,
        raw.rows[taken],
        raw.label,
        raw.place,
        raw.element,
        tuple(doubts),
        titles=raw.titles,
    )


def _against_the_file(raw: RawTable, table: Logs, units: Mapping[str, str]) -> Iterator[str]:
    """Yield a warning for each column about which the spec and the file seem to disagree. Raises
    DataError if they contradict each other.

    The size of a `scale` in the spec is accepted, but its sign is examined.
    """
    for name, column in table.columns.items():
        told, what = raw.noted.get(column.column), f"{raw.label}: '{column.column}'"
        if told is None:
            continue
        scales = "scale" in column.model_fields_set and column.scale != -1.0
        if scales and told.is_scaled and column.scale != 1.0:
            yield (
                f"{what} is scaled by the file itself, and `scale: {column.scale:g}` scales "
                "it again; remove `scale` if only one of the two is meant"
            )
        declared = column.unit or units[name]
        free = column.unit is None and (
            name == "input" or (units[name] == "1" and not is_canonical(name))
        )
        # a quantity without a default unit, for example a command, may have any unit
        if not told.unit.strip() or scales or free:
            continue
        unit = unit_of_file(told.unit, declared)
        if unit is None:
            yield (
                f"{what} is in '{shortened(told.unit)}' according to the file, but is read in "
                f"{declared}; check `unit`, because the unit of the file is unknown here"
            )
        elif not is_same(unit, declared):
            remedy = (
                f"write `unit: {unit}`, or set `scale` to the factor from the numbers to "
                f"{declared} (`scale: 1` if the unit in the file is wrong)"
            )
            says = told.shown or f"is in {unit} according to the file"
            raise DataError(f"{what} {says}, but is read as {name} in {declared}", remedy)
    step = next((told.step for told in raw.noted.values() if told.step), None)
    if (
        step
        and table.sample_time is not None
        and not isclose(step, table.sample_time, rel_tol=1e-3)
    ):
        what = (
            f"{raw.label}: the file gives one sample every {step:.9g} s, but the spec every "
            f"{table.sample_time:.9g} s"
        )
        if step != 1.0:
            raise DataError(what, f"write `sample_time: {step:.9g} s`")
        yield f"{what}, which is used, because LabVIEW writes 1 s if nobody has set a rate"


def _converted(
    values: Array, column: SourceColumn, missing: Sequence[float], unit: str, difference: bool
) -> Array:
    if missing:
        values = np.where(np.isin(values, missing), np.nan, values)
    if (column.scale, column.offset) != (1.0, 0.0):
        values = values * column.scale + column.offset
    written = "s" if column.columns else column.unit
    return values if written is None else convert(values, written, unit, difference=difference)


def unwrapped(values: Array, period: float) -> Array:
    """Return the values of an encoder that restarts after a `period`, as if it continued. Missing
    values stay missing.
    """
    found, known = values.copy(), np.isfinite(values)
    found[known] = np.unwrap(values[known], period=period)
    return found


def going_on(time: Array, turns: Sequence[float]) -> Array:
    """Return the offsets, (n,), that must be added to the stamps of a clock so that it continues.
    The clock restarts after one of the times in `turns`.
    """
    before, steps = time[:-1], np.diff(time)
    added = np.sum(
        [turn * ((steps <= -NEAR_TURN * turn) & (before <= turn)) for turn in turns], axis=0
    )
    return np.concatenate([[0.0], np.cumsum(added)])[: len(time)]


def without_missing(samples: Samples, table: Logs, missing: str | MissingRule) -> Samples:
    """Treat NaN and infinity as the spec says: raise an error, or leave out the samples. Raises
    DataError if none is left.
    """
    complete = by_blocks(
        lambda *columns: np.logical_and.reduce([np.isfinite(values) for values in columns]),
        *samples.columns.values(),
    )
    if missing == "error" and not complete.all():
        sample = int(np.argmin(complete))
        name = next(
            name for name, values in samples.columns.items() if not np.isfinite(values[sample])
        )
        place = ""
        if name in table.columns:
            place = f", column {samples.titles.get(name, table.columns[name].column)}"
        raise DataError(
            f"{samples.at(sample)}{place}: the value of {name} is missing",
            f"Set `missing: drop` to leave out such samples ({np.count_nonzero(~complete)} of "
            f"{len(complete)} in this file).",
        )
    return samples.keep(complete, "missing value").some()


def recordings_apart(
    samples: Samples, data: Data, units: Mapping[str, str], texts: Mapping[str, Mapping[str, float]]
) -> list[Samples]:
    """Return the samples of each recording in a table, without missing values. Rows with the same
    value of `recordings.of` are one recording, in the order of first occurrence. Without
    `recordings.of`, the whole table is one recording. `texts` holds, for each column of texts, the
    number that stands for each text.

    Raises DataError for missing values if they are errors, and if no sample is left.
    """
    samples = without_missing(samples, data, data.missing)
    if data.recordings is None:
        return [samples]
    names = data.recordings.quantities
    values = np.column_stack([samples.columns[name] for name in names])
    kinds, first, member = np.unique(values, axis=0, return_index=True, return_inverse=True)
    spelt = {name: {number: text for text, number in texts.get(name, {}).items()} for name in names}
    parts: list[Samples] = []
    for kind in np.argsort(first):
        pairs = zip(names, kinds[kind].tolist(), strict=True)
        label = ",".join(f"{name}={spelt[name].get(x, f'{x:.15g}')}" for name, x in pairs)
        element = label if samples.element is None else f"{samples.element}:{label}"
        mask = member.ravel() == kind
        part = replace(
            samples,
            rows=picked(samples.rows, mask),
            columns={name: picked(x, mask) for name, x in samples.columns.items()},
            left_out=samples.left_out if not parts else {},
            notes=samples.notes if not parts else (),
            doubts=samples.doubts if not parts else (),
            element=element,
        )
        if data.sample_time is not None:
            step = data.every * convert(data.sample_time, "s", units["time"])
            part = part.with_columns({"time": step * np.arange(part.size, dtype=np.float64)})
        parts.append(part)
    return parts


def derived(
    samples: Samples, derive: Mapping[str, str | Rate | Direction], units: Mapping[str, str]
) -> Samples:
    """Add the quantities of `derive`. A quantity is computed after the quantities on which it
    depends. Raises DataError for a value that is not finite.
    """
    expressions = {
        name: terms.parse(rule) for name, rule in derive.items() if isinstance(rule, str)
    }
    signals = {
        name: signal_of(name, rule, units)
        for name, rule in derive.items()
        if not isinstance(rule, str)
    }
    needs = {
        name: {signals[name].of} if name in signals else set(expressions[name].names)
        for name in derive
    }
    for name in (
        name for name in graphlib.TopologicalSorter(needs).static_order() if name in derive
    ):
        if name in signals:
            with located(samples.label):
                values = signal_values(signals[name], samples.columns)
        else:
            values = _evaluated(expressions[name], samples)
        finite = by_blocks(np.isfinite, values)
        if not finite.all():
            at = int(np.argmin(finite))
            raise DataError(
                f"{samples.at(at)}: derive.{name} gives {values[at]}",
                "Correct the expression or the data.",
            )
        samples = samples.with_columns({name: values})
    return samples


def _evaluated(expression: terms.Expression, samples: Samples) -> Array:
    names = [name for name in samples.columns if name in expression.names] or list(samples.columns)[
        :1
    ]
    columns = [samples.columns[name] for name in names]
    values: Array = by_blocks(
        lambda *part: terms.evaluate(expression, dict(zip(names, part, strict=True)), len(part[0])),
        *columns,
    )
    return values


def kept(samples: Samples, conditions: Sequence[Keep], units: Mapping[str, str]) -> Samples:
    """Return the samples that fulfil all conditions. The other samples are recorded under the first
    condition that they violate.
    """
    for condition in conditions:
        name = condition.quantity
        fulfils, reason = _condition(
            condition, name, "" if units[name] == "1" else f" {units[name]}"
        )
        samples = samples.keep(by_blocks(fulfils, samples.columns[name]), reason)
    return samples


def _condition(condition: Keep, name: str, unit: str) -> tuple[Callable[[Array], BoolArray], str]:
    """Return a function that tests the condition on the values of a quantity, and the reason
    recorded for samples that fail.
    """
    if (limit := condition.abs_below) is not None:
        return lambda values: np.abs(values) < limit, f"|{name}| >= {limit:g}{unit}"
    if (limit := condition.below) is not None:
        return lambda values: values < limit, f"{name} >= {limit:g}{unit}"
    if (limit := condition.above) is not None:
        return lambda values: values > limit, f"{name} <= {limit:g}{unit}"
    if condition.outside is not None:
        low, high = condition.outside
        return (
            lambda values: (values < low) | (values > high),
            f"{name} from {low:g} to {high:g}{unit}",
        )
    low, high = condition.between or (-np.inf, np.inf)
    return (
        lambda values: (values >= low) & (values <= high),
        f"{name} outside {low:g} to {high:g}{unit}",
    )
