"""`mapmore clean`: remove the runs that no spec names."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from mapmore_cli.cli.console import RUNS, AsJson, Runs, View, print_view
from mapmore_cli.domain.errors import UsageError


def clean(
    configs: Annotated[
        list[Path],
        Argument(metavar="CONFIG...", help="All specs and campaigns whose runs are kept."),
    ],
    runs: Runs = RUNS,
    yes: Annotated[bool, Option("--yes", help="Remove what is listed.")] = False,
    as_json: AsJson = False,
) -> None:
    """List the runs that no spec names, and remove them with --yes.

    Kept are the runs of the specs and campaigns, their variations, and the runs that they are built
    on or compared with; and every folder that is no run.
    """
    from mapmore_cli.pipeline.staleness import named_runs
    from mapmore_cli.storage.atomic import remove
    from mapmore_cli.storage.run_folder import run_lock
    from mapmore_cli.storage.run_record import load_origin
    from mapmore_cli.study.campaign import expanded
    from mapmore_cli.study.loader import load

    if not runs.is_dir():
        raise UsageError(f"{runs}: there is no such folder", "name the folder of the runs, --runs")
    entries = expanded(configs, ())[1]
    kept = named_runs([load(entry.config, entry.overrides) for entry in entries])
    unnamed = [
        folder
        for folder in sorted(runs.iterdir())
        if folder.name not in kept and not folder.is_symlink() and load_origin(folder)
    ]
    for folder in unnamed if yes else ():
        with run_lock(folder):
            remove(folder)
    names = [str(folder) for folder in unnamed]
    end = f"{len(names)} removed" if yes else f"{len(names)} would be removed; add --yes"
    document = {"unnamed": names, "removed": yes}
    print_view(View(document, lines=(*names, end)), as_json)
