"""Arguments and options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Config = Annotated[Path, typer.Argument(metavar="CONFIG", help="The experiment spec (YAML).", show_default=False)]

Runs = Annotated[Path, typer.Option("--runs", metavar="DIR", help="Folder of the runs.")]

RUNS = Path("runs")
"""Default of `Runs`."""

Archive = Annotated[Path, typer.Option("--archive", metavar="DIR", help="Folder of the frozen models.")]

ARCHIVE = Path("archive")
"""Default of `Archive`."""

Overrides = Annotated[
    list[str],
    typer.Option("--set", metavar="KEY=VALUE", help="Replace one value of the spec, as fit.max_terms=2. Repeatable.", show_default=False),
]

NO_OVERRIDES: list[str] = []
"""Default of `Overrides`; Typer makes a new list of what the user gives."""

Force = Annotated[bool, typer.Option("--force", help="Redo the stages even if they are up to date.")]

Rehash = Annotated[bool, typer.Option("--rehash", help="Read every recording again to see whether it changed.")]

Explain = Annotated[bool, typer.Option("--explain", help="Say which stages would run, and why; do nothing.")]

AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document instead of tables.")]

Unverified = Annotated[bool, typer.Option("--unverified", help="Read a file although its values are not those that were written.")]

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no warnings on stderr.")]

Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Also say how long each step took.")]
