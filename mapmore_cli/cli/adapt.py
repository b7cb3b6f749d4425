"""`mapmore adapt`: a family's model for one specimen."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mapmore_cli.cli.console import AsJson, Quiet
from mapmore_cli.cli.predict import STANDARD, constants_of


def adapt(
    model_file: Annotated[Path, typer.Argument(metavar="MODEL", help="A model.h5 of a family.", show_default=False)],
    table: Annotated[
        Path | None,
        typer.Argument(metavar="[TABLE]", help="A CSV table of a few measured points: pressure, strain and force.", show_default=False),
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="The model to write.")] = Path("adapted.h5"),
    given: Annotated[
        list[str], typer.Option("--set", metavar="NAME=VALUE", help="What specimens differ in, as length=250 mm.", show_default=False)
    ] = [],  # noqa: B006 - Typer makes a new list of what the user gives
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Adapt a family's model to a specimen by few points.

    The specimen's force and strain each get a scale, with a prior of 1 +- 15 %. The model that is written is of pressure and strain, and
    serves wherever a model does. Without a TABLE, it is that of the dimension alone.
    """
    import sys

    from mapmore_cli.cli.console import print_view
    from mapmore_cli.cli.progress import Reporter
    from mapmore_cli.cli.views.models import of_adapted
    from mapmore_cli.storage.artefacts import read_model, write_model
    from mapmore_cli.storage.text_streams import as_text, lines_of
    from mapmore_cli.study.adapting import adapt

    with Reporter(quiet) as reporter:
        family = read_model(model_file, reporter.warn)
        lines = None
        if table is not None:
            lines = as_text(sys.stdin.buffer) if table == STANDARD else lines_of(table, lambda _read, _size: None)
        model = adapt(family, lines, str(table), constants_of(family, given))
    write_model(output, model)
    print_view(of_adapted(model, str(output)), as_json)
