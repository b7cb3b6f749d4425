"""`mapmore check`: is the spec right, and do its recordings hold what it says?"""

from __future__ import annotations

import typer

from mapmore_cli.cli.options import NO_OVERRIDES, AsJson, Config, Overrides, Quiet


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(check)


def check(
    config: Config,
    overrides: Overrides = NO_OVERRIDES,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Check a spec and its data; compute nothing."""
    from mapmore_cli.cli.console import print_view
    from mapmore_cli.cli.progress import Reporter
    from mapmore_cli.cli.views import measured
    from mapmore_cli.spec.loader import load
    from mapmore_cli.stages.ingestion.dataset import build_dataset
    from mapmore_cli.stages.ingestion.slice import slice_of

    loaded = load(config, overrides)
    with Reporter(quiet) as reporter:
        dataset = build_dataset(slice_of(loaded.spec), loaded.folder, progress=reporter.progress, warn=reporter.warn)
    print_view(measured.of_dataset(dataset).under({"name": loaded.spec.name}), as_json)
