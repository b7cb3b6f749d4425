"""What readers say of files that are damaged, and of libraries that are not installed."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

from mapmore_cli.domain.errors import DataError, MapmoreError


@contextmanager
def reading(label: str, kind: str) -> Iterator[None]:
    """Turn whatever a parser raises on a damaged file into a DataError that names the file.

    The parsers of binary formats raise a dozen kinds (KeyError, struct.error, zlib.error, XML errors, MemoryError for a length that
    is nonsense), all of which mean the same to the user.
    """
    try:
        yield
    except MapmoreError:
        raise
    except Exception as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise DataError(f"{label}: cannot be read: {error.strerror or error}") from error
        reason = " ".join(str(error).split()) or type(error).__name__
        raise DataError(
            f"{label}: the file is damaged, or is no {kind}: {reason[:150]}",
            "Open it in the program that wrote it and save it again; if it was cut off while copying, get it again.",
        ) from error


def optional_library(module: str, package: str, label: str) -> ModuleType:
    """Import a library that only some formats need; DataError with the command that installs it where it is absent."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise DataError(
            f"{label}: reading this file needs {package}, which is not installed", "Install it with: pip install 'mapmore[formats]'"
        ) from error
