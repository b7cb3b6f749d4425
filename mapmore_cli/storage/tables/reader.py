"""What a reader declares of itself, and what all readers say of damaged files and of libraries that are not installed."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

from mapmore_cli.domain.errors import DataError, MapmoreError
from mapmore_cli.storage.tables.table import RawTable, TableRequest


@dataclass(frozen=True)
class Top:
    """The first rows of a file, read in one way: with these `settings` of `data`, under which `is_number` tells cells that hold numbers.

    `addresses` are how the spec names the columns, where these lie in a tree; `sheet` is the title of the sheet, in a workbook.
    """

    rows: Sequence[Sequence[Any]]
    is_number: Callable[[Any], bool]
    settings: Mapping[str, Any] = field(default_factory=dict)
    addresses: tuple[str, ...] = ()
    sheet: str | None = None


@dataclass(frozen=True)
class Reader:
    """A format of recordings. Everything that the program knows of it is declared in one file of `storage/readers/`, as its `READER`.

    Attributes
    ----------
    name
        The word of `data.reader`.
    read
        Reads the wanted columns of a file: one table for every recording in it.
    suffixes
        How the names of such files end, lower case.
    keys
        The keys of `data` that it has a use for, besides those of every reader.
    column
        How the spec names a column, as an example.
    by_index
        Whether columns also go by their 0-based index.
    peek
        Reads the first rows of a file in every way that it may be meant, the likeliest first; None where columns have to be named by hand.
    """

    name: str
    read: Callable[[Path, TableRequest], list[RawTable]]
    suffixes: tuple[str, ...]
    keys: tuple[str, ...] = ()
    column: str = "force"
    by_index: bool = True
    peek: Callable[[Path, int], Iterable[Top]] | None = None


@contextmanager
def reading(label: str, kind: str) -> Iterator[None]:
    """Turn whatever a parser raises on a damaged file into a DataError that names the file; one that lacks the name gets it.

    The parsers of binary formats raise a dozen kinds (KeyError, struct.error, zlib.error, XML errors, MemoryError for a length that
    is nonsense), all of which mean the same to the user. A NameError or an ImportError is a fault of the program, and passes.
    """
    try:
        yield
    except MapmoreError as error:
        if label not in error.message:
            error.message = f"{label}: {error.message}"
        raise
    except Exception as error:
        if isinstance(error, ImportError) or type(error) is NameError:  # SciPy has an UnboundLocalError for some damaged files
            raise
        if isinstance(error, OSError) and error.errno is not None:
            raise DataError(f"{label}: cannot be read: {error.strerror or error}") from error
        reason = " ".join(str(error).split()) or type(error).__name__
        raise DataError(
            f"{label}: the file is damaged, or is no {kind}: {reason[:150]}",
            "open it in the program that wrote it and save it again; if it was cut off while copying, get it again",
        ) from error


def optional_library(module: str, package: str, label: str) -> ModuleType:
    """Import a library that only some formats need; DataError with the command that installs it where it is absent."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise DataError(
            f"{label}: reading this file needs {package}, which is not installed", "install it with: pip install 'mapmore[formats]'"
        ) from error
