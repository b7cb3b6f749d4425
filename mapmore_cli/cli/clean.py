"""`mapmore clean`: remove the runs that no spec names."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mapmore_cli.cli import console
from mapmore_cli.domain.errors import UsageError


def clean(
    configs: Annotated[
        list[Path],
        typer.Argument(metavar="CONFIG...", help="All specs and campaigns whose runs are kept."),
    ],
    runs: console.Runs = console.RUNS,
    yes: Annotated[bool, typer.Option("--yes", help="Remove what is listed.")] = False,
    as_json: console.AsJson = False,
) -> None:
    """List the runs that no spec names, and remove them with --yes.

    Kept are the runs of the specs and campaigns, their variations, and the runs that they are built
    on or compared with. What mapmore did not write is left alone.
    """
    from mapmore_cli.pipeline.staleness import named_runs
    from mapmore_cli.spec.campaign import expanded
    from mapmore_cli.spec.loader import load
    from mapmore_cli.storage.atomic import remove
    from mapmore_cli.storage.run_folder import is_of_mapmore, run_lock

    if not runs.is_dir():
        raise UsageError(f"{runs}: there is no such folder", "name the folder of the runs, --runs")
    campaigns, entries = expanded(configs, ())
    kept = {one.campaign.campaign for one in campaigns}
    kept |= named_runs([load(entry.config, entry.overrides) for entry in entries])
    found = [path for path in sorted(runs.iterdir()) if path.name not in kept and path.is_dir()]
    unnamed = [path for path in found if not path.is_symlink() and is_of_mapmore(path)]
    for path in unnamed if yes else ():
        with run_lock(path):
            remove(path)
    end = "removed" if yes else "would be removed; add --yes"
    lines = (*map(str, unnamed), f"{len(unnamed)} {'run' if len(unnamed) == 1 else 'runs'} {end}")
    console.print_view(
        console.View({"unnamed": list(map(str, unnamed)), "removed": yes}, lines=lines), as_json
    )
