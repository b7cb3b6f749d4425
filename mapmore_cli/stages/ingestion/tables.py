"""From a file to samples in the model's units: values, scale and offset, missing values."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.spec.sections.table import Table
from mapmore_cli.spec.units import convert
from mapmore_cli.stages.ingestion.files import Log
from mapmore_cli.stages.ingestion.meter import Meter
from mapmore_cli.stages.ingestion.samples import Samples
from mapmore_cli.storage.readers import READERS, RawTable, TableRequest


def read_tables(log: Log, table: Table, missing: str, units: Mapping[str, str], meter: Meter) -> list[Samples]:
    """Return the samples of each recording in a file, NaN where a value is missing.

    Where `missing` is `drop`, records that break off are such values as well. Raises DataError for what cannot be read.
    """
    request = TableRequest(
        label=log.name,
        columns=tuple(dict.fromkeys(column.column for column in table.columns.values())),
        header=int(table.header),
        skip_rows=table.skip_rows,
        delimiter=table.delimiter,
        decimal=table.decimal,
        encoding=table.encoding,
        sheet=table.sheet,
        root=table.root,
        incomplete=missing == "drop",
        progress=meter.within(log),
    )
    return [_in_model_units(raw, table, units) for raw in READERS[table.reader](log.path, request)]


def _in_model_units(raw: RawTable, table: Table, units: Mapping[str, str]) -> Samples:
    """Return `value * scale + offset`, converted from the column's unit to the model's, less its mean at rest."""
    taken = slice(None, None, table.every)
    columns: dict[str, Array] = {}
    for name, column in table.columns.items():
        values = raw.columns[column.column][taken]
        if (column.scale, column.offset) != (1.0, 0.0):  # else the column itself: long recordings are not copied without need
            values = values * column.scale + column.offset
        columns[name] = values if column.unit is None else convert(values, column.unit, units[name])
    if table.sample_time is not None:
        columns["time"] = np.arange(len(raw.rows), dtype=np.float64)[taken] * convert(table.sample_time, "s", units["time"])
    for name, column in table.columns.items():
        if column.rest is not None:
            rest = _mean_at_rest(columns[name], columns["time"], convert(column.rest, "s", units["time"]))
            if rest is None:
                raise DataError(f"{raw.label}: {name} has no value in the first {column.rest:g} s", "Lengthen `rest`, or mend the file.")
            columns[name] = columns[name] - rest
    return Samples(raw.label, raw.place, raw.rows[taken], columns, {}, raw.element)


def _mean_at_rest(values: Array, time: Array, rest: float) -> float | None:
    """The mean over the first `rest` of a recording; None where there is no value in it."""
    first = next(iter(time[np.isfinite(time)]), np.nan)
    resting = np.isfinite(values) & (time - first <= rest)
    return float(values[resting].mean()) if resting.any() else None


def without_missing(samples: Samples, table: Table, missing: str) -> Samples:
    """Treat NaN and infinity as the spec says: an error, or samples to leave out. DataError where none is left."""
    finite = {name: np.isfinite(values) for name, values in samples.columns.items()}
    complete = np.logical_and.reduce(list(finite.values()))
    if missing == "error" and not complete.all():
        sample = int(np.argmin(complete))
        name = next(name for name, mask in finite.items() if not mask[sample])
        place = f", column {table.columns[name].column}" if name in table.columns else ""
        raise DataError(
            f"{samples.at(sample)}{place}: the value of {name} is missing",
            f"Set `missing: drop` to leave out such samples ({np.count_nonzero(~complete)} of {len(complete)} in this file).",
        )
    return samples.keep(complete, "missing value").some()
