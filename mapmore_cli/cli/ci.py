"""`--junit` and `--summary`: how runs ended, as files for machines that run tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from mapmore_cli.reporting.ci import RunReport
    from mapmore_cli.reporting.table import Table

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
        from mapmore_cli.storage.atomic import write_text

        if self.junit is not None:
            write_text(self.junit, to_junit(runs))
        if self.summary is not None:
            write_text(self.summary, to_summary(runs, tables))
