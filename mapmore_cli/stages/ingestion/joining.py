"""Second logs of the same tests, brought onto the samples of the first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.signals.alignment import align
from mapmore_cli.spec.sections.data import Data
from mapmore_cli.spec.sections.table import Join
from mapmore_cli.spec.units import convert
from mapmore_cli.stages.ingestion.clock import in_time_order
from mapmore_cli.stages.ingestion.files import Log, Source
from mapmore_cli.stages.ingestion.meter import Meter
from mapmore_cli.stages.ingestion.samples import Samples
from mapmore_cli.stages.ingestion.tables import read_tables, without_missing


def joined(tables: Sequence[Samples], source: Source, data: Data, units: Mapping[str, str], meter: Meter) -> list[Samples]:
    """Return the recordings of a file with the quantities of the logs that are joined to it, NaN where those have no value.

    Raises DataError for logs that do not fit: a different number of recordings or rows.
    """
    found = list(tables)
    for join, log in zip(data.join, source.joined, strict=True):
        others = _read(log, join, data, units, meter)
        if len(others) not in (1, len(found)):
            raise DataError(
                f"{log.name}: holds {len(others)} recordings, but {source.name} holds {len(found)}",
                "Join a file that holds as many, or one.",
            )
        pairs = zip(found, others if len(others) > 1 else others * len(found), strict=True)
        found = [_by_row(first, second, join) if join.on == "row" else _by_time(first, second, join, units) for first, second in pairs]
    return found


def _read(log: Log, join: Join, data: Data, units: Mapping[str, str], meter: Meter) -> list[Samples]:
    tables = read_tables(log, join, data.missing, units, meter)
    if join.on == "row":
        return tables
    return [in_time_order(without_missing(samples, join, data.missing), data.repeated_time) for samples in tables]


def _by_row(first: Samples, second: Samples, join: Join) -> Samples:
    if first.size != second.size:
        raise DataError(
            f"{second.label}: has {second.size} rows, but {first.label} has {first.size}", "Rows can only be paired in logs of one length."
        )
    return first.with_columns({name: second.columns[name] for name in join.quantities})


def _by_time(first: Samples, second: Samples, join: Join, units: Mapping[str, str]) -> Samples:
    shift, max_gap = (None if value is None else convert(value, "s", units["time"]) for value in (join.shift, join.max_gap))
    stamps, time = first.columns["time"], second.columns["time"] + (shift or 0.0)
    columns = {name: align(stamps, time, second.columns[name], max_gap) for name in join.quantities}
    if np.isnan(columns[join.quantities[0]]).all():
        raise DataError(
            f"{second.label}: no sample at the time of {first.label}: with its shift it runs from {time[0]:g} to {time[-1]:g} "
            f"{units['time']}, the first log from {np.nanmin(stamps):g} to {np.nanmax(stamps):g}",
            "Look at `shift`, which is added to the time of the second log, and at `max_gap`.",
        )
    return first.with_columns(columns)
