"""`mapmore invert`: the input for a wanted output."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from mapmore_cli.cli.console import Quiet
from mapmore_cli.cli.predict import STANDARD, write_lines


def invert(
    model_file: Annotated[Path, typer.Argument(metavar="MODEL", help="A model.h5 without memory.", show_default=False)],
    table: Annotated[
        Path,
        typer.Argument(metavar="TABLE", help="A CSV table of the wanted output and the other inputs; - is stdin.", show_default=False),
    ],
    name: Annotated[str, typer.Option("--for", metavar="INPUT", help="The input to solve for, as pressure.", show_default=False)],
    rule: Annotated[str, typer.Option("--rule", help="Of several: lowest, or nearest to that of the row before.")] = "lowest",
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="Where to write; - is stdout.")] = STANDARD,
    quiet: Quiet = False,
) -> None:
    """Find the input for a wanted output.

    <input>_found, <input>_solutions (all of them) and <input>_status (none, one, several or flat) are added, row for row.

    Solutions are looked for within the training range. A flat one fills a range, as where a muscle is slack: its low end counts.
    """
    from mapmore_cli.cli.progress import Reporter
    from mapmore_cli.storage.artefacts import read_model
    from mapmore_cli.storage.text_streams import as_text, lines_of
    from mapmore_cli.study.prediction.grid import inverted_lines

    with Reporter(quiet) as reporter:
        model = read_model(model_file, reporter.warn)
        lines = as_text(sys.stdin.buffer) if table == STANDARD else lines_of(table, lambda _read, _size: None)
        write_lines(inverted_lines(model, lines, "stdin" if table == STANDARD else str(table), name, rule), output)
