"""Models written in other languages, as files by name."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable

from mapmore_cli import __version__
from mapmore_cli.annexes.exporting.c_source import c_source, mujoco_files, simulink_files
from mapmore_cli.annexes.exporting.dialect import identifier
from mapmore_cli.annexes.exporting.fmu import fmu_sources
from mapmore_cli.annexes.exporting.python_module import python_module
from mapmore_cli.annexes.exporting.table import table_files, tex_equations
from mapmore_cli.annexes.exporting.verifying import (
    CompilerMissing,
    built,
    library_place,
    verify_c,
    verify_module,
    verify_unit,
)
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.kinds import runs_over_time
from mapmore_cli.pipeline.predict import FLAG, predicted_lines
from mapmore_cli.pipeline.records import grid_axes, grid_lines
from mapmore_cli.spec.units import base_units

Warn = Callable[[str], None]

OLDEST = (1980, 1, 1, 0, 0, 0)
"""The date of every file in an archive, so that the same model gives the same bytes."""


def exported(
    model: Model,
    to: str,
    *,
    single: bool = False,
    grid: str | None = None,
    verify: bool = True,
    warn: Warn = lambda _text: None,
) -> dict[str, bytes]:
    """Return the files of a model in one of the languages that `mapmore export --to` knows; C may
    be of `single` precision.

    `csv` has the points of a `grid`; a `table` those of a `grid` or of the training range.

    C, units and modules are compared with `predict` where `verify` is set. `warn` is told where a
    unit has no binary for this machine, and where nothing could be compared for want of a compiler.

    Raises UsageError for a grid that is malformed or goes beyond the training range, and for a name
    that has no letter; DataError where a part of the model is no closed expression; MapmoreError
    where the code that was written has other numbers than `predict`.
    """
    match to:
        case "c":
            source = c_source(model, single)
            texts = source.files
            if verify:
                try:
                    verify_c(model, source.name, texts, single)
                except CompilerMissing as reason:
                    warn(f"{reason}: the source was not compared with `mapmore predict`")
        case "fmu":
            return {f"{identifier(model.name)}.fmu": _unit(model, verify, warn)}
        case "tex":
            texts = dict([tex_equations(model)])
        case "py" | "numpy":
            name, text = python_module(model, plain=to == "py")
            texts = {name: text}
            if verify:
                verify_module(model, text, each=to == "py")
        case "mujoco" | "simulink":
            texts = (mujoco_files if to == "mujoco" else simulink_files)(model)
        case "table":
            return table_files(
                model,
                None
                if grid is None
                else grid_axes(grid, [quantity.name for quantity in model.inputs]),
            )
        case _:
            assert grid is not None
            texts = {f"{identifier(model.name)}.csv": _table(model, grid)}
    return {name: text.encode() for name, text in texts.items()}


def _unit(model: Model, verify: bool, warn: Warn) -> bytes:
    """Return a functional mock-up unit, a zip file without dates: its sources, and the binary of
    this machine where there is a compiler.
    """
    units = dict.fromkeys(quantity.unit for quantity in (*model.inputs, model.output))
    known = {unit: base for unit in units if (base := base_units(unit)) is not None}
    unit = fmu_sources(model, known, f"mapmore {__version__}")
    files = {name: text.encode() for name, text in unit.files.items()}
    try:
        sources = {
            name.removeprefix("sources/"): text
            for name, text in unit.files.items()
            if name.startswith("sources/")
        }
        if verify:
            verify_unit(model, sources, unit.compiled)
        place = library_place(unit.name)
        files[place] = built(sources, unit.compiled)
    except CompilerMissing as reason:
        warn(
            f"{reason}: the unit has sources and no binary, so that the tool that imports it "
            "has to compile them"
        )
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, data in files.items():
            entry = zipfile.ZipInfo(name, OLDEST)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3  # Unix, wherever it is written
            entry.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
            archive.writestr(entry, data)
    return stream.getvalue()


def _table(model: Model, grid: str) -> str:
    """Return a lookup table within the range in which the model was trained: what lies outside
    would be looked up as if it were known.
    """
    if runs_over_time(model):
        raise UsageError(
            "--grid: this model has memory, and a grid has no time", "export it as C or NumPy"
        )
    lines = predicted_lines(
        model, grid_lines(grid, [quantity.name for quantity in model.inputs]), "--grid"
    )
    header, *rows = (line.rstrip("\n").split(",") for line in lines)
    place = header.index(FLAG)
    if outside := [row for row in rows if row[place] == "true"]:
        what = (
            f"--grid: {len(outside)} of {len(rows)} points lie outside of the training range, "
            f"as {','.join(outside[0])}"
        )
        raise UsageError(
            what,
            "keep the grid within the range, or take `mapmore predict --grid`, which marks "
            "such points",
        )
    return "".join(",".join(row[:place] + row[place + 1 :]) + "\n" for row in (header, *rows))
