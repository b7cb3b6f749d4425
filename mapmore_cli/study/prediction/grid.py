"""Lookup tables: the points of a regular grid over the inputs of a model, as lines of a table."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import product

import numpy as np

from mapmore_cli.domain.errors import DataError, UsageError
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.inverse import LOWEST, invert
from mapmore_cli.modelling.kinds import runs_over_time
from mapmore_cli.storage.tables import TableRequest, locate_columns
from mapmore_cli.study.prediction.records import fields_of, records, values_of

EXAMPLE = "write it as pressure=0:600:25,strain=0:0.25:0.01 (first:last:step, or one value)"
MOST_POINTS = 10_000_000
"""Points of a table beyond which a step is taken for a slip of the pen."""


def grid_lines(text: str, inputs: Sequence[str]) -> Iterator[str]:
    """Yield the header and the points of a grid, the last input of `text` varying fastest; both ends are included.

    Raises UsageError where `text` is malformed, names an input twice or one that the model has not, leaves one out, or has a step that does
    not lead from the first value to the last.
    """
    return _lines(_of_inputs(text, inputs))


def grid_axes(text: str, inputs: Sequence[str]) -> dict[str, list[float]]:
    """Return the places along every input of a grid; raises as `grid_lines`."""
    return {name: list(map(float, values)) for name, values in _of_inputs(text, inputs).items()}


def _of_inputs(text: str, inputs: Sequence[str]) -> dict[str, list[str]]:
    axes = _axes(text)
    for name in axes:
        if name not in inputs:
            near = difflib.get_close_matches(name, inputs, n=1)
            hint = f"did you mean '{near[0]}'? " if near else ""
            raise UsageError(f"--grid: the model has no input '{name}'", f"{hint}it has {', '.join(inputs)}")
    if missing := [name for name in inputs if name not in axes]:
        raise UsageError(f"--grid: no values for {', '.join(missing)}", EXAMPLE)
    points = math.prod(map(len, axes.values()))
    if points > MOST_POINTS:
        raise UsageError(f"--grid: asks for {points} points, more than {MOST_POINTS}", "choose larger steps, or predict a table")
    return axes


def _lines(axes: dict[str, list[str]]) -> Iterator[str]:
    yield ",".join(axes) + "\n"
    for point in product(*axes.values()):
        yield ",".join(point) + "\n"


def _axes(text: str) -> dict[str, list[str]]:
    axes: dict[str, list[str]] = {}
    for part in text.split(","):
        name, equals, values = (piece.strip() for piece in part.partition("="))
        if not equals:
            raise UsageError(f"--grid: '{part.strip()}' has no '='", EXAMPLE)
        if name in axes:
            raise UsageError(f"--grid: '{name}' is given twice", EXAMPLE)
        axes[name] = [format(value, ".12g") for value in _values(part.strip(), values)]
    return axes


def _values(part: str, text: str) -> list[float]:
    try:
        numbers = [float(number) for number in text.split(":")]
    except ValueError:
        numbers = []
    if len(numbers) not in (1, 3) or not all(map(math.isfinite, numbers)):
        raise UsageError(f"--grid: cannot read '{part}'", EXAMPLE)
    if len(numbers) == 1:
        return numbers
    first, last, step = numbers
    steps = (last - first) / step if step else math.nan
    if not 0 <= steps <= MOST_POINTS:
        raise UsageError(f"--grid: '{part}' does not lead from {first:g} to {last:g} in at most {MOST_POINTS} steps", EXAMPLE)
    if abs(steps - round(steps)) > 1e-6:
        raise UsageError(f"--grid: {last:g} is not a whole number of steps of {step:g} from {first:g}", "choose another step or last value")
    return [first + i * step for i in range(round(steps))] + [last]


def inverted_lines(model: Model, lines: Iterable[str], label: str, name: str, rule: str = LOWEST) -> Iterator[str]:
    """Yield the lines of a CSV table with `<name>_found`, `<name>_solutions` and `<name>_status` added.

    The table has the wanted output by its name, and every input but `name`. `solutions` are all there are within the training range,
    ascending, with a space between; `found` is the one that the rule picks; the status is `none`, `one`, `several` or `flat`. Rows with an
    empty number have none of them. The whole table is in memory, since the rule `nearest` goes from row to row.

    Raises UsageError for an input that the model has not, a rule that there is none of, or a model with memory; DataError where the table
    is empty, lacks a column, has one of the added ones already, or a field that is no number.
    """
    if runs_over_time(model):
        raise UsageError("this model has memory: the input for an output depends on what was before", "invert a static model")
    rows = list(records(lines, label))
    needed = [model.output.name, *(quantity.name for quantity in model.inputs if quantity.name != name)]
    if not rows:
        raise DataError(f"{label}: the table is empty", f"its first line has to name {', '.join(needed)}")
    header, *block = rows
    names = [cell.strip() for cell in header.cells]
    added = [f"{name}_found", f"{name}_solutions", f"{name}_status"]
    for column in added:
        if column in names:
            raise DataError(f"{label}: already has a column {column}", "rename or remove it")
    places = locate_columns(TableRequest(label, tuple(needed), header=True), names, len(names))
    fields = [fields_of(row, len(names), label) for row in block]
    columns = {column: values_of(block, fields, places[column], column, label) for column in needed}
    known = np.flatnonzero(np.logical_and.reduce([np.isfinite(values) for values in columns.values()]))
    cells = [",,"] * len(block)
    if len(known):
        given = {column: values[known] for column, values in columns.items()}
        inverse = invert(model, given.pop(model.output.name), given, name, rule)
        solutions = np.split(inverse.values, np.searchsorted(inverse.rows, np.arange(1, len(known))))
        for place, picked, every, status in zip(known.tolist(), inverse.picked, solutions, inverse.status, strict=True):
            cells[place] = f"{'' if np.isnan(picked) else format(picked, '.12g')},{' '.join(format(x, '.12g') for x in every)},{status}"
    yield f"{header.text},{','.join(added)}{header.end}"
    for row, own, filled in zip(block, cells, fields, strict=True):
        yield row.text + row.end if filled is None else f"{row.text},{own}{row.end}"
