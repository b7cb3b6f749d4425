"""Write files outside of run folders, and protect the files that are already there.

A file that the user names is replaced, as other programs replace their outputs, unless it is still
needed: the command reads it, it belongs to a run, or it is read-only, as frozen models are. A file
whose name mapmore chooses is replaced only if mapmore has written it.
"""

from __future__ import annotations

import gzip
import io
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import IO, TextIO

from mapmore_cli.domain.errors import WriteError
from mapmore_cli.storage.atomic import (
    holds,
    is_special,
    opened_special,
    refusals_told,
    refuse_irregular,
    replacing,
    write_own,
)
from mapmore_cli.storage.inputs import is_read

MARKS = (b"mapmore", b"_predicted", b"schema_version")
"""Texts in what mapmore writes under names of its own choice: the second is in titles of tables,
and the third in specs.
"""

WRITABLE = 0o222
"""Permissions of which a read-only file has none."""


def refuse_needed(path: Path) -> None:
    """Raise WriteError if a file is in the place of an output and is still needed: a file that the
    command reads, a file of a run, or a read-only file. A link and a folder are refused too.
    """
    refuse_irregular(path)
    if path.is_dir():
        raise WriteError(f"{path}: cannot be written (it is a folder)", "name a file in it")
    if not path.is_file():
        return
    if is_read(path):
        why = "this command reads it, so its output does not replace it"
    elif (folder := _run_with(path)) is not None:
        why = f"it belongs to the run in {folder}, so no other output replaces it"
    elif not path.stat().st_mode & WRITABLE:
        why = "it is read-only, so no output replaces it"
    else:
        return
    raise WriteError(f"{path}: {why}", "name another file for the output")


def _run_with(path: Path) -> Path | None:
    """Return the folder of the run to which a file belongs, or None."""
    from mapmore_cli.storage.run_record import RUN_RECORD, written_files
    from mapmore_cli.storage.seals import SEAL

    place = Path(os.path.realpath(path))
    for folder in place.parents:
        if (folder / RUN_RECORD).is_file():
            name = place.relative_to(folder).as_posix()
            if name in {RUN_RECORD, SEAL, *written_files(folder)}:
                return folder
    return None


@contextmanager
def written(path: Path) -> Iterator[IO[bytes]]:
    """Open a file that the user has named, for writing as a whole, as `replacing` does. If `path`
    is no regular file, for example a pipe or `/dev/null`, it is opened directly.

    Raises WriteError as `refuse_needed` does.
    """
    if is_special(path):
        with opened_special(path) as stream:
            yield stream
        return
    refuse_needed(path)
    with replacing(path) as file:
        yield file


@contextmanager
def written_as_text(path: Path) -> Iterator[TextIO]:
    """Open a text stream that replaces `path` when the block ends without an error
    (`written`).

    Errors of the file system inside the block count as errors of this file, and become WriteErrors.
    Raises BrokenPipeError if the program that reads from a pipe has ended.
    """
    from mapmore_cli.storage.tables.lines import TEXT_ERRORS

    try:
        with written(path) as raw:
            # the gzip header gets no name and no time, so that the same table gives the same bytes
            zipped = path.suffix == ".gz"
            binary = gzip.GzipFile("", "wb", fileobj=raw, mtime=0) if zipped else raw
            text = io.TextIOWrapper(binary, "utf-8", TEXT_ERRORS, newline="")
            yield text
            text.flush()
            # closing a gzip stream writes its end and leaves `raw` open
            text.close() if zipped else text.detach()
    except BrokenPipeError:
        raise
    except OSError as fault:
        raise WriteError(
            f"{path}: cannot be written ({fault.strerror})",
            "choose another place with -o, or make room",
        ) from fault


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file that the user has named, as a whole, as `written` does."""
    with written(path) as file:
        file.write(data)


def write_text(path: Path, text: str) -> None:
    """Write a UTF-8 file that the user has named, as a whole, with the line ends of `text`."""
    write_bytes(path, text.encode())


def refuse_foreign_file(path: Path) -> None:
    """Raise WriteError if a file whose name mapmore chooses exists, and mapmore has not written it.
    A file that is still needed is refused too.
    """
    refuse_needed(path)
    if not path.is_file() or path.stat().st_size == 0:
        return
    with path.open("rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as data:
        ours = any(data.find(mark) >= 0 for mark in MARKS)
    if not ours:
        raise WriteError(
            f"{path}: exists, and mapmore has not written it, so it is not replaced",
            "move it away, or choose another place with -o",
        )


def write_chosen(folder: Path, files: Mapping[str, bytes]) -> list[Path]:
    """Write files whose names mapmore chooses into a folder of the user, which is made if
    necessary, and return their paths. A file with the same content stays.

    Raises WriteError as `refuse_foreign_file` does, before any file is written.
    """
    with refusals_told(folder):
        folder.mkdir(parents=True, exist_ok=True)
    changed = {
        folder / name: data
        for name, data in files.items()
        if (folder / name).is_symlink() or not holds(folder / name, data)
    }
    for path in changed:
        refuse_foreign_file(path)
    for path, data in changed.items():
        write_own(path, data)
    return [folder / name for name in files]
