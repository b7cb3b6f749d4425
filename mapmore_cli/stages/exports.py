"""Models written in other languages, as files by name."""

from __future__ import annotations

from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.models import Model
from mapmore_cli.exporting.c import c_source
from mapmore_cli.exporting.names import identifier
from mapmore_cli.exporting.numpy_module import numpy_module
from mapmore_cli.exporting.tex import tex_equations
from mapmore_cli.modelling.kinds import runs_over_time
from mapmore_cli.stages.prediction.grid import grid_lines
from mapmore_cli.stages.prediction.predict import FLAG, predicted_lines


def exported(model: Model, to: str, *, single: bool = False, grid: str | None = None) -> dict[str, str]:
    """The files of a model as `c` (in `single` precision or not), `tex`, `py`, or as `csv` at the points of a `grid`.

    Raises
    ------
    UsageError
        For a grid that is malformed or goes beyond the training range, and for a name that has no letter.
    DataError
        Where a part of the model is no closed expression.
    """
    match to:
        case "c":
            return c_source(model, single).files
        case "tex":
            return dict([tex_equations(model)])
        case "py":
            return dict([numpy_module(model)])
    assert grid is not None
    return {f"{identifier(model.name)}.csv": _table(model, grid)}


def _table(model: Model, grid: str) -> str:
    """A lookup table within the range in which the model was trained: what lies outside would be looked up as if it were known."""
    if runs_over_time(model):
        raise UsageError("--grid: this model has memory, and a grid has no time", "export it as C or NumPy")
    header, *lines = predicted_lines(model, grid_lines(grid, [quantity.name for quantity in model.inputs]), "--grid")
    place = header.rstrip("\n").split(",").index(FLAG)
    outside = [line for line in lines if line.rstrip("\n").split(",")[place] == "true"]
    if outside:
        raise UsageError(
            f"--grid: {len(outside)} of {len(lines)} points lie outside of the training range, as {outside[0].strip()}",
            "keep the grid within the range, or take `mapmore predict --grid`, which marks such points",
        )
    rows = [line.rstrip("\n").split(",") for line in (header, *lines)]
    return "".join(",".join(row[:place] + row[place + 1 :]) + "\n" for row in rows)
