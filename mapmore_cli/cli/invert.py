"""Implement `mapmore invert`, which finds the input of a model for a wanted output."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from mapmore_cli.cli.console import NONE, STANDARD, OutputOrStdout, Quiet
from mapmore_cli.cli.model_tables import lines_for, write_lines
from mapmore_cli.cli.progress import Reporter
from mapmore_cli.cli.table_options import (
    Columns,
    Decimal,
    Delimiter,
    SheetTitle,
    Thousands,
    Units,
    remedies_by_options,
    table_options,
)


def invert(
    model_file: Annotated[Path, Argument(metavar="MODEL", help="A model.h5 without memory.")],
    table: Annotated[
        Path,
        Argument(
            metavar="TABLE",
            help="A table of the wanted output and the other inputs, which is read like that of "
            "`predict`; - is stdin.",
        ),
    ],
    name: Annotated[
        str, Option("--for", metavar="INPUT", help="The input to solve for, for example pressure.")
    ],
    rule: Annotated[
        str,
        Option(
            help=(
                "Which of several solutions to write: the lowest, or the one that is nearest to "
                "the solution of the row before."
            )
        ),
    ] = "lowest",
    output: OutputOrStdout = STANDARD,
    delimiter: Delimiter = None,
    decimal: Decimal = None,
    thousands: Thousands = None,
    sheet: SheetTitle = None,
    columns: Columns = NONE,
    units: Units = NONE,
    quiet: Quiet = False,
) -> None:
    """Find the input for a wanted output.

    For each row, three columns are added: <input>_found, <input>_solutions (all solutions) and
    <input>_status (none, one, several or flat; unique if the model has a `fit.shape` along the
    input).

    Solutions are searched between the smallest and the largest value of the input in the training
    data. A solution can still lie beyond the end of the curve at the other inputs: `predict` says
    so (outside_range). The status flat means that all inputs of a range give the same output, for
    example when a muscle is slack; the lower end of the range is then returned.
    """
    from mapmore_cli.pipeline.foreign import columns_of
    from mapmore_cli.pipeline.predict import inverted_lines
    from mapmore_cli.storage.artefacts import read_model

    options = table_options(delimiter, decimal, thousands, sheet, columns, units)
    with Reporter(quiet) as reporter:
        model = read_model(model_file, reporter.warn)
        with remedies_by_options(table):
            lines, label = lines_for(table, model, columns_of(model, name), options, reporter)
            write_lines(inverted_lines(model, lines, label, name, rule), output)
