"""`mapmore figure`: one figure of a run, as a file for a paper."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mapmore_cli.cli.console import NO_OVERRIDES, RUNS, Quiet, Runs
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.page import FIGURES
from mapmore_cli.storage.atomic import write_bytes, write_text

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
    looks: Annotated[
        list[str],
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Another look, as report.style.width=120mm. Repeatable.",
            show_default=False,
        ),
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
        drawn, numbers = drawn_figure(run if run.is_dir() else runs / run, name, curve, suffix, reporter.warn, looks)
    write_bytes(out, drawn)
    if data is not None and numbers is not None:
        write_text(data, numbers)
    print(out)
