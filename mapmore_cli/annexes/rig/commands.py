"""Recordings of synthetic muscles: `mapmore simulate` and `mapmore example`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mapmore_cli.cli import console
from mapmore_cli.cli.progress import Reporter


def simulate(
    config: Annotated[
        Path, typer.Argument(metavar="CONFIG", help="The spec of the simulation (YAML).")
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="DIR", help="Where to write; beside CONFIG by default."
        ),
    ] = None,
    overrides: console.Overrides = console.NONE,
    force: Annotated[bool, typer.Option("--force", help="Replace recordings that exist.")] = False,
    as_json: console.AsJson = False,
    quiet: console.Quiet = False,
) -> None:
    """Write recordings of a synthetic muscle."""
    from mapmore_cli.annexes.rig.simulate import SimulationSpec
    from mapmore_cli.annexes.rig.simulate import simulate as run_rig
    from mapmore_cli.study.loader import load_as

    loaded = load_as(config, SimulationSpec, overrides)
    with Reporter(quiet) as reporter:
        written = tuple(
            map(str, run_rig(loaded.spec, output or loaded.folder, reporter.progress, force))
        )
    console.print_view(
        console.View({"name": loaded.spec.name, "files": written}, lines=written), as_json
    )


def example(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A new folder.")],
    as_json: console.AsJson = False,
    quiet: console.Quiet = False,
) -> None:
    """Write a small study to start from.

    Its recordings are of a simulated muscle.
    """
    from mapmore_cli.annexes.rig.simulate import write_example

    with Reporter(quiet) as reporter:
        written = tuple(map(str, write_example(folder, reporter.progress)))
    console.print_view(
        console.View({"files": written}, lines=(*written, "", f"Next: mapmore run {written[0]}")),
        as_json,
    )
