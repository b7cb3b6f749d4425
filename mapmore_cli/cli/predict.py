"""Implement `mapmore predict`, which evaluates a model on a table or a grid, and `mapmore invert`,
which finds the input for a wanted output.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from mapmore_cli.cli.console import NONE, STANDARD, ModelFile, OutputOrStdout, Quiet, Unverified
from mapmore_cli.cli.model_tables import constants_of, lines_for, write_lines
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
from mapmore_cli.domain.errors import UsageError

if TYPE_CHECKING:
    from mapmore_cli.domain.models import Model


def predict(
    model_file: ModelFile,
    table: Annotated[
        Path | None,
        Argument(
            metavar="[TABLE]",
            help="A table with the inputs of the model. Without further options, it is a CSV with "
            "the model's names and units; - is stdin.",
        ),
    ] = None,
    output: OutputOrStdout = STANDARD,
    grid: Annotated[
        str | None,
        Option(
            metavar="AXES",
            help="Make a lookup table instead, for example pressure=0:600:25,strain=0:0.25:0.01.",
        ),
    ] = None,
    given: Annotated[
        list[str],
        Option(
            "--set",
            metavar="NAME=VALUE",
            help=(
                "An input with the same value in every row, for example length=250 mm. Repeatable."
            ),
        ),
    ] = NONE,
    derivatives: Annotated[
        bool,
        Option(
            "--derivatives",
            help="Add the derivative with respect to every input, <output>_by_<input>.",
        ),
    ] = False,
    interval: Annotated[
        float | None,
        Option(
            metavar="LEVEL",
            help="Add <output>_low and <output>_high of an interval, for example 0.95.",
        ),
    ] = None,
    turned_for: Annotated[
        str | None,
        Option(
            "--as",
            metavar="INPUT",
            help=(
                "Invert the model for this input, for example the force of a model that "
                "predicts strain."
            ),
        ),
    ] = None,
    delimiter: Delimiter = None,
    decimal: Decimal = None,
    thousands: Thousands = None,
    sheet: SheetTitle = None,
    columns: Columns = NONE,
    units: Units = NONE,
    unverified: Unverified = False,
    quiet: Quiet = False,
) -> None:
    """Evaluate a model on a table.

    All columns are kept. For each row, <output>_predicted and outside_range (true or false) are
    added.

    A workbook, a Parquet file or another recording is read as in a spec. The same holds for a text
    file with `--delimiter`, `--decimal`, `--thousands`, `--columns` or `--units`. From such a
    table, only the columns that the model needs and the column `recording` are written, in the
    units of the model.

    Tables may be larger than memory, and may be gzipped if the name ends in .gz. If an input is
    empty, the prediction is empty too.

    An interval contains a sample of a new curve with the given probability, within the training
    range. It is computed from data that were left out: the spec of the model needs `validate:
    {intervals: true}`.

    With --as force, a model of the strain returns the force at the strain of each row:
    force_predicted. If no force of the training range gives this strain, the nearest one is
    returned, and outside_range is true.

    A model with memory needs the column time (in s). If the model feeds its output back, it also
    needs the measured output: it runs free from the first rows of every recording, and restarts
    when the column recording changes, when time goes back, and after gaps.
    """
    from mapmore_cli.pipeline.foreign import columns_of
    from mapmore_cli.pipeline.predict import predicted_lines
    from mapmore_cli.storage.artefacts import read_model

    if (table is None) == (grid is None):
        raise UsageError(
            "give either a TABLE or --grid",
            "for example: mapmore predict model.h5 measured.csv -o predicted.csv",
        )
    if turned_for is not None and (grid is not None or derivatives or interval is not None):
        raise UsageError(
            "--as needs a TABLE, and cannot be combined with --grid, --derivatives or --interval",
            "leave out --grid, --derivatives and --interval",
        )
    options = table_options(delimiter, decimal, thousands, sheet, columns, units)
    with Reporter(quiet) as reporter:
        model = read_model(model_file, reporter.warn, unverified)
        constants = constants_of(model, given)
        if table is not None:
            lines, label = lines_for(table, model, columns_of(model, turned_for), options, reporter)
        else:
            assert grid is not None
            lines, label = _lines_of_grid(grid, model, constants), "--grid"
            constants = {}
        added = predicted_lines(
            model,
            lines,
            label,
            warn=reporter.warn,
            derivatives=derivatives,
            interval=interval,
            turned_for=turned_for,
            constants=constants,
        )
        with remedies_by_options(table):
            write_lines(added, output)


def _lines_of_grid(grid: str, model: Model, constants: Mapping[str, float]) -> Iterator[str]:
    """Return the lines of a table with all combinations of the input values on a grid. An input in
    `constants` has the same value in all rows. Raises UsageError for a model with memory.
    """
    from mapmore_cli.modelling.kinds import runs_over_time
    from mapmore_cli.pipeline.records import grid_lines

    if runs_over_time(model):
        needed = ", ".join(["time", *model.input_names])
        raise UsageError(
            "--grid: this model has memory, and a grid contains no time",
            f"give a TABLE of recordings with the columns {needed}",
        )
    axes = ",".join([grid, *(f"{name}={value!r}" for name, value in constants.items())])
    return grid_lines(axes, model.input_names)


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
            metavar="RULE",
            help=(
                "Which of several solutions to write: the `lowest`, or the one that is `nearest` "
                "to the solution of the row before."
            ),
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
    data. For some values of the other inputs, a solution can still lie outside the training range;
    `predict` then writes true in the column outside_range. The status flat means
    that all inputs of a range give the same output, for example when a muscle is slack; the lower
    end of the range is then returned.
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
