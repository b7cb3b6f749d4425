"""`mapmore show`: print any result file, or a run folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mapmore_cli.cli.options import AsJson


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(show)


def show(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A file of a run folder, or the folder itself.", show_default=False)],
    as_json: AsJson = False,
) -> None:
    """Print what a result file holds."""
    from mapmore_cli.cli.console import print_view
    from mapmore_cli.cli.views.files import of_file

    print_view(of_file(file), as_json)
