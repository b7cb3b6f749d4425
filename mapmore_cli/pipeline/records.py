"""Read the rows for a prediction, and find the columns that are needed. Rows come from a CSV table,
with their original text, or are the points of a grid.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, product
from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError, UsageError
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Signal
from mapmore_cli.modelling.kinds import fed_back, runs_over_time
from mapmore_cli.modelling.signals.sampling import cut_after, find_gaps, typical_step
from mapmore_cli.storage.tables import TableRequest, locate_columns
from mapmore_cli.storage.tables.cells import CellReader, NotANumber, number_of
from mapmore_cli.storage.tables.fields import separator_hint
from mapmore_cli.storage.tables.lines import csv_records

RECORDING = "recording"
"""Column that distinguishes recordings, if a table has it."""

GAP = 10
"""A time step that is longer than this multiple of the usual time step is a gap. For predictions
after a gap, samples before it are not used.
"""


def by_recording(
    rows: Iterator[RecordRow], names: Sequence[str], most: float
) -> Iterator[tuple[list[RecordRow], bool]]:
    """Yield blocks of at most `most` rows of one recording, each with a flag. The flag is True if a
    recording begins with this block, and False if the block continues the recording of the previous
    block.

    A recording ends if the value in the column `recording` changes, or if time goes back.
    """
    mark = names.index(RECORDING) if RECORDING in names else None
    clock = names.index("time")
    block, begins = list[RecordRow](), True
    last: tuple[str | None, float] = (None, -np.inf)
    for row in rows:
        if len(row.cells) == len(names):
            name, time = None if mark is None else row.cells[mark], _time(row.cells[clock])
            ends = name != last[0] or time < last[1]
            if block and (ends or len(block) >= most):
                yield block, begins
                block, begins = [], ends
            last = (name, last[1] if np.isnan(time) and (block or not begins) else time)
        block.append(row)
    if block:
        yield block, begins


def _time(cell: str) -> float:
    """Return the time in a field. A malformed field gives NaN; `Sheet.values` raises the error for
    it later.
    """
    try:
        return CellReader(clock=True)(cell)
    except NotANumber:
        return np.nan


def between_gaps(time: Array) -> list[slice]:
    """Cut a recording at its gaps in time, and return the pieces as slices. `time`, (n,), is finite
    and never decreases.
    """
    if len(time) < 2:
        return [slice(0, len(time))]
    return cut_after(len(time), find_gaps(time, GAP * typical_step(time)).after)


@dataclass(frozen=True)
class Reading:
    """The quantities that are read from a table.

    - `columns`: quantities without which a row cannot be predicted.
    - `signals`: rates and directions that are computed from the columns.
    - `outputs`: measured outputs with which a model with memory starts; in later rows, these fields
      may be empty.
    - `over_time`: True if the order of the rows in time matters; `time` is then among the columns.
    - `turned_for`: input for which the model is inverted, so that the output is read instead of
      this input; None for a model that is not inverted.
    """

    columns: tuple[str, ...]
    signals: tuple[Signal, ...] = ()
    outputs: tuple[str, ...] = ()
    over_time: bool = False
    turned_for: str | None = None


def reading_of(model: Model, columns_there: Collection[str]) -> Reading:
    """Return the quantities that must be read from a table to predict its rows. `columns_there` are
    the columns that the table has.

    All inputs of the model are read. But if an input is a rate or a direction and the table has no
    column of it, the quantity from which it is computed is read instead. `time` is read if there
    are such inputs, or if the model has memory.
    """
    signals = tuple(signal for signal in model.signals if signal.name not in columns_there)
    over_time = bool(signals) or runs_over_time(model)
    wanted = [*model.input_names, *(signal.of for signal in signals)]
    derived = {signal.name for signal in signals}
    columns = dict.fromkeys(
        name for name in (["time"] if over_time else []) + wanted if name not in derived
    )
    return Reading(tuple(columns), signals, fed_back(model), over_time)


class RecordRow(NamedTuple):
    """A record of the table: its text without the line end, the line end, its fields, and the
    number of its last line.
    """

    text: str
    end: str
    cells: Sequence[str]
    line: int

    def with_cells(self, more: Sequence[str]) -> RecordRow:
        """Return the record with more fields appended; a blank record is returned unchanged."""
        if not more or not self.text.strip():
            return self
        return self._replace(text=",".join([self.text, *more]), cells=[*self.cells, *more])


def records(lines: Iterable[str], label: str) -> Iterator[RecordRow]:
    """Yield the records of a CSV table with their text. A quoted field may contain line breaks."""
    for text, cells, line in csv_records(lines, ",", label):
        bare = text.rstrip("\r\n")
        yield RecordRow(bare, text[len(bare) :], cells, line)


class Sheet:
    """A table whose header names quantities in the model's units. Its `rows` are read when they are
    needed, and `label` is its name in messages. Each of the `constants` is treated as a column with
    the same value in every row.

    Raises DataError if the table has no header (`expected` says what a header must name), or if it
    already has a column of the constants.
    """

    def __init__(
        self,
        lines: Iterable[str],
        label: str,
        expected: str,
        constants: Mapping[str, float] | None = None,
    ) -> None:
        self.label, self.expected = label, expected
        self._readers: dict[str, CellReader] = {}
        rows = records(lines, label)
        header = next(rows, None)
        if header is None:
            raise self.empty()
        more = constants or {}
        if there := next((name for name in more if name in map(str.strip, header.cells)), None):
            raise DataError(
                f"{label}: already has a column {there}", "leave out `--set`, or remove the column"
            )
        self.added = len(more)
        self.header = header.with_cells([*more])
        self.names = [cell.strip() for cell in self.header.cells]
        self.rows = (
            (row.with_cells(list(map(repr, more.values()))) for row in rows) if more else rows
        )

    def empty(self) -> DataError:
        """Return the error that is raised for a table without rows."""
        return DataError(
            f"{self.label}: the table is empty", f"its first line must name {self.expected}"
        )

    def places(self, wanted: Iterable[str], added: Sequence[str] = ()) -> dict[str, int]:
        """Return the indices of the `wanted` columns. Raises DataError if one is missing, or if the
        table already has one of the columns in `added`.
        """
        if there := next((name for name in added if name in self.names), None):
            raise DataError(
                f"{self.label}: already has a column {there}, which this command adds",
                "rename or remove it",
            )
        located = locate_columns(
            TableRequest(self.label, tuple(dict.fromkeys(wanted))),
            self.names,
            len(self.names),
            separator_hint(self.names),
        )
        return {str(name): place for name, place in located.items()}

    def is_blank(self, row: RecordRow) -> bool:
        """Return True if a record is a blank line. In a table with one column, a blank line is a
        row with an empty field, and the result is False.
        """
        return not row.text.strip() and len(self.names) > 1

    def values(self, block: Sequence[RecordRow], places: Mapping[str, int]) -> dict[str, Array]:
        """Return the numbers in the columns with the indices in `places`, (n,) each, for the n rows
        of `block`; NaN for an empty field. Raises DataError for a field that is not a number.
        """
        columns = [
            (name, place, np.full(len(block), np.nan), self._reader(name))
            for name, place in places.items()
        ]
        for i, row in enumerate(block):
            if self.is_blank(row):
                continue
            cells = row.cells if row.text.strip() else [""]
            if len(cells) != len(self.names):
                fields, titled = len(cells) - self.added, len(self.names) - self.added
                message = (
                    f"{self.label}:row {row.line}: has {fields} fields, but the header has {titled}"
                )
                raise DataError(message, "correct or remove the line")
            for name, place, values, read in columns:
                try:
                    values[i] = read(cells[place])
                except NotANumber as odd:
                    raise odd.at(f"{self.label}:row {row.line}, column {name}") from None
        return {name: values for name, _, values, _ in columns}

    def _reader(self, name: str) -> CellReader:
        """Return the reader of the cells of a column. All blocks use the same reader, because it
        remembers the form of time stamps.
        """
        usual = "correct the cell, or leave it empty"
        return self._readers.setdefault(name, CellReader(clock=name == "time", usual=usual))

    def extended(self, block: Sequence[RecordRow], added: Sequence[str]) -> Iterator[str]:
        """Yield the lines of the given rows with the text in `added` appended. Blank lines are
        unchanged.
        """
        for row, more in zip(block, added, strict=True):
            yield row.text + row.end if self.is_blank(row) else f"{row.text},{more}{row.end}"


EXAMPLE = "write it as pressure=0:600:25,strain=0:0.25:0.01 (first:last:step, or one value)"
MOST_POINTS = 10_000_000
"""Largest number of points of a grid. A grid with more points is refused, because a step is
probably mistyped.
"""


def grid_lines(text: str, inputs: Sequence[str]) -> Iterator[str]:
    """Yield the points of a grid as lines of a CSV table, after a header. `text` gives the first
    value, the last value and the step of every input, for example
    `pressure=0:600:25,strain=0:0.25:0.01`. Both the first and the last value are included. The last
    input in `text` varies fastest.

    Raises UsageError if `text` is malformed, names an input twice, names an unknown input, leaves
    an input out, or has a step that does not lead from the first value to the last.
    """
    axes = grid_axes(text, inputs)
    values = ([format(value, ".12g") for value in axis] for axis in axes.values())
    return (",".join(point) + "\n" for point in chain([axes], product(*values)))


def grid_axes(text: str, inputs: Sequence[str]) -> dict[str, list[float]]:
    """Return the values along every input of a grid, rounded to twelve digits. Raises the same
    errors as `grid_lines`.
    """
    axes: dict[str, list[float]] = {}
    for part in text.split(","):
        name, equals, values = (piece.strip() for piece in part.partition("="))
        if not equals:
            raise UsageError(f"--grid: '{part.strip()}' has no '='", EXAMPLE)
        if name in axes:
            raise UsageError(f"--grid: '{name}' is given twice", EXAMPLE)
        axes[name] = [float(f"{value:.12g}") for value in _axis_values(part.strip(), values)]
    if unknown := next((name for name in axes if name not in inputs), None):
        near = difflib.get_close_matches(unknown, inputs, n=1)
        hint = f"did you mean '{near[0]}'? " if near else ""
        raise UsageError(
            f"--grid: the model has no input '{unknown}'", f"{hint}name one of {', '.join(inputs)}"
        )
    if missing := [name for name in inputs if name not in axes]:
        raise UsageError(f"--grid: no values for {', '.join(missing)}", EXAMPLE)
    points = math.prod(map(len, axes.values()))
    if points > MOST_POINTS:
        raise UsageError(
            f"--grid: the grid has {points} points; at most {MOST_POINTS} are possible",
            "use larger steps, or predict a table",
        )
    return axes


def _axis_values(part: str, text: str) -> list[float]:
    numbers = [number_of(piece) for piece in text.split(":")]
    finite = [number for number in numbers if number is not None and math.isfinite(number)]
    if len(numbers) not in (1, 3) or len(finite) < len(numbers):
        raise UsageError(f"--grid: cannot read '{part}'", EXAMPLE)
    if len(finite) == 1:
        return finite
    first, last, step = finite
    if step == 0:
        raise UsageError(f"--grid: '{part}': the step must not be zero", EXAMPLE)
    steps = (last - first) / step
    if steps < 0:
        raise UsageError(
            f"--grid: '{part}': a step of {step:g} never leads from {first:g} to {last:g}",
            "change the sign of the step",
        )
    if steps > MOST_POINTS:
        raise UsageError(
            f"--grid: '{part}' has {steps:.9g} steps; at most {MOST_POINTS} are possible",
            "use a larger step",
        )
    if abs(steps - round(steps)) > 1e-6:
        raise UsageError(
            f"--grid: the distance from {first:g} to {last:g} is not a whole number of steps of "
            f"{step:g}",
            "use another step or last value",
        )
    return [first + i * step for i in range(round(steps))] + [last]
