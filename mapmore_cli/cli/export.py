"""`mapmore export`: a model for a controller, a simulation, a paper. `mapmore figure`: one figure of a run."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from mapmore_cli.cli.console import NO_OVERRIDES, RUNS, Quiet, Runs
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.scores import FIGURES
from mapmore_cli.storage.atomic import refusals_told, write_bytes, write_text


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
    pressure: Annotated[
        Path | None,
        typer.Option("--pressure", metavar="MODEL", help="A model of the pressure that the force is a function of.", show_default=False),
    ] = None,
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

    With `--pressure`, a model of the force and one of the pressure become one actuator, in C or as an FMU: from what the valve is told.

    C, FMUs and modules are compared with `predict` on 100 points before they are written.
    """
    from mapmore_cli.cli.progress import Reporter
    from mapmore_cli.modelling.sums.joint import actuator
    from mapmore_cli.storage.artefacts import read_model
    from mapmore_cli.study.exports import exported

    if single and to is not Target.C:
        raise UsageError("--float is for C alone", "leave it out, or write --to c")
    if (grid is not None and to not in (Target.CSV, Target.TABLE)) or (grid is None and to is Target.CSV):
        raise UsageError("--grid goes with --to csv and --to table", "as in: --to csv --grid pressure=0:600:25,strain=0:0.25:0.01")
    if pressure is not None and to not in (Target.C, Target.FMU):
        raise UsageError("--pressure goes with --to c and --to fmu", "export both models one by one")
    with Reporter(quiet) as reporter:
        model = read_model(model_file, reporter.warn)
        if pressure is not None:
            model = actuator(model, read_model(pressure, reporter.warn))
        files = exported(model, to.value, single=single, grid=grid, verify=not no_verify, warn=reporter.warn)
        with refusals_told(output):
            output.mkdir(parents=True, exist_ok=True)
        for name, data in files.items():
            write_bytes(output / name, data)
            if not quiet:
                typer.echo(str(output / name))


SUFFIXES = ("svg", "pdf", "png", "pgf")


def figure(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A run folder, or the name of a run.", show_default=False)],
    name: Annotated[str, typer.Argument(metavar="FIGURE", help=f"One of {', '.join(FIGURES)}.", show_default=False)],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FILE", help=f"Where to: .{', .'.join(SUFFIXES)}.", show_default=False)],
    curve: Annotated[
        str | None,
        typer.Option("--curve", "--panel", metavar="ID", help="One panel alone: of a curve (250 or pressure=250), a recording or a model."),
    ] = None,
    data: Annotated[Path | None, typer.Option("--data", metavar="FILE", help="Also write what the panel was drawn from (CSV).")] = None,
    models: Annotated[
        str | None, typer.Option("--models", metavar="A,B", help="Competitors to draw, as sarosi,plane; else all.", show_default=False)
    ] = None,
    looks: Annotated[
        list[str],
        typer.Option("--set", metavar="KEY=VALUE", help="Another look, as report.style.width=120mm. Repeatable.", show_default=False),
    ] = NO_OVERRIDES,
    runs: Runs = RUNS,
    quiet: Quiet = False,
) -> None:
    """Draw one figure of a run as a file.

    All of it, or the panel of one curve by itself, also of a curve that the page leaves out. Width, font, size, labels and colours are
    those of the spec's report.style, or of --set.
    """
    from mapmore_cli.cli.progress import Reporter
    from mapmore_cli.pipeline.report import drawn_figure

    suffix = out.suffix.removeprefix(".")
    if name not in FIGURES:
        raise UsageError(f"there is no figure {name!r}", f"choose one of {', '.join(FIGURES)}")
    if suffix not in SUFFIXES:
        raise UsageError(f"{out}: figures are not written as {out.suffix or 'a file without an ending'}", f"choose .{', .'.join(SUFFIXES)}")
    if data is not None and curve is None:
        raise UsageError("--data needs one panel", "name it with --curve")
    with Reporter(quiet) as reporter:
        wanted = [] if models is None else [one.strip() for one in models.split(",") if one.strip()]
        drawn, numbers = drawn_figure(run if run.is_dir() else runs / run, name, curve, suffix, reporter.warn, looks, wanted)
    write_bytes(out, drawn)
    if data is not None and numbers is not None:
        write_text(data, numbers)
    print(out)
