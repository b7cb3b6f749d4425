"""Implement `mapmore export`: write a model in another language."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mapmore_cli.cli import console
from mapmore_cli.cli.progress import Reporter
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.storage.outputs import refuse_early, write_chosen


def export(
    model_file: console.ModelFile,
    to: Annotated[
        str,
        typer.Option(metavar="FORM", help="The format to write; the list is above."),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the files.")
    ] = Path(),
    pressure: Annotated[
        Path | None,
        typer.Option(
            metavar="MODEL",
            help="Model of the pressure, which makes one actuator with the model of the force.",
        ),
    ] = None,
    single: Annotated[bool, typer.Option("--float", help="C in single precision.")] = False,
    grid: Annotated[
        str | None,
        typer.Option(
            metavar="AXES", help="Points of `table` or `csv`: pressure=0:600:25,strain=0:0.25:0.01."
        ),
    ] = None,
    no_verify: Annotated[
        bool,
        typer.Option("--no-verify", help="Do not compare the code with `predict` on 100 points."),
    ] = False,
    quiet: console.Quiet = False,
) -> None:
    """Write a model in another language.

    The files have the name of the model. They replace only files that mapmore has written and
    that nobody has changed since.

    `c` needs only math.h, allocates no memory and has no global state. `fmu` is an FMU for
    co-simulation with FMI 2.0, `fmu3` with FMI 3.0. `py` is one Python file without any dependency,
    for single samples; `numpy` is a module for arrays, `matlab` one function file, for Octave too.
    `js` is one module of JavaScript for browsers and Node. `table` is the output on a grid, with a
    mask of valid points: as CSV, as MAT, and as a Modelica block with text for CombiTable2Ds.
    `mujoco` is C with an actuator callback, `simulink` is C with a function for C Caller blocks;
    these two are not compared with `predict`. `csv` is one lookup table, and `tex` holds the
    equations.

    With `--pressure`, a model of the force and one of the pressure become one actuator, with `--to
    c` or `--to fmu`. Its input is then the command of the valve.

    For a model with several outputs, C and equations contain all of them; other forms are written
    for each output.

    C, FMUs, modules and functions are compared with `predict` on 100 points before they are
    written. If the compiler or the interpreter is missing, a warning says so. At the end, lines
    that call the exported code are printed.
    """
    from mapmore_cli.annexes.exporting.exports import (
        EXPORTERS,
        exported,
        names_of_files,
        snippet,
    )
    from mapmore_cli.modelling import kinds
    from mapmore_cli.storage.artefacts import read_model

    used = {"--float": single, "--grid": grid is not None, "--pressure": pressure is not None}
    for option, is_used in used.items():
        forms = [f"--to {name}" for name, form in EXPORTERS.items() if option in form.options]
        if is_used and f"--to {to}" not in forms:
            raise UsageError(
                f"{option} works with {' and '.join(forms)} only",
                f"leave {option} out, or choose another form",
            )
    if to == "csv" and grid is None:
        raise UsageError(
            "--to csv needs --grid, which gives the points of the table",
            "for example: --grid pressure=0:600:25,strain=0:0.25:0.01",
        )
    with Reporter(quiet) as reporter:
        model = read_model(model_file, reporter.warn)
        if pressure is not None:
            kinds.named("sum")  # this raises NotInstalled if the annex `sums` is missing
            from mapmore_cli.annexes.sums.joint import actuator

            valve = kinds.alone(read_model(pressure, reporter.warn))
            model = actuator(kinds.alone(model), valve)
        # a folder that does not exist yet contains no file that could be overwritten
        if output.is_dir():
            for name in names_of_files(model, to):
                refuse_early(output / name, chosen=True)
        files = exported(
            model, to, single=single, grid=grid, verify=not no_verify, warn=reporter.warn
        )
        for path in write_chosen(output, files):
            if not quiet:
                typer.echo(str(path))
        if not quiet and (lines := snippet(model, to, list(files))):
            typer.echo(f"\nTo call it there:\n\n{lines}", err=True)
