"""How a command ends: the exit code and the one message of every kind of error.

The codes 2 to 7 sit on the error classes (`domain.errors`); here are the others, and the only place that turns an exception into a code.
"""

from __future__ import annotations

import errno
import os
import sys
import traceback

from mapmore_cli.cli.console import print_document
from mapmore_cli.domain.errors import LimitMissed, MapmoreError, Stopped, WriteError, explained, told
from mapmore_cli.domain.foreign import printable

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
    if debug:
        traceback.print_exception(error, file=sys.stderr)
    else:
        print(printable(message(error)), file=sys.stderr)
    if as_json and not isinstance(explained(error), LimitMissed | KeyboardInterrupt):
        print_document({"error": error_document(error)})
    return exit_code(error)


def error_document(error: BaseException) -> dict[str, object]:
    """An error as a member of a JSON document."""
    error = explained(error)
    if isinstance(error, MapmoreError):
        return {"message": error.message, "remedy": error.remedy, "exit_code": error.exit_code}
    return {"message": told(error), "remedy": None, "exit_code": exit_code(error)}


def exit_code(error: BaseException) -> int:
    """The code that a command ends with."""
    error = explained(error)
    if isinstance(error, MapmoreError):
        return error.exit_code
    if isinstance(error, Stopped):
        return 128 + error.number
    return INTERRUPTED if isinstance(error, KeyboardInterrupt) else INTERNAL_FAULT


def message(error: BaseException) -> str:
    """What a user is told; an internal fault is one line."""
    error = explained(error)
    if isinstance(error, KeyboardInterrupt):
        return str(error) or "interrupted"
    return f"error: {told(error)}" if isinstance(error, MapmoreError) else told(error)


def _silence_stdout() -> None:
    """Point stdout at nothing: Python would complain when it cannot flush the rest at exit."""
    devnull = os.open(os.devnull, os.O_WRONLY)
    os.dup2(devnull, sys.stdout.fileno())
