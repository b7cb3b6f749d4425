"""How a command ends: the exit code and the one message of every kind of error.

The codes 2 to 7 sit on the error classes (`domain.errors`); here are the others, and the only place that turns an exception into a code.
"""

from __future__ import annotations

import errno
import os
import sys
import traceback

from mapmore_cli.domain.errors import MapmoreError, WriteError

INTERNAL_FAULT = 1
INTERRUPTED = 130  # 128 + SIGINT, as shells report it
BROKEN_PIPE = 141  # 128 + SIGPIPE


def settle(error: BaseException, debug: bool) -> int:
    """Say on stderr what went wrong, and return the exit code; the traceback is for `--debug` alone."""
    if isinstance(error, BrokenPipeError):
        _silence_stdout()
        return BROKEN_PIPE
    if isinstance(error, OSError) and error.errno == errno.ENOSPC:  # files are storage's to explain, so this is stdout
        _silence_stdout()
        error = WriteError("stdout: cannot be written (no space left on device)", "make room, or write elsewhere")
    if debug:
        traceback.print_exception(error, file=sys.stderr)
    else:
        print(message(error), file=sys.stderr)
    return exit_code(error)


def exit_code(error: BaseException) -> int:
    """The code that a command ends with."""
    if isinstance(error, MapmoreError):
        return error.exit_code
    return INTERRUPTED if isinstance(error, KeyboardInterrupt) else INTERNAL_FAULT


def message(error: BaseException) -> str:
    """What a user is told; an internal fault is one line."""
    if isinstance(error, MapmoreError):
        return f"error: {error}"
    if isinstance(error, KeyboardInterrupt):
        return "interrupted"
    fault = f"{type(error).__name__}: {error}".splitlines()[0]
    return f"internal fault: {fault}; run again with --debug to see where"


def _silence_stdout() -> None:
    """Point stdout at nothing: Python would complain when it cannot flush the rest at exit."""
    devnull = os.open(os.devnull, os.O_WRONLY)
    os.dup2(devnull, sys.stdout.fileno())
