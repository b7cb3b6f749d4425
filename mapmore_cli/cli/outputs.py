"""Results that a command writes beside what it prints: a figure or a table, by the ending of the file; and what machines read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mapmore_cli.domain.errors import UsageError
from mapmore_cli.storage.atomic import write_bytes, write_text

if TYPE_CHECKING:
    from mapmore_cli.reporting.ci import RunReport
    from mapmore_cli.reporting.figures.drawing import Drawing
    from mapmore_cli.reporting.table import Table

FIGURES, TABLES = ("svg", "pdf", "png", "pgf"), ("csv", "tex")

Outputs = Annotated[
    list[Path] | None,
    typer.Option(
        "--output", "-o", metavar="FILE", help="Also write the figure (.svg .pdf .png .pgf) or the table (.csv .tex). Repeatable."
    ),
]


def refuse_unknown(paths: Sequence[Path], endings: Sequence[str] = (*FIGURES, *TABLES)) -> None:
    """Refuse files that end otherwise, before anything is computed."""
    for path in paths:
        if path.suffix.removeprefix(".") not in endings:
            raise UsageError(f"{path}: neither a figure nor a table ends so", f"choose .{', .'.join(endings)}")


def write_result(path: Path, table: Callable[[], Table], drawing: Callable[[], Drawing]) -> None:
    """Write the figure or the table."""
    suffix = path.suffix.removeprefix(".")
    if suffix in TABLES:
        write_table(path, table())
        return
    from mapmore_cli.reporting.figures.drawing import WRITERS, compose
    from mapmore_cli.reporting.figures.style import figure_style

    drawn = drawing()
    with figure_style():
        write_bytes(path, WRITERS[suffix](compose(drawn), drawn.name, drawn.alt))


def write_table(path: Path, table: Table) -> None:
    """Write a table as CSV or LaTeX."""
    from mapmore_cli.reporting.table import to_csv, to_latex

    write_text(path, (to_csv if path.suffix == ".csv" else to_latex)(table))


Junit = Annotated[Path | None, typer.Option("--junit", metavar="FILE", help="Also write how the runs ended, as JUnit XML.")]

Summary = Annotated[Path | None, typer.Option("--summary", metavar="FILE", help="Also write a summary with the score tables (Markdown).")]


@dataclass(frozen=True)
class CiFiles:
    """Where to write what, if anything."""

    junit: Path | None = None
    summary: Path | None = None

    def write(self, runs: Sequence[RunReport], tables: Sequence[Table] = ()) -> None:
        """Write the files that are asked for."""
        if self.junit is None and self.summary is None:
            return
        from mapmore_cli.reporting.ci import to_junit, to_summary

        if self.junit is not None:
            write_text(self.junit, to_junit(runs))
        if self.summary is not None:
            write_text(self.summary, to_summary(runs, tables))
