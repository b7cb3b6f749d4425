"""Predictions for a table of any length, row for row; every byte of the table is kept as it is. And
a family's model for one specimen.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, IntArray
from mapmore_cli.domain.errors import DataError, UsageError
from mapmore_cli.domain.models import Formula, Model
from mapmore_cli.domain.results import Run
from mapmore_cli.modelling.inverse import LOWEST, invert, solve_for_input
from mapmore_cli.modelling.kinds import alone, outside_range, running, runs_over_time, simulate
from mapmore_cli.modelling.literature.family import adapted, family_of
from mapmore_cli.modelling.literature.own import is_family
from mapmore_cli.modelling.memory.records import AtSample, numbered
from mapmore_cli.modelling.program.model import slopes
from mapmore_cli.modelling.signals.rates import with_signals
from mapmore_cli.modelling.validation.intervals import (
    ends,
    half_widths_of,
    interval_refusal,
    intervals_of,
)
from mapmore_cli.pipeline.records import Reading, Row, Sheet, between_gaps, by_recording, reading_of

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
        of_level = (
            () if self.level is None else (f"{model.output.name}_low", f"{model.output.name}_high")
        )
        return (
            *of_level,
            *(
                f"{model.output.name}_by_{quantity.name}"
                for quantity in model.inputs
                if self.derivatives
            ),
        )

    def of(
        self, model: Model, inputs: Columns, predicted: Array, outside: BoolArray
    ) -> Iterator[Array]:
        """Yield their numbers, (n,) each."""
        if self.level is not None:
            yield from ends(predicted, outside, half_widths_of(model, inputs, self.level))
        if self.derivatives:
            yield from slopes(model, inputs).values()


def predicted_lines(
    model: Model,
    lines: Iterable[str],
    label: str,
    chunk: int = CHUNK,
    warn: Callable[[str], None] = lambda _: None,
    derivatives: bool = False,
    interval: float | None = None,
    turned_for: str | None = None,
    constants: Mapping[str, float] | None = None,
) -> Iterator[str]:
    """Yield the lines of a CSV table with `<output>_predicted` for every output, and
    `outside_range`, added to each.

    The header holds canonical names; the numbers are in the model's units. The prediction has 12
    significant digits; `outside_range` is `true` or `false`. Both are empty where an input is empty
    or not finite. Blank lines stay as they are. `label` names the table in messages; `chunk` has no
    influence on the result.

    - `turned_for`: an input that the model is inverted for, as the force of a model of the strain:
      the table has the output in its place,
      the column is `<input>_predicted`, and rows without a solution in the training range are
      outside of it.
    - `interval`: as 0.95, adds `<output>_low` and `<output>_high`, empty outside of the training
      range.
    - `derivatives`: adds one column for every input, `<output>_by_<input>`.
    - `constants`: adds inputs that are the same in every row.

    Rates and directions that the table lacks follow from its `time`, recording by recording: one
    ends where the column `recording` changes or time is set back, and after a gap all starts anew.
    A model with memory runs along each recording in the same way, from the first measured outputs
    where it feeds its output back; there is no prediction before there is history, and from where
    the run diverges, which `warn` is told. A recording is in memory as a whole where rates follow
    from its columns, else by `chunk` rows.

    Raises DataError where the table is empty, lacks an input, already has one of the added columns,
    or has a field that is not a number; where a model with memory has nothing to go on from, or
    rows are not at its time steps; where the model holds nothing to make intervals from. Raises
    UsageError for an interval that there is none of, or a model that cannot be inverted for that
    input.
    """
    if (
        interval is not None
        and (why := interval_refusal(intervals_of(model, interval))) is not None
    ):
        warn(f"{model.name}: {why}")
    extra = Extra(interval, derivatives)
    table = Sheet(lines, label, _column_names(model), constants)
    reading = (
        reading_of(model, table.names) if turned_for is None else _reading_turned(model, turned_for)
    )
    names = [one.name for one in model.outputs] if turned_for is None else [turned_for]
    extras = [name for one in model.each for name in extra.names(one)]
    added = (*(f"{name}_predicted" for name in names), FLAG, *extras)
    places = table.places(dict.fromkeys((*reading.columns, *reading.outputs)), added)
    yield from table.extended([table.header], [",".join(added)])
    predicted = beyond = 0
    blocks: Iterator[tuple[list[Row], bool]]
    blocks = ((block, True) for block in _chunks(table.rows, chunk))
    in_parts = not reading.signals and all(map(running, model.each))
    if reading.over_time:
        blocks = by_recording(table.rows, table.names, chunk if in_parts else math.inf)
    for block, begins in blocks:
        if begins:
            runs = [
                (one, (running(one) if in_parts else None) or partial(simulate, one))
                for one in model.each
            ]
        cells, diverged = _added_cells(
            model, reading, table.values(block, places), block, label, extra, runs
        )
        for start in diverged:
            warn(
                f"{label}:row {block[start].line}: the free run diverges; there is no "
                "prediction until it starts anew"
            )
        predicted += sum(not own.startswith(",") for own in cells)
        beyond += sum(own.split(",", len(names) + 1)[len(names)] == "true" for own in cells)
        yield from table.extended(block, cells)
    if predicted and beyond == predicted:
        warn(
            f"{label}: every row lies outside of the training range; the model expects "
            f"{_column_names(model)}"
        )


def inverted_lines(
    model: Model, lines: Iterable[str], label: str, name: str, rule: str = LOWEST
) -> Iterator[str]:
    """Yield the lines of a CSV table with `<name>_found`, `<name>_solutions` and `<name>_status`
    added.

    The table has the wanted output by its name, and every input but `name`. `solutions` are all
    there are within the training range, ascending, with a space between; `found` is the one that
    the rule picks; the status is `none`, `one`, `several` or `flat`. Rows with an empty number have
    none of them. The whole table is in memory, since the rule `nearest` goes from row to row.

    Raises UsageError for an input that the model has not, a rule that there is none of, or a model
    with memory; DataError where the table is empty, lacks a column, has one of the added ones
    already, or a field that is no number.
    """
    if runs_over_time(model):
        raise UsageError(
            "this model has memory: the input for an output depends on what was before",
            "invert a static model",
        )
    needed = [
        alone(model).output.name,
        *(quantity.name for quantity in model.inputs if quantity.name != name),
    ]
    table = Sheet(lines, label, ", ".join(needed))
    added = [f"{name}_found", f"{name}_solutions", f"{name}_status"]
    places = table.places(needed, added)
    block = list(table.rows)
    columns = table.values(block, places)
    known = np.flatnonzero(
        np.logical_and.reduce([np.isfinite(values) for values in columns.values()])
    )
    cells = [",,"] * len(block)
    if len(known):
        given = {column: values[known] for column, values in columns.items()}
        inverse = invert(model, given.pop(model.output.name), given, name, rule)
        solutions = np.split(
            inverse.values, np.searchsorted(inverse.rows, np.arange(1, len(known)))
        )
        for place, picked, every, status in zip(
            known.tolist(), inverse.picked, solutions, inverse.status, strict=True
        ):
            cells[place] = ",".join([_digits(picked), " ".join(map(_digits, every)), status])
    yield from table.extended([table.header, *block], [",".join(added), *cells])


def _reading_turned(model: Model, name: str) -> Reading:
    """Return what is read where a model is inverted; UsageError where it cannot be."""
    inputs = [quantity.name for quantity in alone(model).inputs]
    if name not in inputs:
        raise UsageError(f"--as: the model has no input '{name}'", f"it has {', '.join(inputs)}")
    if runs_over_time(model):
        raise UsageError("--as: this model has memory, and cannot be inverted", "leave --as out")
    return Reading((model.output.name, *(one for one in inputs if one != name)), turned_for=name)


def _chunks(rows: Iterator[Row], size: int) -> Iterator[list[Row]]:
    while block := list(islice(rows, size)):
        yield block


def _column_names(model: Model) -> str:
    reading = reading_of(model, [signal.name for signal in model.signals])
    units = {quantity.name: quantity.unit for quantity in (*model.inputs, model.output)} | {
        "time": "s"
    }
    return ", ".join(
        f"{name} [{units.get(name, model.output.unit)}]"
        for name in (*reading.columns, *reading.outputs)
    )


def _added_cells(
    model: Model,
    reading: Reading,
    columns: dict[str, Array],
    block: Sequence[Row],
    label: str,
    extra: Extra,
    runs: Sequence[tuple[Model, Callable[[Columns], Run]]],
) -> tuple[list[str], list[int]]:
    """Return the new fields of every row of a block, and the rows at which a free run diverges."""
    known = np.flatnonzero(
        np.logical_and.reduce([np.isfinite(columns[name]) for name in reading.columns])
    )
    count = len(runs)
    added = ["," * (count + sum(len(extra.names(one)) for one in model.each))] * len(block)
    if not len(known):
        return added, []
    try:
        numbers, outside, diverged = _numbers_of(
            model, reading, {name: x[known] for name, x in columns.items()}, known, extra, runs
        )
    except AtSample as error:
        raise DataError(
            f"{label}:row {block[error.sample].line}: {error.fault}", error.remedy
        ) from error
    for i, flag, row in zip(known, outside, numbers, strict=True):
        digits = [*map(_digits, row)]
        added[i] = ",".join([*digits[:count], "true" if flag else "false", *digits[count:]])
    return added, diverged


def _digits(value: float) -> str:
    return format(value, ".12g") if math.isfinite(value) else ""


def _numbers_of(
    model: Model,
    reading: Reading,
    columns: dict[str, Array],
    rows: IntArray,
    extra: Extra,
    runs: Sequence[tuple[Model, Callable[[Columns], Run]]],
) -> tuple[Array, BoolArray, list[int]]:
    """Return prediction and what else is wanted of complete rows, (n, m), their flags, (n,), and
    the rows at which a free run diverges.

    Those of a recording go stretch by stretch where signals follow from others. `rows` are the
    numbers by which rows are told.
    """
    if reading.turned_for is not None:
        turned = solve_for_input(model, columns, reading.turned_for)
        outside = (
            outside_range(model, {**columns, reading.turned_for: turned.values}) | ~turned.solved
        )
        return turned.values[:, None], outside, []
    wide = sum(1 + len(extra.names(one)) for one in model.each)
    numbers = np.full((len(rows), wide), np.nan)
    outside, diverged = np.zeros(len(rows), dtype=bool), list[int]()
    for part in between_gaps(columns["time"]) if reading.signals else [slice(None)]:
        try:
            inputs = with_signals(reading.signals, {name: x[part] for name, x in columns.items()})
        except DataError:  # too few samples for the window of a rate
            continue
        # far outside of the range a term may overflow; the flag says so
        with (
            np.errstate(all="ignore"),
            numbered(rows[part]),
        ):
            said = [(one, run(inputs)) for one, run in runs]
            outside[part] = outside_range(model, inputs)
            more = (
                column
                for one, own in said
                for column in extra.of(one, inputs, own.values, outside[part])
            )
            numbers[part] = np.column_stack([*(own.values for _, own in said), *more])
        lost = {row for _, own in said for row in own.diverged}
        diverged += rows[part][sorted(lost)].tolist()
    return numbers, outside, diverged


def adapt(
    model: Model, lines: Iterable[str] | None, label: str, constants: Mapping[str, float]
) -> Model:
    """Return a model of pressure and strain for one specimen of the family; without `lines`, by its
    dimension alone.

    `lines` are those of a CSV table with pressure, strain and the output in the model's units;
    `constants` give what specimens differ in. Rows with an empty field are left out. The intervals
    stay those of the family, and a note says so.

    Raises UsageError for a model that is no family, or without its dimension; DataError where the
    table is empty or lacks a column.
    """
    of = dimension_of(model)
    assert isinstance(model.body, Formula)
    low, high = model.body.ranges[0].limits[of]
    if set(constants) != {of}:
        unit = next(quantity.unit for quantity in model.inputs if quantity.name == of)
        remedy = (
            f"give it as `--set {of}={(low + high) / 2:.3g}`, in {unit}; the family goes from "
            f"{low:g} to {high:g}"
        )
        raise UsageError(f"adapt needs the {of} of the specimen, and nothing else", remedy)
    names = ("pressure", "strain", model.output.name)
    columns = {name: np.empty(0) for name in names}
    if lines is not None:
        table = Sheet(lines, label, ", ".join(names))
        places, block = table.places(names), list(table.rows)
        if not block:
            raise table.empty()
        columns = table.values(block, places)
        known = np.logical_and.reduce([np.isfinite(values) for values in columns.values()])
        columns = {name: values[known] for name, values in columns.items()}
    target = columns.pop(model.output.name)
    fit = adapted(model.body.fit, columns, target, constants[of])
    ranges = tuple(
        replace(one, limits={name: ends for name, ends in one.limits.items() if name != of})
        for one in model.body.ranges
    )
    inputs = tuple(quantity for quantity in model.inputs if quantity.name != of)
    notes = [*fit.notes]
    if not low <= constants[of] <= high:
        notes.append(f"{of} {constants[of]:g} lies outside of the family's {low:g} to {high:g}")
    if model.left_out is not None:
        notes.append(
            f"its intervals are those of the family, by {model.left_out.curves} specimens, "
            "whatever was measured of this one"
        )
    return replace(
        model, inputs=inputs, body=replace(model.body, fit=fit, ranges=ranges), notes=tuple(notes)
    )


def dimension_of(model: Model) -> str:
    """Return what specimens of a family differ in; UsageError for a model that is no family."""
    if isinstance(model.body, Formula) and is_family(model.body.fit.definition):
        return family_of(model.body.fit.definition).settings.of
    raise UsageError(
        f"the model {model.name} is of one muscle, and adapt needs that of a family, which is "
        "learnt from several",
        "give each muscle's files what it differs in, as `set: {rest_length: 83 mm}`, and "
        "write `model: {family: {of: rest_length}}`; "
        "or fit this muscle by itself: `mapmore init` with its files",
    )
