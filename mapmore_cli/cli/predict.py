"""Implement `mapmore predict`, `invert` and `adapt`: evaluate a model on a table or a grid, invert
it, or adapt it to one specimen.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

from typer import Argument, Option

from mapmore_cli.cli.console import (
    NONE,
    STANDARD,
    AsJson,
    ModelFile,
    OutputOrStdout,
    Quiet,
    Unverified,
    View,
    print_view,
    refuse_outputs,
)
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
from mapmore_cli.domain.errors import MapmoreError, UsageError
from mapmore_cli.storage.inputs import note_read

if TYPE_CHECKING:
    from mapmore_cli.domain.models import Model
    from mapmore_cli.pipeline.foreign import TableOptions


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
    from mapmore_cli.modelling.kinds import runs_over_time
    from mapmore_cli.pipeline.foreign import columns_of
    from mapmore_cli.pipeline.predict import predicted_lines
    from mapmore_cli.pipeline.records import grid_lines
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
        constants = _constants_of(model, given)
        if grid is not None:
            if runs_over_time(model):
                needed = ", ".join(["time", *model.input_names])
                raise UsageError(
                    "--grid: this model has memory, and a grid contains no time",
                    f"give a TABLE of recordings with the columns {needed}",
                )
            axes = ",".join([grid, *(f"{name}={value!r}" for name, value in constants.items())])
            lines, label, constants = (
                grid_lines(axes, model.input_names),
                "--grid",
                {},
            )
        else:
            assert table is not None
            wanted = columns_of(model, turned_for)
            lines, label = _lines_of(table, model, wanted, options, reporter)
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
            _write_lines(added, output)


def _lines_of(
    table: Path,
    model: Model,
    ways: Sequence[Sequence[str]],
    options: TableOptions,
    reporter: Reporter,
) -> tuple[Iterator[str], str]:
    """Return the lines of a table in the names and units of the model, and the name of the table
    in messages. The lines have the columns of the first set in `ways` that the table has.
    """
    from mapmore_cli.pipeline.foreign import foreign_lines, is_foreign, units_of

    if table == STANDARD and options.says_something:
        raise UsageError(
            "stdin is always read as CSV with the names and units of the model, so options for "
            "other tables cannot be used",
            "write the table to a file, and give the path of the file",
        )
    # the prediction for a foreign table lacks some of its columns, so it must not replace the table
    if table != STANDARD and is_foreign(table, options):
        note_read([table])
        lines = foreign_lines(table, options, ways, units_of(model, ways), reporter.warn)
        return lines, table.name
    return _open_table(
        table, lambda read, size: reporter.progress("MB read", read // 10**6, -(-size // 10**6))
    )


def _open_table(table: Path, progress: Callable[[int, int], None]) -> tuple[Iterator[str], str]:
    """Return the lines of a table or of stdin, and the name of the table in messages."""
    from mapmore_cli.storage.tables.lines import as_text, lines_of

    if table != STANDARD:
        return lines_of(table, progress), str(table)
    try:
        os.read(0, 0)
    except OSError as fault:  # stdin may be closed, or be a folder
        raise UsageError(
            f"stdin: cannot be read ({os.strerror(fault.errno or 0)})",
            "pipe a table into it, or name a file",
        ) from fault
    return as_text(sys.stdin.buffer), "stdin"


def _constants_of(model: Model, settings: Sequence[str]) -> dict[str, float]:
    """Return the inputs that `--set` gives, in the units of the model. Raises UsageError for an
    unknown input or a value that is no number.
    """
    from mapmore_cli.study.units import parse_quantity

    units = {quantity.name: quantity.unit for quantity in model.inputs}
    constants: dict[str, float] = {}
    for text in settings:
        name, _, value = (part.strip() for part in text.partition("="))
        if name not in units:
            raise UsageError(
                f"--set {text}: the model has no input '{name}'", f"name one of {', '.join(units)}"
            )
        try:
            constants[name] = parse_quantity(value, units[name])
        except MapmoreError as fault:
            raise UsageError(
                f"--set {text}: {fault}",
                f"write, for example, `--set {name}=0.25` in {units[name]}",
            ) from fault
    return constants


def _write_lines(lines: Iterator[str], output: Path) -> None:
    """Write lines to a file or to stdout as soon as they are available."""
    from mapmore_cli.storage.outputs import written_as_text
    from mapmore_cli.storage.tables.lines import TEXT_ERRORS

    if output == STANDARD:
        cast(io.TextIOWrapper, sys.stdout).reconfigure(
            encoding="utf-8", errors=TEXT_ERRORS, newline=""
        )
    with nullcontext(sys.stdout) if output == STANDARD else written_as_text(output) as stream:
        stream.writelines(lines)


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
            lines, label = _lines_of(table, model, columns_of(model, name), options, reporter)
            _write_lines(inverted_lines(model, lines, label, name, rule), output)


ADAPTED = Path("adapted.h5")
"""Name of the model that `adapt` writes if no other is given."""


def adapt(
    model_file: Annotated[Path, Argument(metavar="MODEL", help="The model.h5 of a family.")],
    table: Annotated[
        Path | None,
        Argument(
            metavar="[TABLE]",
            help="A table of a few measured points (pressure, strain and force), which is read "
            "like that of `predict`.",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        Option(
            "--output",
            "-o",
            metavar="FILE",
            callback=refuse_outputs,
            help=f"The model to write. Default: {ADAPTED}.",
        ),
    ] = None,
    given: Annotated[
        list[str],
        Option(
            "--set",
            metavar="NAME=VALUE",
            help="The property in which specimens differ, for example length=250 mm.",
        ),
    ] = NONE,
    delimiter: Delimiter = None,
    decimal: Decimal = None,
    thousands: Thousands = None,
    sheet: SheetTitle = None,
    columns: Columns = NONE,
    units: Units = NONE,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Adapt the model of a family to a specimen by a few points.

    The force is multiplied by one factor and the strain by another. Both are expected to be near 1
    (prior: 1 +- 15 %). The new model has the inputs pressure and strain, and can be used like any
    other model. Without a TABLE, the new model is computed only from the dimension that --set
    gives, and its intervals are the intervals of the family.
    """
    from mapmore_cli.pipeline.adapting import adapt, dimension_of, names_of_points
    from mapmore_cli.reporting.table import Column, Table
    from mapmore_cli.storage.artefacts import read_model, write_model
    from mapmore_cli.storage.outputs import note_chosen, refuse_early, refuse_foreign_file

    chosen, output = output is None, output or ADAPTED
    if chosen:
        refuse_foreign_file(output)
        refuse_early(output)
    options = table_options(delimiter, decimal, thousands, sheet, columns, units)
    with Reporter(quiet) as reporter:
        family = read_model(model_file, reporter.warn)
        dimension_of(family)
        lines, label = None, ""
        if table is not None:
            note_read([table])
            ways = [names_of_points(family)]
            lines, label = _lines_of(table, family, ways, options, reporter)
        with remedies_by_options(table):
            model = adapt(family, lines, label, _constants_of(family, given))
    write_model(output, model)
    if chosen:
        note_chosen(output.parent, [output.name])
    fit = model.backbone
    assert fit is not None
    rows = tuple((name, fit.parameters[name], fit.errors[name]) for name in fit.parameters)
    titles = (Column("scale"), Column("value"), Column("standard error"))
    document = {
        "model": str(output),
        "parameters": fit.parameters,
        "errors": fit.errors,
        "errors_note": fit.errors_note,
        "samples": fit.samples,
        "notes": model.notes,
    }
    notes = (fit.errors_note, *model.notes)
    scales = Table("adapted", f"{model.name}, adapted", titles, rows, notes)
    print_view(View(document, (scales,), (f"model: {output}",)), as_json)
