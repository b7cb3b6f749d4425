"""Inputs for wanted outputs, row for row of a table."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from mapmore_cli.domain.errors import DataError, UsageError
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.inverse import LOWEST, invert
from mapmore_cli.modelling.kinds import runs_over_time
from mapmore_cli.stages.prediction.records import fields_of, records, values_of
from mapmore_cli.storage.tables.table import TableRequest, locate_columns


def inverted_lines(model: Model, lines: Iterable[str], label: str, name: str, rule: str = LOWEST) -> Iterator[str]:
    """Yield the lines of a CSV table with `<name>_found`, `<name>_solutions` and `<name>_status` added.

    The table has the wanted output by its name, and every input but `name`. `solutions` are all there are within the training range,
    ascending, with a space between; `found` is the one that the rule picks; the status is `none`, `one`, `several` or `flat`. Rows with an
    empty number have none of them. The whole table is in memory, since the rule `nearest` goes from row to row.

    Raises
    ------
    UsageError
        For an input that the model has not, a rule that there is none of, or a model with memory.
    DataError
        Where the table is empty, lacks a column, has one of the added ones already, or a field that is no number.
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
