"""`mapmore export`: a model for a controller, a simulation, a paper."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from mapmore_cli.cli.console import Quiet
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.storage.atomic import refusals_told, write_bytes


class Target(StrEnum):
    """What a model can be written as."""

    C = "c"
    FMU = "fmu"
    CSV = "csv"
    TEX = "tex"
    PY = "py"
    NUMPY = "numpy"
    TABLE = "table"
    MUJOCO = "mujoco"
    SIMULINK = "simulink"


def export(
    model_file: Annotated[Path, typer.Argument(metavar="MODEL", help="A model.h5.", show_default=False)],
    to: Annotated[Target, typer.Option("--to", help="What to write; see above.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the files.")] = Path(),
    single: Annotated[bool, typer.Option("--float", help="C in single precision.")] = False,
    grid: Annotated[
        str | None,
        typer.Option("--grid", metavar="AXES", help="Points of the table: pressure=0:600:25,strain=0:0.25:0.01.", show_default=False),
    ] = None,
    no_verify: Annotated[bool, typer.Option("--no-verify", help="Do not compare the code with `predict` on 100 points.")] = False,
    quiet: Quiet = False,
) -> None:
    """Write a model in another language.

    The files are called after the model.

    `c` needs nothing but math.h: no allocation, no global state. `fmu` is for co-simulation by FMI 2.0. `py` is one Python file without
    any dependency, for single samples; `numpy` is a module for arrays. `table` is the output on a grid with a mask of validity: CSV, MAT,
    and text for Modelica's CombiTable2D. `mujoco` is C with an actuator callback, `simulink` C with a function for C Caller blocks. `csv`
    is one lookup table, `tex` the equations.

    C, FMUs and modules are compared with `predict` on 100 points before they are written.
    """
    from mapmore_cli.cli.progress import Reporter
    from mapmore_cli.storage.artefacts import read_model
    from mapmore_cli.study.exports import exported

    if single and to is not Target.C:
        raise UsageError("--float is for C alone", "leave it out, or write --to c")
    if (grid is not None and to not in (Target.CSV, Target.TABLE)) or (grid is None and to is Target.CSV):
        raise UsageError("--grid goes with --to csv and --to table", "as in: --to csv --grid pressure=0:600:25,strain=0:0.25:0.01")
    with Reporter(quiet) as reporter:
        files = exported(
            read_model(model_file, reporter.warn), to.value, single=single, grid=grid, verify=not no_verify, warn=reporter.warn
        )
        with refusals_told(output):
            output.mkdir(parents=True, exist_ok=True)
        for name, data in files.items():
            write_bytes(output / name, data)
            if not quiet:
                typer.echo(str(output / name))
