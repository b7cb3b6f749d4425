"""Read a file as samples in the model's units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from math import isclose

import numpy as np

from mapmore_cli.domain.arrays import Array, by_blocks, row_numbers
from mapmore_cli.domain.errors import DataError
from mapmore_cli.ingestion.clock import TURNS, going_on
from mapmore_cli.ingestion.files import Log, Meter
from mapmore_cli.ingestion.samples import Samples
from mapmore_cli.storage.readers import READERS
from mapmore_cli.storage.tables import RawTable, TableRequest
from mapmore_cli.storage.tables.cells import shortened
from mapmore_cli.study.sections.data import Data
from mapmore_cli.study.sections.logs import Logs, SourceColumn
from mapmore_cli.study.units import convert, is_canonical, is_same, unit_of_file


def read_tables(
    log: Log, table: Logs, data: Data, units: Mapping[str, str], meter: Meter
) -> list[Samples]:
    """Return the samples of each recording in a file, with NaN for missing values.

    If `log` is a table in memory, no file is read. If the spec says that samples with missing
    values are left out, incomplete records at the end of the file are left out too. Raises
    DataError if the file cannot be read.
    """
    if log.columns:
        table = table.model_copy(update={"columns": {**table.columns, **log.columns}})
    if log.table is not None:
        return [_in_model_units(log.table, table, data, units)]
    request = TableRequest(
        label=log.name,
        columns=tuple(
            dict.fromkeys(at for column in table.columns.values() for at in column.places)
        ),
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
        thousands_of={
            column.column: column.thousands for column in table.columns.values() if column.thousands
        },
        texts={
            column.column: meter.texts.setdefault(name, {})
            for name, column in table.columns.items()
            if column.texts
        },
    )
    return [
        _in_model_units(raw, table, data, units)
        for raw in READERS[table.reader].read(log.path, request)
    ]


def _second(table: Logs, units: Mapping[str, str]) -> float:
    """Return the length of one second in the unit of the time column, for example 1000 for a column
    in ms. Return 1 if there is no time column, or if the time is spread over several columns, for
    example hours and minutes.
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
    """Return the column, (n,), with every NaN replaced by the last number above it. A NaN at the
    beginning of the column stays.
    """
    filled = np.where(np.isfinite(values), np.arange(len(values)), 0)
    return np.asarray(values[np.maximum.accumulate(filled)])


def _in_model_units(raw: RawTable, table: Logs, data: Data, units: Mapping[str, str]) -> Samples:
    """Return the samples of a table in the model's units. Each value is `value * scale + offset`,
    converted to the model's unit; if the spec gives `rest`, the mean of the column during this time
    at the beginning is subtracted. Numbers that the spec declares as missing values become NaN.
    Columns of standard deviations are converted as differences, for example without the offset
    between degC and K.
    """
    missing, deviations = data.missing_rule.numbers, [*data.uncertainty.values()]
    doubts = [*raw.doubts, *_against_the_file(raw, table, units)]
    every, second = slice(None, None, table.every), _second(table, units)
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
        values = values[every]
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
            lambda rows: table.every * row_numbers(rows) * step, range(len(raw.rows[every]))
        )
    for name, column in table.columns.items():
        if column.rest is not None:
            rest = convert(column.rest, "s", units["time"])
            mean = _mean_at_rest(columns["time"], columns[name], rest)
            if mean is None:
                raise DataError(
                    f"{raw.label}: {name} has no value in the first {column.rest:g} s",
                    "Make `rest` longer, or correct the file.",
                )
            columns[name] = by_blocks(partial(np.add, -mean), columns[name])
    return Samples(
        columns,
        raw.rows[every],
        raw.label,
        raw.place,
        raw.element,
        tuple(doubts),
        titles=raw.titles,
    )


def _mean_at_rest(time: Array, values: Array, rest: float) -> float | None:
    """Return the mean of the values, (n,), during the first `rest` of the recording, counted from
    its first time stamp. Missing values are left out. Return None if there is no value in this
    time.
    """
    since = time - next(iter(time[np.isfinite(time)]), np.nan)
    resting = values[np.isfinite(values) & (since <= rest)]
    return float(resting.mean()) if resting.size else None


def _against_the_file(raw: RawTable, table: Logs, units: Mapping[str, str]) -> Iterator[str]:
    """Compare the columns in the spec with the information that the file gives about them (units,
    scaling and time step). Yield a warning for each possible contradiction, and raise DataError for
    a certain one.

    If the spec gives a `scale`, units are not compared, because the factor may convert the unit.
    They are compared for `scale: -1`, which only changes the sign.
    """
    for name, column in table.columns.items():
        facts, label = raw.noted.get(column.column), f"{raw.label}: '{column.column}'"
        if facts is None:
            continue
        scales = "scale" in column.model_fields_set and column.scale != -1.0
        if scales and facts.is_scaled and column.scale != 1.0:
            yield (
                f"{label} is scaled by the file itself, and `scale: {column.scale:g}` scales "
                "it again; remove `scale` if only one of the two is meant"
            )
        declared = column.unit or units[name]
        free = column.unit is None and (
            name == "input" or (units[name] == "1" and not is_canonical(name))
        )
        # a quantity without a default unit, for example a command, may have any unit
        if not facts.unit.strip() or scales or free:
            continue
        unit = unit_of_file(facts.unit, declared)
        if unit is None:
            yield (
                f"{label} is in '{shortened(facts.unit)}' according to the file, but is read in "
                f"{declared}; check `unit`, because the unit of the file is unknown here"
            )
        elif not is_same(unit, declared):
            remedy = (
                f"write `unit: {unit}`, or set `scale` to the factor from the numbers to "
                f"{declared} (`scale: 1` if the unit in the file is wrong)"
            )
            says = facts.shown or f"is in {unit} according to the file"
            raise DataError(f"{label} {says}, but is read as {name} in {declared}", remedy)
    step = next((facts.step for facts in raw.noted.values() if facts.step), None)
    if (
        step
        and table.sample_time is not None
        and not isclose(step, table.sample_time, rel_tol=1e-3)
    ):
        message = (
            f"{raw.label}: the file gives one sample every {step:.9g} s, but the spec every "
            f"{table.sample_time:.9g} s"
        )
        if step != 1.0:
            raise DataError(message, f"write `sample_time: {step:.9g} s`")
        yield f"{message}, which is used, because LabVIEW writes 1 s if nobody has set a rate"


def _converted(
    values: Array, column: SourceColumn, missing: Sequence[float], unit: str, difference: bool
) -> Array:
    if missing:
        values = np.where(np.isin(values, missing), np.nan, values)
    values = values * column.scale + column.offset
    written = "s" if column.columns else column.unit
    return values if written is None else convert(values, written, unit, difference=difference)


def unwrapped(values: Array, period: float) -> Array:
    """Return the values of an encoder without jumps. The encoder starts again from zero after each
    `period`, and the result continues instead. Missing values stay missing.
    """
    found, known = values.copy(), np.isfinite(values)
    found[known] = np.unwrap(values[known], period=period)
    return found
