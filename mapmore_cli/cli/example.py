"""`mapmore example`: a small study to start from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mapmore_cli.cli.console import AsJson, Quiet


def example(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A new folder.", show_default=False)],
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Write a small study to start from.

    Its recordings are of a simulated muscle.
    """
    from mapmore_cli.cli.console import print_view
    from mapmore_cli.cli.progress import Reporter
    from mapmore_cli.cli.views.fitted import View
    from mapmore_cli.study.simulation.simulate import write_example

    with Reporter(quiet) as reporter:
        paths = write_example(folder, reporter.progress)
    written = tuple(str(path) for path in paths)
    print_view(View({"files": written}, lines=(*written, "", f"Next: mapmore run {written[0]}")), as_json)
