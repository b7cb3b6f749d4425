"""Commands that make or print files: `mapmore simulate`, `example`, `show`, `schema`, `export` and
`figure`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from mapmore_cli.cli import console
from mapmore_cli.cli.progress import Reporter
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.scores import FIGURES
from mapmore_cli.storage.atomic import refusals_told, write_bytes, write_text


def simulate(
    config: Annotated[
        Path, typer.Argument(metavar="CONFIG", help="The spec of the simulation (YAML).")
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="DIR", help="Where to write; beside CONFIG by default."
        ),
    ] = None,
    overrides: console.Overrides = console.NONE,
    force: Annotated[bool, typer.Option("--force", help="Replace recordings that exist.")] = False,
    as_json: console.AsJson = False,
    quiet: console.Quiet = False,
) -> None:
    """Write recordings of a synthetic muscle."""
    from mapmore_cli.annexes.rig.simulate import SimulationSpec
    from mapmore_cli.annexes.rig.simulate import simulate as run_rig
    from mapmore_cli.spec.loader import load_as

    loaded = load_as(config, SimulationSpec, overrides)
    with Reporter(quiet) as reporter:
        written = tuple(
            map(str, run_rig(loaded.spec, output or loaded.folder, reporter.progress, force))
        )
    console.print_view(
        console.View({"name": loaded.spec.name, "files": written}, lines=written), as_json
    )


def example(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A new folder.")],
    as_json: console.AsJson = False,
    quiet: console.Quiet = False,
) -> None:
    """Write a small study to start from.

    Its recordings are of a simulated muscle.
    """
    from mapmore_cli.annexes.rig.simulate import write_example

    with Reporter(quiet) as reporter:
        written = tuple(map(str, write_example(folder, reporter.progress)))
    console.print_view(
        console.View({"files": written}, lines=(*written, "", f"Next: mapmore run {written[0]}")),
        as_json,
    )


def show(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="A file of a run folder, or the folder itself.")
    ],
    as_json: console.AsJson = False,
    unverified: console.Unverified = False,
    quiet: console.Quiet = False,
) -> None:
    """Print what a result file holds."""
    from mapmore_cli.cli.views import of_file

    with Reporter(quiet) as reporter:
        view = of_file(file, reporter.warn, unverified)
    console.print_view(view, as_json)


def schema(
    what: Annotated[
        Literal["json", "keys", "formulas", "files"],
        typer.Argument(
            help=(
                "The schema, or a reference as Markdown: keys of the spec, formulas, or what "
                "is in result files."
            )
        ),
    ] = "json",
) -> None:
    """Print the JSON Schema of the experiment spec, or a reference."""
    from mapmore_cli.modelling.literature import reference as formulas
    from mapmore_cli.spec.schema import json_schema
    from mapmore_cli.spec.schema import reference as keys
    from mapmore_cli.storage.artefacts.reference import described

    if what == "json":
        console.print_document(json_schema())
    else:
        print({"keys": keys, "formulas": formulas, "files": described}[what]())


def export(
    model_file: console.ModelFile,
    to: Annotated[
        Literal["c", "fmu", "csv", "tex", "py", "numpy", "table", "mujoco", "simulink"],
        typer.Option(help="What to write; see above."),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the files.")
    ] = Path(),
    pressure: Annotated[
        Path | None,
        typer.Option(
            metavar="MODEL", help="A model of the pressure that the force is a function of."
        ),
    ] = None,
    single: Annotated[bool, typer.Option("--float", help="C in single precision.")] = False,
    grid: Annotated[
        str | None,
        typer.Option(
            metavar="AXES", help="Points of the table: pressure=0:600:25,strain=0:0.25:0.01."
        ),
    ] = None,
    no_verify: Annotated[
        bool,
        typer.Option("--no-verify", help="Do not compare the code with `predict` on 100 points."),
    ] = False,
    quiet: console.Quiet = False,
) -> None:
    """Write a model in another language.

    The files are called after the model.

    `c` needs nothing but math.h: no allocation, no global state. `fmu` is for co-simulation by FMI
    2.0. `py` is one Python file without any dependency, for single samples; `numpy` is a module for
    arrays. `table` is the output on a grid with a mask of validity: CSV, MAT, and text for
    Modelica's CombiTable2D. `mujoco` is C with an actuator callback, `simulink` C with a function
    for C Caller blocks. `csv` is one lookup table, `tex` the equations.

    With `--pressure`, a model of the force and one of the pressure become one actuator, in C or as
    an FMU: from what the valve is told.

    C, FMUs and modules are compared with `predict` on 100 points before they are written.
    """
    from mapmore_cli.annexes.exporting.exports import exported
    from mapmore_cli.annexes.sums.joint import actuator
    from mapmore_cli.storage.artefacts import read_model

    if single and to != "c":
        raise UsageError("--float is for C alone", "leave it out, or write --to c")
    if (grid is not None and to not in ("csv", "table")) or (grid is None and to == "csv"):
        raise UsageError(
            "--grid goes with --to csv and --to table",
            "as in: --to csv --grid pressure=0:600:25,strain=0:0.25:0.01",
        )
    if pressure is not None and to not in ("c", "fmu"):
        raise UsageError(
            "--pressure goes with --to c and --to fmu", "export both models one by one"
        )
    with Reporter(quiet) as reporter:
        model = read_model(model_file, reporter.warn)
        if pressure is not None:
            model = actuator(model, read_model(pressure, reporter.warn))
        files = exported(
            model, to, single=single, grid=grid, verify=not no_verify, warn=reporter.warn
        )
        with refusals_told(output):
            output.mkdir(parents=True, exist_ok=True)
        for name, data in files.items():
            write_bytes(output / name, data)
            if not quiet:
                typer.echo(str(output / name))


def figure(
    run: console.RunOrName,
    name: Annotated[str, typer.Argument(metavar="FIGURE", help=f"One of {', '.join(FIGURES)}.")],
    out: Annotated[
        Path,
        typer.Option(
            "--out", "-o", metavar="FILE", help=f"Where to: .{', .'.join(console.FIGURE_FILES)}."
        ),
    ],
    curve: Annotated[
        str | None,
        typer.Option(
            "--curve",
            "--panel",
            metavar="ID",
            help="One panel alone: of a curve (250 or pressure=250), a recording or a model.",
        ),
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Also write what the panel was drawn from (CSV)."),
    ] = None,
    looks: Annotated[
        list[str],
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Another look, as report.style.width=120mm. Repeatable.",
        ),
    ] = console.NONE,
    runs: console.Runs = console.RUNS,
    quiet: console.Quiet = False,
) -> None:
    """Draw one figure of a run as a file.

    All of it, or the panel of one curve by itself, also of a curve that the page leaves out. Width,
    font, size, labels and colours are those of the spec's report.style, or of --set.
    """
    from mapmore_cli.pipeline.report import drawn_figure

    suffix = out.suffix.removeprefix(".")
    if name not in FIGURES:
        raise UsageError(f"there is no figure {name!r}", f"choose one of {', '.join(FIGURES)}")
    console.refuse_endings(
        [out],
        console.FIGURE_FILES,
        f"figures are not written as {out.suffix or 'a file without an ending'}",
    )
    if data is not None and curve is None:
        raise UsageError("--data needs one panel", "name it with --curve")
    with Reporter(quiet) as reporter:
        drawn, numbers = drawn_figure(
            run if run.is_dir() else runs / run, name, curve, suffix, reporter.warn, looks
        )
    write_bytes(out, drawn)
    if data is not None and numbers is not None:
        write_text(data, numbers)
    print(out)
