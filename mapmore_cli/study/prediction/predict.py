"""Predictions for a table of any length, row for row; every byte of the table is kept as it is. And a family's model for one specimen."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, IntArray
from mapmore_cli.domain.errors import DataError, UsageError
from mapmore_cli.domain.models import Formula, Model
from mapmore_cli.domain.results import Run
from mapmore_cli.modelling.inverse import solve_for_input
from mapmore_cli.modelling.kinds import outside_range, runs_over_time, simulate
from mapmore_cli.modelling.literature.family import adapted, family_of
from mapmore_cli.modelling.literature.own import is_family
from mapmore_cli.modelling.memory.records import AtSample, numbered
from mapmore_cli.modelling.program.model import slopes
from mapmore_cli.modelling.signals.rates import with_signals
from mapmore_cli.modelling.validation.intervals import checked, ends, half_widths_of, refusal
from mapmore_cli.storage.tables import TableRequest, locate_columns
from mapmore_cli.study.prediction.records import Reading, Row, fields_of, reading_of, recordings, records, stretches, values_of

CHUNK = 20_000
"""Rows in memory at a time, where rows know nothing of each other."""

FLAG = "outside_range"


@dataclass(frozen=True)
class Extra:
    """What else is wanted of every row: an interval of a `level`, and derivatives."""

    level: float | None
    derivatives: bool

    def names(self, model: Model) -> tuple[str, ...]:
        """Return the columns."""
        ends_of = () if self.level is None else (f"{model.output.name}_low", f"{model.output.name}_high")
        return (*ends_of, *(f"{model.output.name}_by_{quantity.name}" for quantity in model.inputs if self.derivatives))

    def of(self, model: Model, inputs: Columns, predicted: Array, outside: BoolArray) -> Array:
        """Their numbers, (n, m)."""
        columns = [] if self.level is None else [*ends(predicted, outside, half_widths_of(model, inputs, self.level))]
        columns += [*slopes(model, inputs).values()] if self.derivatives else []
        return np.stack(columns, axis=1) if columns else np.empty((len(predicted), 0))


def predicted_lines(
    model: Model,
    lines: Iterable[str],
    label: str,
    chunk: int = CHUNK,
    warn: Callable[[str], None] = lambda _: None,
    derivatives: bool = False,
    interval: float | None = None,
    turned_for: str | None = None,
) -> Iterator[str]:
    """Yield the lines of a CSV table with `<output>_predicted` and `outside_range` added to each.

    The header holds canonical names; the numbers are in the model's units. The prediction has 12 significant digits; `outside_range` is
    `true` or `false`. Both are empty where an input is empty or not finite. Blank lines stay as they are. `label` names the table in
    messages; `chunk` has no influence on the result.

    With `turned_for` an input, as the force of a model of the strain, the model is inverted for it: the table has the output in its place,
    the column is `<input>_predicted`, and rows without a solution in the training range are outside of it.

    With an `interval`, as 0.95, there are `<output>_low` and `<output>_high`, empty outside of the training range; with `derivatives`, one
    more column for every input, `<output>_by_<input>`, in the units of the model.

    Rates and directions that the table lacks follow from its `time`, recording by recording: one ends where the column `recording`
    changes or time is set back, and after a gap all starts anew; what is too short for a rate has no prediction. A model with memory runs
    along each recording in the same way, from the first measured outputs where it feeds its output back; there is no prediction before
    there is history, and from where the run diverges, which `warn` is told. One recording is in memory at a time.

    Raises DataError where the table is empty, lacks an input, already has one of the added columns, or has a field that is not a number;
    where a model with memory has nothing to go on from, or rows are not at its time steps; where the model holds nothing to make intervals
    from; UsageError for an interval that there is none of, or a model that cannot be inverted for that input.
    """
    if interval is not None and (why := refusal(checked(model, interval))) is not None:
        warn(f"{model.name}: {why}")
    extra = Extra(interval, derivatives)
    rows = records(lines, label)
    header = next(rows, None)
    if header is None:
        raise DataError(f"{label}: the table is empty", f"its first line has to name {_named(model)}")
    names = [cell.strip() for cell in header.cells]
    reading = reading_of(model, names) if turned_for is None else _reading_turned(model, turned_for)
    read = tuple(dict.fromkeys((*reading.columns, *reading.outputs)))
    places = locate_columns(TableRequest(label, read, header=True), names, len(names))
    added = _added_names(model, turned_for, extra, names, label)
    yield f"{header.text},{','.join(added)}{header.end}"
    predicted = beyond = 0
    for block in recordings(rows, names) if reading.over_time else _chunks(rows, chunk):
        fields = [fields_of(row, len(names), label) for row in block]
        columns = {name: values_of(block, fields, places[name], name, label) for name in read}
        cells_of, diverged = _added_cells(model, reading, columns, block, label, extra)
        for start in diverged:
            warn(f"{label}:row {block[start].line}: the free run diverges; there is no prediction until it starts anew")
        predicted += sum(not cells.startswith(",") for cells in cells_of)
        beyond += sum(cells.split(",", 2)[1] == "true" for cells in cells_of)
        for row, cells, added_cells in zip(block, fields, cells_of, strict=True):
            yield row.text + row.end if cells is None else f"{row.text},{added_cells}{row.end}"
    if predicted and beyond == predicted:
        warn(f"{label}: every row lies outside of the training range; the model expects {_named(model)}")


def _added_names(model: Model, turned_for: str | None, extra: Extra, names: Sequence[str], label: str) -> tuple[str, ...]:
    """Return the columns that are added; DataError where the table has one of them."""
    added = (f"{turned_for or model.output.name}_predicted", FLAG, *extra.names(model))
    for name in added:
        if name in names:
            raise DataError(f"{label}: already has a column {name}", "rename or remove it")
    return added


def _reading_turned(model: Model, name: str) -> Reading:
    """Return what is read where a model is inverted; UsageError where it cannot be."""
    inputs = [quantity.name for quantity in model.inputs]
    if name not in inputs:
        raise UsageError(f"--as: the model has no input '{name}'", f"it has {', '.join(inputs)}")
    if runs_over_time(model):
        raise UsageError("--as: this model has memory, and cannot be inverted", "leave --as out")
    return Reading((model.output.name, *(one for one in inputs if one != name)), turned_for=name)


def _chunks(rows: Iterator[Row], size: int) -> Iterator[list[Row]]:
    while block := list(islice(rows, size)):
        yield block


def _named(model: Model) -> str:
    reading = reading_of(model, [signal.name for signal in model.signals])
    units = {quantity.name: quantity.unit for quantity in (*model.inputs, model.output)} | {"time": "s"}
    return ", ".join(f"{name} [{units.get(name, model.output.unit)}]" for name in (*reading.columns, *reading.outputs))


def _added_cells(
    model: Model, reading: Reading, columns: dict[str, Array], block: Sequence[Row], label: str, extra: Extra
) -> tuple[list[str], tuple[int, ...]]:
    """Return the new fields of every row of a block, and the rows at which a free run diverges."""
    known = np.flatnonzero(np.logical_and.reduce([np.isfinite(columns[name]) for name in reading.columns]))
    added = ["," + "," * len(extra.names(model))] * len(block)
    if not len(known):
        return added, ()
    try:
        run, outside, more = _evaluated(model, reading, {name: x[known] for name, x in columns.items()}, known, extra)
    except AtSample as error:
        raise DataError(f"{label}:row {block[error.sample].line}: {error.fault}", error.remedy) from error
    for i, value, flag, own in zip(known, run.values, outside, more, strict=True):
        added[i] = ",".join([_digits(value), "true" if flag else "false", *map(_digits, own)])
    return added, run.diverged


def _digits(value: float) -> str:
    return format(value, ".12g") if math.isfinite(value) else ""


def _evaluated(model: Model, reading: Reading, columns: dict[str, Array], rows: IntArray, extra: Extra) -> tuple[Run, BoolArray, Array]:
    """Predictions and flags of complete rows, (n,) each, and what else is wanted, (n, m).

    Those of a recording go stretch by stretch where signals follow from others.

    `rows` are the numbers by which rows are told where a run diverges, or in a mistake.
    """
    if reading.turned_for is not None:
        found_input = solve_for_input(model, columns, reading.turned_for)
        outside = outside_range(model, {**columns, reading.turned_for: found_input.values}) | ~found_input.solved
        return Run(found_input.values), outside, np.empty((len(rows), 0))
    found, flags, diverged, more = [], [], list[int](), []
    width = len(extra.names(model))
    for part in stretches(columns["time"]) if reading.signals else [slice(None)]:
        stretch = {name: x[part] for name, x in columns.items()}
        try:
            inputs = with_signals(reading.signals, stretch)
        except DataError:  # too few samples for the window of a rate
            found.append(np.full(len(stretch["time"]), np.nan))
            flags.append(np.zeros(len(stretch["time"]), dtype=bool))
            more.append(np.full((len(stretch["time"]), width), np.nan))
            continue
        with np.errstate(all="ignore"), numbered(rows[part]):  # far outside of the range a term may overflow; the flag says so
            run = simulate(model, inputs)
            found.append(run.values)
            flags.append(outside_range(model, inputs))
            more.append(extra.of(model, inputs, run.values, flags[-1]))
        diverged += rows[part][list(run.diverged)].tolist()
    return Run(np.concatenate(found), tuple(diverged)), np.concatenate(flags), np.concatenate(more)


def adapt(model: Model, lines: Iterable[str] | None, label: str, constants: Mapping[str, float]) -> Model:
    """Return a model of pressure and strain for one specimen of the family; without `lines`, by its dimension alone.

    `lines` are those of a CSV table with pressure, strain and the output in the model's units; `constants` give what specimens differ in.
    Rows with an empty field are left out. The intervals stay those of the family, and a note says so.

    Raises UsageError for a model that is no family, or without its dimension; DataError where the table is empty or lacks a column.
    """
    of = dimension_of(model)
    assert isinstance(model.body, Formula)
    if set(constants) != {of}:
        ends = model.body.ranges[0].limits[of]
        unit = next(quantity.unit for quantity in model.inputs if quantity.name == of)
        raise UsageError(
            f"adapt needs the {of} of the specimen, and nothing else",
            f"give it as `--set {of}={sum(ends) / 2:.3g}`, in {unit}; the family goes from {ends[0]:g} to {ends[1]:g}",
        )
    names = ("pressure", "strain", model.output.name)
    columns = {name: np.empty(0) for name in names} if lines is None else _columns(lines, label, names)
    target = columns.pop(model.output.name)
    fit = adapted(model.body.fit, columns, target, constants[of])
    ranges = tuple(replace(one, limits={name: ends for name, ends in one.limits.items() if name != of}) for one in model.body.ranges)
    inputs = tuple(quantity for quantity in model.inputs if quantity.name != of)
    known = model.body.ranges[0].limits[of]
    notes = fit.notes
    if not known[0] <= constants[of] <= known[1]:
        notes = (*notes, f"{of} {constants[of]:g} lies outside of the family's {known[0]:g} to {known[1]:g}")
    if model.left_out is not None:
        notes = (*notes, f"its intervals are those of the family, by {model.left_out.curves} specimens, whatever was measured of this one")
    return replace(model, inputs=inputs, body=replace(model.body, fit=fit, ranges=ranges), notes=notes)


def dimension_of(model: Model) -> str:
    """Return what specimens of a family differ in; UsageError for a model that is no family."""
    if isinstance(model.body, Formula) and is_family(model.body.fit.definition):
        return family_of(model.body.fit.definition).settings.of
    raise UsageError(
        f"the model {model.name} is of one muscle, and adapt needs that of a family, which is learnt from several",
        "give each muscle's files what it differs in, as `set: {rest_length: 83 mm}`, and write `model: {family: {of: rest_length}}`; "
        "or fit this muscle by itself: `mapmore init` with its files",
    )


def _columns(lines: Iterable[str], label: str, wanted: tuple[str, ...]) -> dict[str, Array]:
    rows = list(records(lines, label))
    if len(rows) < 2:
        raise DataError(f"{label}: the table is empty", f"its first line has to name {', '.join(wanted)}")
    names = [cell.strip() for cell in rows[0].cells]
    places = locate_columns(TableRequest(label, wanted, header=True), names, len(names))
    fields = [fields_of(row, len(names), label) for row in rows[1:]]
    columns = {name: values_of(rows[1:], fields, places[name], name, label) for name in wanted}
    known = np.logical_and.reduce([np.isfinite(values) for values in columns.values()])
    return {name: values[known] for name, values in columns.items()}
