"""`mapmore freeze`: keep a model under a name that no later run overwrites."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mapmore_cli.cli.console import ARCHIVE, RUNS, Archive, Runs


def freeze(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A run folder, or the name of a run.", show_default=False)],
    tag: Annotated[str, typer.Option("--tag", metavar="TAG", help="What this campaign is called, as 2026-spring.", show_default=False)],
    archive: Archive = ARCHIVE,
    runs: Runs = RUNS,
) -> None:
    """Keep the model of a run under a tag.

    Its scores, spec and hashes go with it, to ARCHIVE/NAME@TAG, where no later run writes.
    """
    from mapmore_cli.study.campaigns import archive as frozen

    print(frozen.freeze(run if run.is_dir() else runs / run, tag, archive))
