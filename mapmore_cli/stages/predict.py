"""Predictions for a table of any length, row for row; every byte of the table is kept as it is."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.models import Model, Signal
from mapmore_cli.modelling.model import outside_range, predict
from mapmore_cli.modelling.signals.following import with_signals
from mapmore_cli.stages.prediction.records import Row, fields_of, records, values_of
from mapmore_cli.stages.prediction.stretches import recordings, stretches
from mapmore_cli.storage.readers.table import TableRequest, locate_columns

CHUNK = 20_000
"""Rows in memory at a time, where rows know nothing of each other."""

FLAG = "outside_range"


@dataclass(frozen=True)
class Reading:
    """What is read of a table to predict from: the columns, and the signals that follow from them over time."""

    columns: tuple[str, ...]
    signals: tuple[Signal, ...]


def predicted_lines(model: Model, lines: Iterable[str], label: str, chunk: int = CHUNK) -> Iterator[str]:
    """Yield the lines of a CSV table with `<output>_predicted` and `outside_range` added to each.

    The header holds canonical names; the numbers are in the model's units. The prediction has 12 significant digits; `outside_range` is
    `true` or `false`. Both are empty where an input is empty or not finite. Blank lines stay as they are. `label` names the table in
    messages; `chunk` has no influence on the result.

    Rates and directions that the table lacks follow from its `time`, recording by recording: one ends where the column `recording`
    changes or time is set back, and after a gap all starts anew; what is too short for a rate has no prediction. Memory then holds one
    recording.

    Raises
    ------
    DataError
        Where the table is empty, lacks an input, already has one of the added columns, or has a field that is not a number.
    """
    rows = records(lines, label)
    header = next(rows, None)
    if header is None:
        raise DataError(f"{label}: the table is empty", f"its first line has to name {_named(model)}")
    names = [cell.strip() for cell in header.cells]
    reading = _reading(model, names)
    places = locate_columns(TableRequest(label, reading.columns, header=True), names, len(names))
    added = (f"{model.output.name}_predicted", FLAG)
    for name in added:
        if name in names:
            raise DataError(f"{label}: already has a column {name}", "rename or remove it")
    yield f"{header.text},{','.join(added)}{header.end}"
    for block in recordings(rows, names) if reading.signals else _chunks(rows, chunk):
        fields = [fields_of(row, len(names), label) for row in block]
        columns = {name: values_of(block, fields, places[name], name, label) for name in reading.columns}
        for row, cells, added_cells in zip(block, fields, _added_cells(model, reading, columns), strict=True):
            yield row.text + row.end if cells is None else f"{row.text},{added_cells}{row.end}"


def _chunks(rows: Iterator[Row], size: int) -> Iterator[list[Row]]:
    while block := list(islice(rows, size)):
        yield block


def _reading(model: Model, names: Sequence[str]) -> Reading:
    """Every input by its own column, else by the signal that it is; time where there are signals."""
    inputs = [quantity.name for quantity in model.inputs]
    signals = tuple(signal for signal in model.signals if signal.name not in names)
    if not signals:
        return Reading(tuple(inputs), ())
    derived = {signal.name for signal in signals}
    read = dict.fromkeys(["time", *inputs, *(signal.of for signal in signals)])
    return Reading(tuple(name for name in read if name not in derived), signals)


def _named(model: Model) -> str:
    return ", ".join(f"{quantity.name} [{quantity.unit}]" for quantity in model.inputs)


def _added_cells(model: Model, reading: Reading, columns: dict[str, Array]) -> list[str]:
    """The two new fields of every row of a block."""
    complete = np.logical_and.reduce([np.isfinite(x) for x in columns.values()])
    added = [","] * complete.size
    if not complete.any():
        return added
    known = {name: x[complete] for name, x in columns.items()}
    y, outside = _evaluated(model, reading, known)
    for i, value, flag in zip(np.flatnonzero(complete), y, outside, strict=True):
        added[i] = f"{'' if math.isnan(value) else format(value, '.12g')},{'true' if flag else 'false'}"
    return added


def _evaluated(model: Model, reading: Reading, columns: dict[str, Array]) -> tuple[Array, BoolArray]:
    """Prediction and flag of complete rows, (n,) each; those of a recording stretch by stretch where signals follow from others."""
    parts = stretches(columns["time"]) if reading.signals else [slice(None)]
    found = []
    for part in parts:
        stretch = {name: x[part] for name, x in columns.items()}
        try:
            inputs = with_signals(reading.signals, stretch)
        except DataError:  # too few samples for the window of a rate
            found.append((np.full(len(stretch["time"]), np.nan), np.zeros(len(stretch["time"]), dtype=bool)))
            continue
        with np.errstate(all="ignore"):  # far outside of the range a term may overflow; the flag says so
            found.append((predict(model, inputs), outside_range(model, inputs)))
    return np.concatenate([y for y, _ in found]), np.concatenate([flag for _, flag in found])
