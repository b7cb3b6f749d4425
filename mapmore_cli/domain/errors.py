"""Define the errors that end a command, one class for each exit code. Also define warnings about a
run that the user did not name.

Scripts rely on the exit codes (docs/messages.md, "Exit codes"). For a `MapmoreError`, the command
line prints the message and ends with the code. Any other exception is reported as an internal
fault.
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
    """Return a `MapmoreError` whose message says what the user can do, if `error` is due to a file
    or folder without read permission, to a path that does not exist or cannot be used, or to too
    little memory. Return any other error unchanged.

    If Ctrl-C arrives inside a C function, Python may raise a SystemError that is caused by a
    KeyboardInterrupt. In this case, return the KeyboardInterrupt.
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
    """Return the message of an error for the user. For a fault of the program itself, the message
    has one line.
    """
    error = explained(error)
    if isinstance(error, MapmoreError):
        return str(error)
    return (
        f"internal fault: {f'{type(error).__name__}: {error}'.splitlines()[0]}; run again "
        "with --debug to see where"
    )


class UsageError(MapmoreError):
    """The command line has a wrong option or argument (exit code 2)."""

    exit_code = 2


class SpecError(MapmoreError):
    """The experiment spec has a mistake (exit code 3)."""

    exit_code = 3


class DataError(MapmoreError):
    """The recordings have a mistake, or too few samples remain for the settings of the spec (exit
    code 4).
    """

    exit_code = 4


class FitError(MapmoreError):
    """A fit failed, and the run cannot continue without its result (exit code 5)."""

    exit_code = 5


class LimitMissed(MapmoreError):
    """The scores miss a limit in `validate.require` (exit code 6)."""

    exit_code = 6


class WriteError(MapmoreError):
    """A result cannot be written: no permission, a full disk, or a file that another process has
    locked (exit code 7).
    """

    exit_code = 7


class Stopped(KeyboardInterrupt):
    """The operating system asked the process to end, by the signal `number`. The exit code is 128 +
    number, as shells report it.
    """

    def __init__(self, number: int) -> None:
        super().__init__(f"ended by {Signals(number).name}")
        self.number = number


class RunWarning(str):
    """A warning about a run that the user did not name, for example a run whose model another run
    needs. The text consists of the name of the run and the message; the attributes `run` and
    `message` hold these two separately.
    """

    run: str
    message: str

    @classmethod
    def of(cls, run: str, message: str) -> RunWarning:
        """Return a warning about the run with the name `run`. If `message` is already a warning
        about a run, it is returned unchanged.
        """
        if isinstance(message, RunWarning):
            return message
        warning = cls(f"{run}: {message}")
        warning.run, warning.message = run, message
        return warning
