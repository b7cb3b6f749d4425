"""One error class for each way in which a command can end, with its exit code; and warnings of
other runs.

Scripts rely on the codes (docs/messages.md, "Exit codes"); the command line turns a `MapmoreError`
into its message and its code, and anything else into an internal fault.
"""

from __future__ import annotations

import errno
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
"""What the file system says of paths that lead to nothing readable."""

_NO_MEMORY = ("annot allocate memory", "failed to map segment")
"""What the system says, also of a library that it cannot load."""


class MapmoreError(Exception):
    """Base of every error that a user can mend.

    The message names the place (file, row or line) and `remedy` says what to do.
    """

    exit_code = 1

    def __init__(self, message: str, remedy: str | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.remedy = remedy

    def __str__(self) -> str:
        return self.message if self.remedy is None else f"{self.message}\n  {self.remedy}"


def explained(error: BaseException) -> BaseException:
    """Return the error itself, or one that says what the user can do about it: a file or folder
    that may not be read, a path that leads nowhere, too little memory.

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
    """Return what a user is told of an error; a fault of the program itself is one line."""
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
    """The recordings are wrong, or too few samples remain for what the spec asks (exit 4)."""

    exit_code = 4


class FitError(MapmoreError):
    """A fit that the run cannot do without failed (exit 5)."""

    exit_code = 5


class LimitMissed(MapmoreError):
    """A `validate.require` limit is missed (exit 6)."""

    exit_code = 6


class WriteError(MapmoreError):
    """A result cannot be written: folder, full disk, or a lock held by another process (exit 7)."""

    exit_code = 7


class Stopped(KeyboardInterrupt):
    """The process was asked to end, by the signal `number`; the exit code is the one that shells
    report, 128 + number.
    """

    def __init__(self, number: int) -> None:
        super().__init__(f"ended by {Signals(number).name}")
        self.number = number


class RunWarning(str):
    """A warning about another run than the one that was asked for: the text says which, `run` and
    `message` hold the two apart.
    """

    run: str
    message: str

    @classmethod
    def of(cls, run: str, message: str) -> RunWarning:
        """Return the warning of a run; where it is about yet another one already, it stays as it
        is.
        """
        if isinstance(message, RunWarning):
            return message
        warning = cls(f"{run}: {message}")
        warning.run, warning.message = run, message
        return warning
