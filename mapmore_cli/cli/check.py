"""`mapmore check`: is the spec right, do its recordings hold what it says, and does anything look like a mistake?"""

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
    from mapmore_cli.cli.views import inspected
    from mapmore_cli.spec.loader import load
    from mapmore_cli.stages.inspection.lint import inspect

    loaded = load(config, overrides)
    with Reporter(quiet) as reporter:
        inspection = inspect(loaded, progress=reporter.progress, warn=reporter.warn)
    print_view(inspected.of_inspection(inspection).under({"name": loaded.spec.name}), as_json)
    if inspection.verdict is not None:
        raise inspection.verdict
