"""`mapmore simulate`, `example`, `show`, `freeze` and `schema`: commands that make, print or keep files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from mapmore_cli.cli.console import (
    ARCHIVE,
    NO_OVERRIDES,
    RUNS,
    Archive,
    AsJson,
    Overrides,
    Quiet,
    Runs,
    Unverified,
    print_document,
    print_view,
)


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


def example(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A new folder.", show_default=False)],
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Write a small study to start from.

    Its recordings are of a simulated muscle.
    """
    from mapmore_cli.cli.progress import Reporter
    from mapmore_cli.cli.views.fitted import View
    from mapmore_cli.study.simulation.simulate import write_example

    with Reporter(quiet) as reporter:
        paths = write_example(folder, reporter.progress)
    written = tuple(str(path) for path in paths)
    print_view(View({"files": written}, lines=(*written, "", f"Next: mapmore run {written[0]}")), as_json)


def show(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A file of a run folder, or the folder itself.", show_default=False)],
    as_json: AsJson = False,
    unverified: Unverified = False,
    quiet: Quiet = False,
) -> None:
    """Print what a result file holds."""
    from mapmore_cli.cli.progress import Reporter
    from mapmore_cli.cli.views.files import of_file

    with Reporter(quiet) as reporter:
        view = of_file(file, reporter.warn, unverified)
    print_view(view, as_json)


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


def schema(
    what: Annotated[
        Literal["json", "keys", "formulas", "files"],
        typer.Argument(help="The schema, or a reference as Markdown: keys of the spec, formulas, or what is in result files."),
    ] = "json",
) -> None:
    """Print the JSON Schema of the experiment spec, or a reference."""
    from mapmore_cli.modelling.literature import reference as formulas
    from mapmore_cli.spec.schema import json_schema
    from mapmore_cli.spec.schema import reference as keys
    from mapmore_cli.storage.artefacts.schema import described

    if what == "json":
        print_document(json_schema())
    else:
        print({"keys": keys, "formulas": formulas, "files": described}[what]())
