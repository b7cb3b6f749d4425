"""Implement `mapmore show`, `figure`, `schema` and `example`: print a result file, draw a figure of
a run, print the schema of the spec, and copy an example study.
"""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import Annotated, Literal

from typer import Argument, Option

from mapmore_cli.cli.console import (
    FIGURE_FILES,
    NONE,
    RUNS,
    AsJson,
    Quiet,
    RunOrName,
    Runs,
    Unverified,
    folder_of,
    output_option,
    print_document,
    print_view,
    refuse_endings,
)
from mapmore_cli.cli.progress import Reporter
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.reporting.order import FIGURES


def show(
    file: Annotated[
        Path, Argument(metavar="FILE", help="A file of a run folder, or the folder itself.")
    ],
    as_json: AsJson = False,
    unverified: Unverified = False,
    quiet: Quiet = False,
) -> None:
    """Print the contents of a result file."""
    from mapmore_cli.cli.views import of_file

    with Reporter(quiet) as reporter:
        view = of_file(file, reporter.warn, unverified)
    print_view(view, as_json)


def example(
    folder: Annotated[Path, Argument(metavar="DIR", help="A new folder.")],
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Copy a small example study. The name of the study is the name of the folder.

    The recordings of the example are from a simulated muscle.
    """
    from mapmore_cli.cli.console import View
    from mapmore_cli.pipeline.example import write_example

    with Reporter(quiet):
        written = tuple(map(str, write_example(folder)))
    lines = (*written, "", f"Next: mapmore run {quote(written[0])}")
    print_view(View({"files": written}, lines=lines), as_json)


def schema(
    what: Annotated[
        Literal["json", "keys", "formulas", "files"],
        Argument(
            help=(
                "The schema, or a description as Markdown: of the keys of the spec, of the "
                "formulas, or of the result files."
            )
        ),
    ] = "json",
) -> None:
    """Print the JSON Schema of the spec, or a reference as Markdown."""
    from mapmore_cli.modelling.literature import reference as formulas
    from mapmore_cli.storage.artefacts.reference import described
    from mapmore_cli.study.schema import json_schema
    from mapmore_cli.study.schema import reference as keys

    if what == "json":
        print_document(json_schema())
    else:
        print({"keys": keys, "formulas": formulas, "files": described}[what]())


def figure(
    run: RunOrName,
    name: Annotated[
        str,
        Argument(
            metavar="FIGURE",
            help=f"One of {', '.join(FIGURES)}; with several outputs OUTPUT.FIGURE.",
        ),
    ],
    out: Annotated[
        Path | None,
        output_option(
            f"Output file: .{', .'.join(FIGURE_FILES)}. Default: FIGURE.FORMAT.", "--out", "-o"
        ),
    ] = None,
    form: Annotated[
        Literal["svg", "pdf", "png", "pgf"],
        Option("--format", help="Format of the file if --out is not given."),
    ] = "svg",
    width: Annotated[
        str | None,
        Option(
            metavar="WIDTH",
            help="Width of the whole figure, or of the one panel, for example 85mm.",
        ),
    ] = None,
    curve: Annotated[
        str | None,
        Option(
            "--curve",
            "--panel",
            metavar="ID",
            help=(
                "Draw one panel only: that of a curve (250 or pressure=250), a recording or a "
                "model."
            ),
        ),
    ] = None,
    models: Annotated[
        str | None,
        Option(
            metavar="A,B",
            help="Competitors to draw, for example sarosi,plane. Default: those on the page.",
        ),
    ] = None,
    data: Annotated[
        Path | None,
        output_option("Also write the data of the panel (CSV).", "--data"),
    ] = None,
    looks: Annotated[
        list[str],
        Option(
            "--set",
            metavar="KEY=VALUE",
            help="Change the look, for example report.style.width=120mm. Repeatable.",
        ),
    ] = NONE,
    runs: Runs = RUNS,
    quiet: Quiet = False,
) -> None:
    """Draw one figure of a run and write it to a file.

    With --curve, only one panel is drawn, even a panel that the page leaves out. Width, font, size,
    labels and colours are taken from the spec's report.style, or from --set.
    """
    from mapmore_cli.pipeline.report import drawn_figure
    from mapmore_cli.storage.outputs import (
        refuse_early,
        write_bytes,
        write_chosen,
        write_text,
    )
    from mapmore_cli.storage.run_record import load_records

    chosen = out is None
    out = out or Path(f"{name}.{form}")
    suffix = out.suffix.removeprefix(".")
    looks = [*looks, *([f"report.style.width={width}"] if width else [])]
    if name.rpartition(".")[2] not in FIGURES:
        raise UsageError(f"there is no figure {name!r}", f"choose one of {', '.join(FIGURES)}")
    refuse_endings(
        [out],
        FIGURE_FILES,
        f"figures cannot be written as {out.suffix or 'a file without an ending'}",
    )
    if data is not None and curve is None:
        raise UsageError(
            "--data writes the numbers of one panel of the figure, and no panel is named",
            "name its curve with --curve",
        )
    if chosen:
        refuse_early(out, chosen)
    wanted = [model.strip() for model in (models or "").split(",") if model.strip()]
    folder = folder_of(run, runs)
    # this marks the source files of the run as read, so that the figure cannot replace them
    load_records(folder)
    with Reporter(quiet) as reporter:
        drawn, numbers = drawn_figure(folder, name, curve, suffix, reporter.warn, looks, wanted)
    if chosen:
        write_chosen(out.parent, {out.name: drawn})
    else:
        write_bytes(out, drawn)
    if data is not None and numbers is not None:
        write_text(data, numbers)
    print(out)
