"""`mapmore show`: print any result file, or a run folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mapmore_cli.cli.console import AsJson, Quiet, Unverified


def show(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A file of a run folder, or the folder itself.", show_default=False)],
    as_json: AsJson = False,
    unverified: Unverified = False,
    quiet: Quiet = False,
) -> None:
    """Print what a result file holds."""
    from mapmore_cli.cli.console import print_view
    from mapmore_cli.cli.progress import Reporter
    from mapmore_cli.cli.views.files import of_file

    with Reporter(quiet) as reporter:
        view = of_file(file, reporter.warn, unverified)
    print_view(view, as_json)
