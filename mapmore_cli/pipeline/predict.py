"""Predict or invert the rows of a table of any length, and append the results to the unchanged text
of the table.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, IntArray, columns_at
from mapmore_cli.domain.errors import DataError, UsageError, Warn
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.results import SimulatedRun
from mapmore_cli.modelling.inverse import LOWEST, invert, solve_for_input
from mapmore_cli.modelling.kinds import alone, outside_range, running, runs_over_time, simulate
from mapmore_cli.modelling.memory.records import AtSample, complete, numbered
from mapmore_cli.modelling.programs import slopes
from mapmore_cli.modelling.signals.rates import with_signals
from mapmore_cli.modelling.validation.intervals import (
    ends,
    half_widths_of,
    interval_limits,
    intervals_of,
)
from mapmore_cli.pipeline.records import (
    Reading,
    RecordRow,
    Sheet,
    between_gaps,
    by_recording,
    reading_of,
)

CHUNK = 20_000
"""Number of rows that are in memory at a time, if the prediction of a row does not depend on other
rows.
"""

FLAG = "outside_range"


@dataclass(frozen=True)
class Predictor:
    """Computation of the columns that are added to a table. These are the predicted outputs (or the
    input for which the model is inverted), the flag `outside_range`, and, if requested, both ends
    of the interval at a `level` and derivatives.
    """

    model: Model
    reading: Reading
    level: float | None
    derivatives: bool

    @property
    def names(self) -> list[str]:
        """Names of the m columns that are added."""
        outputs = [output.name for output in self.model.outputs]
        turned = self.reading.turned_for
        names = [f"{name}_predicted" for name in ([turned] if turned else outputs)] + [FLAG]
        by = self.model.inputs if self.derivatives else ()
        for output in outputs:
            names += [] if self.level is None else [f"{output}_low", f"{output}_high"]
            names += [f"{output}_by_{quantity.name}" for quantity in by]
        return names

    def runs(self, in_parts: bool) -> list[Callable[[Columns], SimulatedRun]]:
        """Return a function for every output that predicts rows of a recording. If `in_parts` is
        True, the function of a model with memory can be called with the blocks of a recording one
        after the other. It then continues each block from its state at the end of the block before.
        """
        return [
            (running(part) if in_parts else None) or partial(simulate, part)
            for part in self.model.each
        ]

    def numbers(
        self, columns: Columns, rows: IntArray, runs: Sequence[Callable[[Columns], SimulatedRun]]
    ) -> tuple[Array, BoolArray, list[int]]:
        """Compute the added columns for rows without missing fields. Three results are returned:
        the columns without the flag, (n, m - 1); the flag, (n,), which is True for rows outside the
        training range; and the rows at which the free run of a model diverges.

        If rates or directions are computed from other columns, a recording is cut at its gaps, and
        each piece is computed separately. `rows` are the indices of the rows, for messages.
        """
        model, reading = self.model, self.reading
        if reading.turned_for is not None:
            turned = solve_for_input(model, columns, reading.turned_for)
            inputs = {**columns, reading.turned_for: turned.values}
            return turned.values[:, None], outside_range(model, inputs) | ~turned.solved, []
        numbers = np.full((len(rows), len(self.names) - 1), np.nan)
        outside, diverged = np.zeros(len(rows), dtype=bool), list[int]()
        for part in between_gaps(columns["time"]) if reading.signals else [slice(None)]:
            inputs = columns_at(columns, part)
            try:
                inputs = with_signals(reading.signals, inputs)
            except DataError:  # the window of a rate may contain too few samples
                continue
            # no warning from NumPy is wanted: terms may overflow far outside the training range,
            # and the flag marks such rows anyway
            with np.errstate(all="ignore"), numbered(rows[part]):
                outcomes = [run(inputs) for run in runs]
                beyond = outside[part] = outside_range(model, inputs)
                results = [outcome.values for outcome in outcomes]
                for of_output, outcome in zip(model.each, outcomes, strict=True):
                    if self.level is not None:
                        widths = half_widths_of(of_output, inputs, self.level)
                        results += ends(outcome.values, beyond, widths)
                    if self.derivatives:
                        results += slopes(of_output, inputs).values()
            numbers[part] = np.column_stack(results)
            lost = {row for outcome in outcomes for row in outcome.diverged}
            diverged += rows[part][sorted(lost)].tolist()
        return numbers, outside, diverged

    def cells(
        self,
        label: str,
        block: Sequence[RecordRow],
        columns: dict[str, Array],
        runs: Sequence[Callable[[Columns], SimulatedRun]],
    ) -> tuple[list[str], list[int]]:
        """Return the text of the added fields for every row of a block, and the indices of the rows
        at which the free run of a model diverges.
        """
        needed = (columns[name] for name in self.reading.columns)
        known = np.flatnonzero(complete(needed, len(block)))
        added = ["," * (len(self.names) - 1)] * len(block)
        if not len(known):
            return added, []
        columns = columns_at(columns, known)
        try:
            numbers, outside, diverged = self.numbers(columns, known, runs)
        except AtSample as error:
            raise DataError(
                f"{label}:row {block[error.sample].line}: {error.fault}", error.remedy
            ) from error
        flag_at = self.names.index(FLAG)
        for i, flag, row in zip(known, outside, numbers, strict=True):
            cells = [*map(_digits, row)]
            cells.insert(flag_at, "true" if flag else "false")
            added[i] = ",".join(cells)
        return added, diverged


def predicted_lines(
    model: Model,
    lines: Iterable[str],
    label: str,
    chunk: int = CHUNK,
    warn: Warn = lambda _: None,
    derivatives: bool = False,
    interval: float | None = None,
    turned_for: str | None = None,
    constants: Mapping[str, float] | None = None,
) -> Iterator[str]:
    """Yield the lines of a CSV table with fields added to each line: `<output>_predicted` for every
    output, and `outside_range`.

    The header holds the names of the quantities; the numbers are in the model's units. Predictions
    have 12 significant digits; `outside_range` is `true` or `false`. Both fields are empty if an
    input is empty or not finite. Blank lines stay as they are. `label` names the table in messages;
    `chunk` has no influence on the result.

    - `turned_for`: input for which the model is inverted, for example the force of a model of the
      strain. The table must have the output instead, the new column is `<input>_predicted`, and
      rows without a solution in the training range are flagged as outside.
    - `interval`: level such as 0.95; adds `<output>_low` and `<output>_high`, empty outside the
      training range.
    - `derivatives`: adds one column for every input, `<output>_by_<input>`.
    - `constants`: adds inputs that are the same in every row.

    Rates and directions that the table lacks are computed from its `time`, recording by recording.
    A recording ends where the column `recording` changes or time goes back, and everything restarts
    after a gap. A model with memory runs along each recording in the same way, from the first
    measured outputs if it feeds its output back. There is no prediction before there is history,
    nor after a run has diverged, which `warn` reports. A recording is in memory as a whole if rates
    are computed from its columns, otherwise in blocks of `chunk` rows.

    Raises DataError if the table is empty, lacks an input, already has one of the added columns, or
    has a field that is not a number; if a model with memory has no measured output to start with,
    or rows are not at its time steps; or if the model has no data for intervals. Raises UsageError
    for an invalid level of the interval, or a model that cannot be inverted for that input.
    """
    if interval is not None and (why := interval_limits(intervals_of(model, interval))) is not None:
        warn(f"{model.name}: {why}")
    table = Sheet(lines, label, _column_names(model), constants)
    reading = (
        reading_of(model, table.names) if turned_for is None else _reading_turned(model, turned_for)
    )
    predictor = Predictor(model, reading, interval, derivatives)
    places = table.places(reading.columns + reading.outputs, predictor.names)
    yield from table.extended([table.header], [",".join(predictor.names)])
    predicted = beyond = 0
    in_parts = not reading.signals and all(map(running, model.each))
    blocks: Iterator[tuple[list[RecordRow], bool]]
    blocks = ((block, True) for block in iter(lambda: [*islice(table.rows, chunk)], []))
    if reading.over_time:
        blocks = by_recording(table.rows, table.names, chunk if in_parts else math.inf)
    for block, begins in blocks:
        if begins:
            runs = predictor.runs(in_parts)
        cells, diverged = predictor.cells(label, block, table.values(block, places), runs)
        for start in diverged:
            warn(
                f"{label}:row {block[start].line}: the prediction grows without limit, because the "
                "model gets its own predictions as past outputs; the rows up to the next gap or "
                "recording stay empty, and the model cannot be used for these inputs"
            )
        predicted += sum(not cell.startswith(",") for cell in cells)
        beyond += sum("true" in cell.split(",") for cell in cells)
        yield from table.extended(block, cells)
    if predicted and beyond == predicted:
        warn(
            f"{label}: every row lies outside the training range; the model expects "
            f"{table.expected}"
        )


def inverted_lines(
    model: Model, lines: Iterable[str], label: str, name: str, rule: str = LOWEST
) -> Iterator[str]:
    """Yield the lines of a CSV table with `<name>_found`, `<name>_solutions` and `<name>_status`
    added.

    The table must have the wanted output under its name, and every input but `name`. The solutions
    are all solutions within the training range, in ascending order and separated by spaces. The
    found solution is the one that the rule selects. The status is `none`, `one`, `several` or
    `flat`. All three fields are empty in rows in which a number is missing. The whole table is in
    memory, because the rule `nearest` depends on the previous row.

    Raises UsageError for an unknown input or rule, or a model with memory; DataError if the table
    is empty, lacks a column, has one of the added ones already, or a field that is no number.
    """
    if runs_over_time(model):
        raise UsageError(
            "this model has memory: its output depends on past inputs, so that it cannot "
            "be inverted",
            "use a model without memory",
        )
    needed = [
        alone(model).output.name,
        *(quantity for quantity in model.input_names if quantity != name),
    ]
    table = Sheet(lines, label, ", ".join(needed))
    added = [f"{name}_found", f"{name}_solutions", f"{name}_status"]
    places = table.places(needed, added)
    block = list(table.rows)
    columns = table.values(block, places)
    known = np.flatnonzero(complete(columns.values(), len(block)))
    cells = [",,"] * len(block)
    if len(known):
        inputs = columns_at(columns, known)
        inverse = invert(model, inputs.pop(model.output.name), inputs, name, rule)
        starts = np.searchsorted(inverse.rows, np.arange(1, len(known)))
        parts = inverse.picked, np.split(inverse.values, starts), inverse.status
        for place, solution, every, status in zip(known.tolist(), *parts, strict=True):
            cells[place] = ",".join([_digits(solution), " ".join(map(_digits, every)), status])
    yield from table.extended([table.header, *block], [",".join(added), *cells])


def _reading_turned(model: Model, name: str) -> Reading:
    """Return the columns that must be read to invert the model for its input `name`. Raises
    UsageError if the model cannot be inverted for this input.
    """
    inputs = alone(model).input_names
    if name not in inputs:
        raise UsageError(
            f"--as: the model has no input '{name}'", f"name one of {', '.join(inputs)}"
        )
    if runs_over_time(model):
        raise UsageError(
            "--as: this model has memory, so that it cannot be inverted", "leave --as out"
        )
    return Reading(
        (model.output.name, *(quantity for quantity in inputs if quantity != name)), turned_for=name
    )


def _column_names(model: Model) -> str:
    reading = reading_of(model, [signal.name for signal in model.signals])
    units = {quantity.name: quantity.unit for quantity in (*model.inputs, model.output)} | {
        "time": "s"
    }
    names = reading.columns + reading.outputs
    return ", ".join(f"{name} [{units.get(name, model.output.unit)}]" for name in names)


def _digits(value: float) -> str:
    return format(value, ".12g") if math.isfinite(value) else ""
