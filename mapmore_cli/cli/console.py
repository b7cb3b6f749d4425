"""Results on stdout: a table for people, or one JSON document. Nothing else of the program prints there."""

from __future__ import annotations

import errno
import json
import math
import os
import sys
import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mapmore_cli.domain.errors import LimitMissed, MapmoreError, Stopped, WriteError, explained, told
from mapmore_cli.domain.foreign import printable

if TYPE_CHECKING:
    from mapmore_cli.cli.views.fitted import View


def print_document(document: Mapping[str, Any]) -> None:
    """Print one JSON document; NaN and infinities, which JSON does not have, become null."""
    print(json.dumps(plain(document), indent=2, allow_nan=False))


def plain(value: Any) -> Any:
    """Rebuild a document from what JSON knows: arrays and tuples become lists, non-finite numbers None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):  # NumPy arrays and scalars, without importing NumPy for documents that have none
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def print_view(view: View, as_json: bool) -> None:
    """Print a result as one JSON document, or as its tables with a blank line between."""
    if as_json:
        print_document(view.document)
        return
    from mapmore_cli.reporting.table import to_text

    blocks = [to_text(table).rstrip("\n") for table in view.tables]
    if view.lines:
        blocks.append("\n".join(view.lines))
    print(printable("\n\n".join(blocks)))


Config = Annotated[Path, typer.Argument(metavar="CONFIG", help="The experiment spec (YAML).", show_default=False)]

Runs = Annotated[Path, typer.Option("--runs", metavar="DIR", help="Folder of the runs.")]

RUNS = Path("runs")
"""Default of `Runs`."""

Archive = Annotated[Path, typer.Option("--archive", metavar="DIR", help="Folder of the frozen models.")]

ARCHIVE = Path("archive")
"""Default of `Archive`."""

Overrides = Annotated[
    list[str],
    typer.Option("--set", metavar="KEY=VALUE", help="Replace one value of the spec, as fit.max_terms=2. Repeatable.", show_default=False),
]

NO_OVERRIDES: list[str] = []
"""Default of `Overrides`; Typer makes a new list of what the user gives."""

Force = Annotated[bool, typer.Option("--force", help="Redo the stages even if they are up to date.")]

Rehash = Annotated[bool, typer.Option("--rehash", help="Read every recording again to see whether it changed.")]

Explain = Annotated[bool, typer.Option("--explain", help="Say which stages would run, and why; do nothing.")]

AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document instead of tables.")]

Unverified = Annotated[bool, typer.Option("--unverified", help="Read a file although its values are not those that were written.")]

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no warnings on stderr.")]

Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Also say how long each step took.")]


INTERNAL_FAULT = 1
INTERRUPTED = 130  # 128 + SIGINT, as shells report it
BROKEN_PIPE = 141  # 128 + SIGPIPE


def settle(error: BaseException, debug: bool, as_json: bool) -> int:
    """Say on stderr what went wrong, and return the exit code; the traceback is for `--debug` alone.

    With `--json` the error is the document on stdout too, unless that has been printed: a missed limit stands in it.
    """
    if isinstance(error, BrokenPipeError):
        _silence_stdout()
        return BROKEN_PIPE
    if isinstance(error, OSError) and error.errno == errno.ENOSPC:  # files are storage's to explain, so this is stdout
        _silence_stdout()
        error = WriteError("stdout: cannot be written (no space left on device)", "make room, or write elsewhere")
    if isinstance(error, OSError) and error.errno == errno.EBADF:
        _silence_stdout()
        error = WriteError("stdout: cannot be written (it is closed)", "do not close it; `-q` and `> /dev/null` keep quiet")
    if debug:
        traceback.print_exception(error, file=sys.stderr)
    else:
        print(printable(message(error)), file=sys.stderr)
    if as_json and not isinstance(explained(error), LimitMissed | KeyboardInterrupt):
        print_document({"error": error_document(error)})
    return exit_code(error)


def error_document(error: BaseException) -> dict[str, object]:
    """Return an error as a member of a JSON document."""
    error = explained(error)
    if isinstance(error, MapmoreError):
        return {"message": error.message, "remedy": error.remedy, "exit_code": error.exit_code}
    return {"message": told(error), "remedy": None, "exit_code": exit_code(error)}


def exit_code(error: BaseException) -> int:
    """Return the code that a command ends with."""
    error = explained(error)
    if isinstance(error, MapmoreError):
        return error.exit_code
    if isinstance(error, Stopped):
        return 128 + error.number
    return INTERRUPTED if isinstance(error, KeyboardInterrupt) else INTERNAL_FAULT


def message(error: BaseException) -> str:
    """Return what a user is told; an internal fault is one line."""
    error = explained(error)
    if isinstance(error, KeyboardInterrupt):
        return str(error) or "interrupted"
    return f"error: {told(error)}" if isinstance(error, MapmoreError) else told(error)


def _silence_stdout() -> None:
    """Point stdout at nothing: Python would complain when it cannot flush the rest at exit."""
    devnull = os.open(os.devnull, os.O_WRONLY)
    os.dup2(devnull, sys.stdout.fileno())
