"""Write a model as a lookup table: CSV, a MAT file for lookup blocks, and the text that Modelica's
CombiTable2Ds reads.
"""

from __future__ import annotations

import io
import math
from typing import NamedTuple

import numpy as np

from mapmore_cli.annexes.exporting.templates import (
    OWN,
    Code,
    Wanted,
    code,
    identifier,
    name_of_output,
    names_in_matlab,
    names_of_inputs,
    note,
    rendered_template,
)
from mapmore_cli.annexes.exporting.verifying import training_ends
from mapmore_cli.annexes.exporting.words import words_of
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.foreign import csv_cell
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.kinds import equations, outside_range, predict, rules, runs_over_time
from mapmore_cli.modelling.programs import program_of
from mapmore_cli.pipeline.records import grid_axes
from mapmore_cli.reporting.table import number_text, rows_to_csv, to_latex
from mapmore_cli.reporting.tables import limits_tables

POINTS = 41
"""Number of places along every input if no grid is given."""

MOST = 2_000_000
"""Largest number of points of a table; more are probably a mistyped step."""

HEADER = b"MATLAB 5.0 MAT-file, written by mapmore"


class Grid(NamedTuple):
    """A model that was evaluated on a grid of n points.

    - `places`: values along each input, by name.
    - `points`: every input at the points, (n,) by name; the last input varies fastest.
    - `values`: the output at the points, (n,).
    - `valid`: 1 at points within the training range, 0 at the others, (n,).
    """

    places: dict[str, Array]
    points: dict[str, Array]
    values: Array
    valid: Array


def table_files(model: Model, wanted: Wanted) -> dict[str, str | bytes]:
    """Return the files of a lookup table by name. Without a grid, points are spread over the
    training range.

    All files hold the output on the grid, and `valid`: 1 within the training range, 0 outside. The
    MAT file has one vector for each input. The axes of its arrays are in the order of the inputs.
    The text for Modelica is written for two inputs, with the first along the rows.

    Raises UsageError for a model with memory, fewer than two values of an input, and a grid that is
    too large.
    """
    grid, stem = _on_grid(model, wanted.grid), identifier(model.name)
    if short := [name for name, values in grid.places.items() if len(values) < 2]:
        raise UsageError(
            f"--grid: {short[0]} has a single point",
            "give two or more points along each input, because a lookup table interpolates "
            "between points",
        )
    files: dict[str, str | bytes] = {
        f"{stem}.csv": _csv(model, grid, valid=grid.valid),
        f"{stem}.mat": _mat(model, grid),
    }
    if len(grid.places) == 2:
        files[f"{stem}.txt"] = _combi_table(model, grid)
        output = str(name_of_output(model))
        names = names_of_inputs(model.inputs, [*words_of("Modelica"), *OWN, output])
        files[f"{stem}.mo"] = rendered_template(
            "table.mo", model=model, name=stem, output=output, names=[*names.values()]
        )
    return files


def lookup_table(model: Model, wanted: Wanted) -> dict[str, str]:
    """Return a table of the points of a grid. Raises UsageError if the grid leaves the training
    range, because users of the table would take points outside for valid ones.
    """
    grid = _on_grid(model, wanted.grid)
    if outside := np.flatnonzero(grid.valid == 0).tolist():
        first = ",".join(f"{values[outside[0]]:.12g}" for values in grid.points.values())
        raise UsageError(
            (
                f"--grid: {len(outside)} of {len(grid.valid)} points lie outside of the training "
                f"range, for example {first}"
            ),
            "keep the grid within the range, or use `--to table`, which marks such points",
        )
    return {f"{identifier(model.name)}.csv": _csv(model, grid)}


def _on_grid(model: Model, text: str | None) -> Grid:
    if runs_over_time(model):
        raise UsageError(
            "a table has no time, and this model has memory", "export it as C, py, numpy or fmu"
        )
    names = model.input_names
    axes = {} if text is None else grid_axes(text, names)
    places = {
        name: np.array(axes[name]) if name in axes else _places_over_range(model, name)
        for name in names
    }
    if math.prod(map(len, places.values())) > MOST:
        raise UsageError(
            f"the table would have more than {MOST} points",
            "use larger steps, for example --grid pressure=0:600:25,...",
        )
    mesh = np.meshgrid(*places.values(), indexing="ij")
    points = {name: axis.ravel() for name, axis in zip(places, mesh, strict=True)}
    inside = (~outside_range(model, points)).astype(float)
    return Grid(places, points, predict(model, points), inside)


def _places_over_range(model: Model, name: str) -> Array:
    """Return evenly spaced values over the training range of an input, which include the levels of
    the model.
    """
    ends = [place for side in training_ends(model)[name] for place in side]
    if not ends:
        raise UsageError(
            f"--grid: the range of {name} is not known",
            f"give its points, for example --grid {name}=0:1:0.1",
        )
    low, high = min(ends), max(ends)
    places = np.linspace(low, high, POINTS)
    if model.level == name:
        limits = program_of(model).limits
        levels = np.concatenate(
            [limit.levels for limit in limits if limit.at is not None] or [places]
        )
        places = np.append(places, levels[(levels >= low) & (levels <= high)])
    return np.unique(places)


def _csv(model: Model, grid: Grid, **more: Array) -> str:
    columns = {**grid.points, f"{model.output.name}_predicted": grid.values, **more}
    numbers = np.column_stack([*columns.values()])
    numbers[~np.isfinite(numbers)] = np.nan
    return rows_to_csv(map(csv_cell, columns), (map(number_text, row) for row in numbers.tolist()))


def _mat(model: Model, grid: Grid) -> bytes:
    """Return a MAT file of level 5, without the date that SciPy writes into it."""
    from scipy.io import savemat

    output, stream = name_of_output(model), io.BytesIO()
    names = names_in_matlab(model.inputs, [output, "valid"])
    arrays = {names[name]: column for name, column in grid.places.items()}
    shape = list(map(len, grid.places.values()))
    arrays |= {output: grid.values.reshape(shape), "valid": grid.valid.reshape(shape)}
    savemat(stream, arrays, oned_as="column")  # type: ignore[arg-type]  # savemat accepts streams
    return HEADER.ljust(116) + stream.getvalue()[116:]


def _combi_table(model: Model, grid: Grid) -> str:
    """Return two tables, `<output>` and `valid`, with the second input in the first row and the
    first input in the first column.
    """
    rows, columns = grid.places.values()
    quantities = (*model.inputs, model.output)
    lines = ["#1", *("# " + note(quantity.label) for quantity in quantities)]
    for name, values in ((name_of_output(model), grid.values), ("valid", grid.valid)):
        lines += ["", code("double {}({},{})", name, len(rows) + 1, len(columns) + 1)]
        inner = values.reshape(len(rows), len(columns))
        table = np.block([[np.zeros((1, 1)), columns], [rows[:, None], inner]])
        lines += [" ".join(map(repr, row)) for row in table.tolist()]
    return "\n".join([*lines, ""])


def tex_equations(model: Model, _wanted: Wanted) -> dict[str, str]:
    """Return a file for `\\input`: each equation in the model's units, preceded by its name and its
    range of validity; then how the equations are combined, and the limits. A document that includes
    the file needs the LaTeX package booktabs.
    """
    units = ", ".join(
        f"{quantity.name} in {quantity.unit}" for quantity in (model.output, *model.inputs)
    )
    # these texts are printed from names that are identifiers, so they need no escaping
    typeset = [
        (equation.id, equation.weight, Code(equation.latex)) for equation in equations(model)
    ]
    text = rendered_template(
        "equations.tex",
        about=f"{model.name}: {units}",
        equations=typeset,
        rules=rules(model),
        limits=[Code(to_latex(table)) for table in limits_tables(model)],
    )
    return {f"{identifier(model.name)}.tex": text}
