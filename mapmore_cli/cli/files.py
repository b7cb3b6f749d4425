"""`mapmore simulate`, `example`, `show`, `freeze` and `schema`: commands that make, print or keep files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from mapmore_cli.cli import console
from mapmore_cli.cli.progress import Reporter


def simulate(
    config: Annotated[Path, typer.Argument(metavar="CONFIG", help="The spec of the simulation (YAML).")],
    output: Annotated[Path | None, typer.Option("--output", "-o", metavar="DIR", help="Where to write; beside CONFIG by default.")] = None,
    overrides: console.Overrides = console.NONE,
    force: Annotated[bool, typer.Option("--force", help="Replace recordings that exist.")] = False,
    as_json: console.AsJson = False,
    quiet: console.Quiet = False,
) -> None:
    """Write recordings of a synthetic muscle."""
    from mapmore_cli.spec.loader import load_as
    from mapmore_cli.spec.simulation import SimulationSpec
    from mapmore_cli.study.simulation.simulate import simulate as run_rig

    loaded = load_as(config, SimulationSpec, overrides)
    with Reporter(quiet) as reporter:
        paths = run_rig(loaded.spec, output or loaded.folder, reporter.progress, force)
    files = tuple(str(path) for path in paths)
    console.print_view(console.View({"name": loaded.spec.name, "files": files}, lines=files), as_json)


def example(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A new folder.")],
    as_json: console.AsJson = False,
    quiet: console.Quiet = False,
) -> None:
    """Write a small study to start from.

    Its recordings are of a simulated muscle.
    """
    from mapmore_cli.study.simulation.simulate import write_example

    with Reporter(quiet) as reporter:
        paths = write_example(folder, reporter.progress)
    written = tuple(str(path) for path in paths)
    console.print_view(console.View({"files": written}, lines=(*written, "", f"Next: mapmore run {written[0]}")), as_json)


def show(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A file of a run folder, or the folder itself.")],
    as_json: console.AsJson = False,
    unverified: console.Unverified = False,
    quiet: console.Quiet = False,
) -> None:
    """Print what a result file holds."""
    from mapmore_cli.cli.views.files import of_file

    with Reporter(quiet) as reporter:
        view = of_file(file, reporter.warn, unverified)
    console.print_view(view, as_json)


def freeze(
    run: console.RunOrName,
    tag: Annotated[str, typer.Option("--tag", metavar="TAG", help="What this campaign is called, as 2026-spring.")],
    archive: console.Archive = console.ARCHIVE,
    runs: console.Runs = console.RUNS,
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
    from mapmore_cli.storage.artefacts.layout import described

    if what == "json":
        console.print_document(json_schema())
    else:
        print({"keys": keys, "formulas": formulas.reference, "files": described}[what]())
