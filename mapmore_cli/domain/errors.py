"""Define the errors that end a command, one class for each exit code, and warnings about other
runs.

Scripts rely on the codes (docs/messages.md, "Exit codes"). The command line turns a `MapmoreError`
into its message and its code, and any other exception into an internal fault.
"""

from __future__ import annotations

import errno
from collections.abc import Callable
from signal import Signals

_PATHS = (
    errno.ENAMETOOLONG,
    errno.ELOOP,
    errno.ENOTDIR,
    errno.EISDIR,
    errno.ENOENT,
    errno.EINVAL,
    errno.ENXIO,
    errno.EIO,
    errno.ESRCH,
)
"""Error numbers of the file system for a path that leads to nothing that can be read."""

_NO_MEMORY = ("annot allocate memory", "failed to map segment")
"""Parts of the messages with which the system reports too little memory, also while it loads a
library.
"""


Warn = Callable[[str], None]
"""Function that shows a warning to the user."""


class MapmoreError(Exception):
    """Base class of every error that a user can correct.

    The message names the place (file, row or line), and `remedy` says what to do.
    """

    exit_code = 1

    def __init__(self, message: str, remedy: str | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.remedy = remedy

    def __str__(self) -> str:
        return self.message if self.remedy is None else f"{self.message}\n  {self.remedy}"


def explained(error: BaseException) -> BaseException:
    """Return the error itself, or an error that says what the user can do: about a file or folder
    without read permission, a path that leads nowhere, or too little memory.

    If Ctrl-C arrives inside a C function, Python may raise a SystemError. Its cause, the
    interruption, is then returned.
    """
    if isinstance(error, SystemError) and isinstance(error.__cause__, KeyboardInterrupt):
        return error.__cause__
    texts = [
        str(fault) for fault in (error, error.__cause__) if isinstance(fault, OSError | ImportError)
    ]
    if isinstance(error, MemoryError) or any(sign in text for sign in _NO_MEMORY for text in texts):
        return MapmoreError(
            "there is not enough memory for this",
            "close other programs, or use fewer or shorter recordings",
        )
    if isinstance(error, PermissionError) and error.filename is not None:
        return DataError(
            f"{error.filename}: cannot be read (permission denied)",
            "change its permissions, or leave it out",
        )
    if isinstance(error, OSError) and error.filename is not None and error.errno in _PATHS:
        name = str(error.filename)
        return DataError(
            f"{name if len(name) < 200 else f'{name[:100]}...'}: "
            f"{(error.strerror or 'is no path').lower()}",
            "check the path",
        )
    return error


def error_text(error: BaseException) -> str:
    """Return the message of an error for the user. An error that is a fault of the program itself
    is described in one line.
    """
    error = explained(error)
    if isinstance(error, MapmoreError):
        return str(error)
    return (
        f"internal fault: {f'{type(error).__name__}: {error}'.splitlines()[0]}; run again "
        "with --debug to see where"
    )


class UsageError(MapmoreError):
    """The command line itself is wrong (exit 2)."""

    exit_code = 2


class SpecError(MapmoreError):
    """The experiment spec is wrong (exit 3)."""

    exit_code = 3


class DataError(MapmoreError):
    """The recordings are wrong, or too few samples remain for the settings of the spec (exit 4)."""

    exit_code = 4


class FitError(MapmoreError):
    """A fit without which the run cannot continue has failed (exit 5)."""

    exit_code = 5


class LimitMissed(MapmoreError):
    """A limit in `validate.require` is missed (exit 6)."""

    exit_code = 6


class WriteError(MapmoreError):
    """A result cannot be written: no permission, a full disk, or a lock held by another process
    (exit 7).
    """

    exit_code = 7


class Stopped(KeyboardInterrupt):
    """The process was asked to end by the signal `number`. The exit code is 128 + number, as shells
    report it.
    """

    def __init__(self, number: int) -> None:
        super().__init__(f"ended by {Signals(number).name}")
        self.number = number


class RunWarning(str):
    """A warning about another run than the requested one, for example a run that it needs. The text
    begins with the name of the run; `run` and `message` hold the two parts separately.
    """

    run: str
    message: str

    @classmethod
    def of(cls, run: str, message: str) -> RunWarning:
        """Return the warning of a run. A warning that already names another run is returned
        unchanged.
        """
        if isinstance(message, RunWarning):
            return message
        warning = cls(f"{run}: {message}")
        warning.run, warning.message = run, message
        return warning
