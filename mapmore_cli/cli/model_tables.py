"""Read the table on which `predict`, `invert` or `adapt` evaluates a model, and write the result
as a table.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, cast

from mapmore_cli.cli.console import STANDARD
from mapmore_cli.cli.progress import Reporter
from mapmore_cli.domain.errors import MapmoreError, UsageError
from mapmore_cli.storage.inputs import note_read

if TYPE_CHECKING:
    from mapmore_cli.domain.models import Model
    from mapmore_cli.pipeline.foreign import TableOptions


def lines_for(
    table: Path,
    model: Model,
    ways: Sequence[Sequence[str]],
    options: TableOptions,
    reporter: Reporter,
) -> tuple[Iterator[str], str]:
    """Open a table of inputs for a model. Return its lines as CSV, and the name by which messages
    call the table.

    If the table is no plain CSV, or if there are `options`, the table is converted to the names and
    units of the model. Each element of `ways` is a list of columns with which the model can be
    evaluated; the converted table has the columns of the first of these lists that the table
    contains completely.

    Raises UsageError for options in combination with stdin.
    """
    from mapmore_cli.pipeline.foreign import foreign_lines, is_foreign, units_of

    if table == STANDARD and options.says_something:
        raise UsageError(
            "stdin is always read as CSV with the names and units of the model, so options for "
            "other tables cannot be used",
            "write the table to a file, and give the path of the file",
        )
    # the output has fewer columns than this table, so it must not replace the table
    if table != STANDARD and is_foreign(table, options):
        note_read([table])
        lines = foreign_lines(table, options, ways, units_of(model, ways), reporter.warn)
        return lines, table.name
    return _open_table(
        table, lambda read, size: reporter.progress("MB read", read // 10**6, -(-size // 10**6))
    )


def _open_table(table: Path, progress: Callable[[int, int], None]) -> tuple[Iterator[str], str]:
    """Open a table, or stdin if the path is `-`. Return the lines, and the name by which messages
    call the table. Raises UsageError if stdin cannot be read.
    """
    from mapmore_cli.storage.tables.lines import as_text, lines_of

    if table != STANDARD:
        return lines_of(table, progress), str(table)
    try:
        os.read(0, 0)
    except OSError as fault:  # stdin may be closed, or it may be a folder
        raise UsageError(
            f"stdin: cannot be read ({os.strerror(fault.errno or 0)})",
            "pipe a table into it, or name a file",
        ) from fault
    return as_text(sys.stdin.buffer), "stdin"


def constants_of(model: Model, settings: Sequence[str]) -> dict[str, float]:
    """Return the values of inputs that `--set` gives, by name, in the units of the model. Raises
    UsageError for an unknown input, or for a text that is no number with a suitable unit.
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


def write_lines(lines: Iterator[str], output: Path) -> None:
    """Write lines to a file or to stdout as soon as they are available."""
    from mapmore_cli.storage.outputs import written_as_text
    from mapmore_cli.storage.tables.lines import TEXT_ERRORS

    if output == STANDARD:
        cast(io.TextIOWrapper, sys.stdout).reconfigure(
            encoding="utf-8", errors=TEXT_ERRORS, newline=""
        )
    with nullcontext(sys.stdout) if output == STANDARD else written_as_text(output) as stream:
        stream.writelines(lines)
