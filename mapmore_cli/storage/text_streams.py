"""Text files line by line, larger than memory: read, and written whole or not at all. Names that end in `.gz` are gzipped.

Bytes that are no UTF-8 pass through unchanged (`surrogateescape`), and so do line ends.
"""

from __future__ import annotations

import gzip
import io
import os
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TextIO, cast

from mapmore_cli.domain.errors import DataError, WriteError
from mapmore_cli.storage.atomic import is_special, replaced_place, sync_folder, unfinished_beside
from mapmore_cli.storage.tables.lines import bounded_lines

TEXT_ERRORS = "surrogateescape"

TOLD_EVERY = 4096  # lines


def as_text(binary: IO[bytes]) -> TextIO:
    """Return a text stream over a binary one; a byte order mark is swallowed."""
    return io.TextIOWrapper(binary, encoding="utf-8-sig", errors=TEXT_ERRORS, newline="")


def lines_of(path: Path, told: Callable[[int, int], None] = lambda _read, _size: None) -> Iterator[str]:
    """Yield the lines of a file with their ends; DataError where it is missing, unreadable or cut off.

    `told` is told now and then how many bytes of the file have been read, and how many it has.
    """
    try:
        with path.open("rb") as raw:
            unzipped: IO[bytes] = cast(IO[bytes], gzip.GzipFile(fileobj=raw)) if path.suffix == ".gz" else raw
            size = os.fstat(raw.fileno()).st_size if raw.seekable() else 0  # a pipe has no size and no place
            with as_text(unzipped) as text:
                for number, line in enumerate(bounded_lines(text, str(path))):
                    if number % TOLD_EVERY == 0 and size:
                        told(raw.tell(), size)
                    yield line
    except (EOFError, zlib.error, gzip.BadGzipFile) as fault:
        raise DataError(f"{path}: the file is damaged ({fault})", "it may have been cut off while copying; get it again") from fault
    except OSError as fault:
        raise DataError(f"{path}: cannot be read ({fault.strerror})", "check the path") from fault


@contextmanager
def replaced(path: Path) -> Iterator[TextIO]:
    """Open a text stream that takes the place of `path` when the block ends without an error; WriteError where that cannot be.

    What is no file, as a pipe or `/dev/null`, is written into.

    Errors of the file system inside the block count as errors of this file.
    """
    if is_special(path):
        with _into(path) as text:
            yield text
        return
    path = replaced_place(path)
    try:
        with unfinished_beside(path) as unfinished:
            with unfinished.open("wb") as raw:
                with _encoded(raw, path.suffix == ".gz") as text:
                    yield text
                raw.flush()
                os.fsync(raw.fileno())
            unfinished.replace(path)
            sync_folder(path.parent)
    except OSError as fault:
        raise WriteError(f"{path}: cannot be written ({fault.strerror})", "choose another place with -o, or make room") from fault


@contextmanager
def _into(path: Path) -> Iterator[TextIO]:
    """Open a text stream into something that is no file; BrokenPipeError where nobody reads any more."""
    try:
        with path.open("wb") as raw, _encoded(raw, path.suffix == ".gz") as text:
            yield text
    except BrokenPipeError:
        raise
    except OSError as fault:
        raise WriteError(f"{path}: cannot be written ({fault.strerror})", "choose another place with -o") from fault


@contextmanager
def _encoded(raw: IO[bytes], zipped: bool) -> Iterator[TextIO]:
    # No name and no time in the gzip header: the same table gives the same bytes.
    binary = gzip.GzipFile(filename="", mode="wb", fileobj=raw, mtime=0) if zipped else raw
    text = io.TextIOWrapper(binary, encoding="utf-8", errors=TEXT_ERRORS, newline="")
    yield text
    text.flush()
    if zipped:
        text.close()  # writes the end of the gzip stream, and leaves `raw` open
    else:
        text.detach()
