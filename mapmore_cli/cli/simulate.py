"""`mapmore simulate`: recordings of a synthetic muscle on a synthetic rig."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mapmore_cli.cli.console import NO_OVERRIDES, AsJson, Overrides, Quiet


def simulate(
    config: Annotated[Path, typer.Argument(metavar="CONFIG", help="The spec of the simulation (YAML).", show_default=False)],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="DIR", help="Where to write; beside CONFIG by default.", show_default=False)
    ] = None,
    overrides: Overrides = NO_OVERRIDES,
    force: Annotated[bool, typer.Option("--force", help="Replace recordings that exist.")] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Write recordings of a synthetic muscle."""
    from mapmore_cli.cli.console import print_view
    from mapmore_cli.cli.progress import Reporter
    from mapmore_cli.cli.views.fitted import View
    from mapmore_cli.spec.loader import load_as
    from mapmore_cli.spec.simulation import SimulationSpec
    from mapmore_cli.study.simulation.simulate import simulate as run_rig

    loaded = load_as(config, SimulationSpec, overrides)
    with Reporter(quiet) as reporter:
        paths = run_rig(loaded.spec, output or loaded.folder, reporter.progress, force)
    files = tuple(str(path) for path in paths)
    print_view(View({"name": loaded.spec.name, "files": files}, lines=files), as_json)
