"""A model as a lookup table: CSV, a MAT file for lookup blocks, and the text that Modelica's
CombiTable2D reads.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence

import numpy as np

from mapmore_cli.annexes.exporting.dialect import (
    Code,
    code,
    identifier,
    names_of_inputs,
    note,
    rendered,
)
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.foreign import csv_cell, identifiers
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.kinds import equations, outside_range, predict, runs_over_time
from mapmore_cli.modelling.program.model import program_of

POINTS = 41
"""Places along every input, where no grid is given."""

MOST = 2_000_000
"""Points of a table beyond which an axis is taken for a slip of the pen."""

HEADER = b"MATLAB 5.0 MAT-file, written by mapmore"


def table_files(
    model: Model, axes: Mapping[str, Sequence[float]] | None = None
) -> dict[str, bytes]:
    """Return the files of a table by name; `axes` has the places along each input, ascending, else
    they are spread over the training range.

    All hold the output on the grid, and `valid`: 1 within the training range, 0 beyond. The MAT
    file has one vector for each input, and the arrays in the order of the inputs. The text for
    Modelica is written for two inputs, with the first along the rows.

    Raises UsageError for a model with memory, axes that are not its inputs, fewer than two places,
    and a grid that is too large.
    """
    if runs_over_time(model):
        raise UsageError(
            "a table has no time, and this model has memory", "export it as C, py, numpy or fmu"
        )
    names = [quantity.name for quantity in model.inputs]
    axes = dict(axes) if axes is not None else {}
    places = {
        name: np.asarray(axes[name], dtype=np.float64) if name in axes else _spread(model, name)
        for name in names
    }
    if math.prod(map(len, places.values())) > MOST:
        raise UsageError(
            f"the table would have more than {MOST} points",
            "choose fewer places: --grid pressure=0:600:25,...",
        )
    if short := [name for name, values in places.items() if len(values) < 2]:
        raise UsageError(
            f"--grid: {short[0]} has a single place",
            "a lookup table needs two or more along each input",
        )
    shape = tuple(map(len, places.values()))
    mesh = np.meshgrid(*places.values(), indexing="ij")
    points = {name: grid.ravel() for name, grid in zip(places, mesh, strict=True)}
    values, valid = (
        predict(model, points).reshape(shape),
        (~outside_range(model, points)).astype(np.float64).reshape(shape),
    )
    stem = identifier(model.name)
    files = {
        f"{stem}.csv": _csv(model, points, values, valid).encode(),
        f"{stem}.mat": _mat(model, places, values, valid),
    }
    if len(names) == 2:
        files[f"{stem}.txt"] = _combi_table(model, places, values, valid).encode()
    return files


def _spread(model: Model, name: str) -> Array:
    """Even places over the training range of an input, and the levels of the model among them."""
    limits = [limit for limit in program_of(model).limits if limit.inputs == {name}]
    if not limits:
        raise UsageError(
            f"--grid: nothing says how far {name} reaches",
            f"give its places, as --grid {name}=0:1:0.1",
        )
    low, high = (
        min(float(limit.low.min()) for limit in limits),
        max(float(limit.high.max()) for limit in limits),
    )
    levels = [
        limit.levels
        for limit in program_of(model).limits
        if model.level == name and limit.at is not None
    ]
    return np.unique(
        np.concatenate(
            [
                np.linspace(low, high, POINTS),
                *[known[(known >= low) & (known <= high)] for known in levels],
            ]
        )
    )


def _csv(model: Model, points: Mapping[str, Array], values: Array, valid: Array) -> str:
    columns, text = [*points.values(), values.ravel(), valid.ravel()], io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(map(csv_cell, (*points, f"{model.output.name}_predicted", "valid")))
    table.writerows(
        [f"{number:.12g}" if math.isfinite(number) else "" for number in row]
        for row in zip(*columns, strict=True)
    )
    return text.getvalue()


def _mat(model: Model, places: Mapping[str, Array], values: Array, valid: Array) -> bytes:
    """Return a MAT file of level 5, without the date that SciPy puts into it."""
    from scipy.io import savemat

    output = _output(model)
    names = names_of_inputs(model.inputs, [output, "valid"])
    arrays = {names[name]: column for name, column in places.items()}
    stream = io.BytesIO()
    savemat(stream, {**arrays, output: values, "valid": valid}, oned_as="column")  # type: ignore[arg-type]  # a stream will do
    return HEADER.ljust(116) + stream.getvalue()[116:]


def _output(model: Model) -> str:
    return identifiers([model.output.name], ["valid"])[0]


def _combi_table(model: Model, places: Mapping[str, Array], values: Array, valid: Array) -> str:
    """Two tables, `<output>` and `valid`: the second input in the first row, the first input in the
    first column.
    """
    rows, columns = places.values()
    lines = [
        "#1",
        *(
            "# " + note(f"{quantity.name} [{quantity.unit}]")
            for quantity in (*model.inputs, model.output)
        ),
    ]
    for name, grid in ((_output(model), values), ("valid", valid)):
        lines += ["", code("double {}({},{})", name, len(rows) + 1, len(columns) + 1)]
        lines.append(" ".join(["0", *(repr(float(place)) for place in columns)]))
        lines += [
            " ".join(repr(float(number)) for number in (place, *row))
            for place, row in zip(rows, grid, strict=True)
        ]
    return "\n".join([*lines, ""])


def tex_equations(model: Model) -> tuple[str, str]:
    """Return name and text of a file for `\\input`: one equation each, in the model's units, with
    what it is called before it.
    """
    units = ", ".join(
        f"{quantity.name} in {quantity.unit}" for quantity in (model.output, *model.inputs)
    )
    found = [
        (one.id, Code(one.latex)) for one in equations(model)
    ]  # printed from names that are identifiers
    return f"{identifier(model.name)}.tex", rendered(
        "equations.tex", about=f"{model.name}: {units}", equations=found
    )
