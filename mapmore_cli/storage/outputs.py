"""Write files outside of run folders, and protect the files that are already there.

A file that the user names is replaced, as other programs replace their outputs. There are three
exceptions: the command reads the file, the file belongs to a run, or it is read-only, as frozen
models are. A file whose name mapmore chooses is replaced only if mapmore has written it and nobody
has changed it since. To recognise this, its hash is stored in the file `WRITTEN` beside it.
"""

from __future__ import annotations

import gzip
import io
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from typing import IO, TextIO

from mapmore_cli.domain.errors import WriteError
from mapmore_cli.storage.atomic import (
    content_of,
    holds,
    is_special,
    opened_special,
    refusals_told,
    refuse_irregular,
    replacing,
    unfinished_beside,
    write_own,
)
from mapmore_cli.storage.inputs import note_output, refuse_read
from mapmore_cli.storage.seals import SEAL, hashes_of

WRITTEN = ".mapmore-files"
"""File with the SHA-256 of the files in its folder whose names mapmore has chosen, by name."""

WRITABLE = 0o222
"""Permissions to write (owner, group and others). A file with none of them is read-only."""


def refuse_needed(path: Path) -> None:
    """Raise WriteError if an output at `path` would replace a file that is still needed: a file
    that the command reads, a file of a run, or a read-only file. A link and a folder are refused
    too.
    """
    refuse_irregular(path)
    if path.is_dir():
        raise WriteError(f"{path}: cannot be written (it is a folder)", "name a file in it")
    if not path.is_file():
        return
    refuse_read(path)
    if (folder := _run_with(path)) is not None:
        why = f"it belongs to the run in {folder}, so no other output replaces it"
    elif not path.stat().st_mode & WRITABLE:
        why = "it is read-only, so no output replaces it"
    else:
        return
    raise WriteError(f"{path}: {why}", "name another file for the output")


def _run_with(path: Path) -> Path | None:
    """Return the folder of the run to which a file belongs, or None."""
    from mapmore_cli.storage.run_record import RUN_RECORD, written_files

    place = Path(os.path.realpath(path))
    for folder in place.parents:
        if (folder / RUN_RECORD).is_file():
            name = place.relative_to(folder).as_posix()
            if name in {RUN_RECORD, SEAL, *written_files(folder)}:
                return folder
    return None


def refuse_early(path: Path, chosen: bool = False) -> None:
    """Raise WriteError if an output cannot be written. This function is called before a command
    begins its computation. An output cannot be written if it would replace a file that is still
    needed (`refuse_needed`), or if its folder does not exist or cannot be written to. If mapmore
    has `chosen` the name of the output, it must not replace a file of somebody else either
    (`refuse_foreign_file`).

    The output is noted, so that `note_read` raises an error if the command later reads this file.
    """
    with refusals_told(path.parent):
        if is_special(path) and not chosen:
            return
        (refuse_foreign_file if chosen else refuse_needed)(path)
        if not path.parent.is_dir():
            raise WriteError(
                f"{path}: cannot be written, because there is no folder {path.parent}",
                "create the folder, or name a file in another one",
            )
        with unfinished_beside(path):
            note_output(path)


@contextmanager
def written(path: Path) -> Iterator[IO[bytes]]:
    """Open a file that the user has named. It replaces the old file when the block ends without an
    error, as in `replacing`. If `path` is no regular file, for example a pipe or `/dev/null`, the
    data are written into it directly.

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
    """Open a UTF-8 text that replaces the file `path` when the block ends without an error. The
    text is compressed with gzip if the name of the file ends with `.gz`.

    Errors of the file system inside the block become WriteErrors that name this file. Raises
    BrokenPipeError if `path` is a pipe and the program that reads from it has ended.
    """
    from mapmore_cli.storage.tables.lines import TEXT_ERRORS

    try:
        with written(path) as raw:
            # no name and no time are stored in the gzip header, so that the same text gives the
            # same bytes
            zipped = path.suffix == ".gz"
            binary = gzip.GzipFile("", "wb", fileobj=raw, mtime=0) if zipped else raw
            text = io.TextIOWrapper(binary, "utf-8", TEXT_ERRORS, newline="")
            yield text
            text.flush()
            # a gzip stream is closed, which writes its end but leaves `raw` open; the other text is
            # only detached, because closing it would close `raw`
            text.close() if zipped else text.detach()
    except BrokenPipeError:
        raise
    except OSError as fault:
        raise WriteError(
            f"{path}: cannot be written ({fault.strerror})",
            "choose another place with -o, or make room",
        ) from fault


def write_bytes(path: Path, data: bytes) -> None:
    """Write `data` to a file that the user has named. An old file is replaced as a whole, as in
    `written`.
    """
    with written(path) as file:
        file.write(data)


def write_text(path: Path, text: str) -> None:
    """Write `text`, with its own line ends, to a UTF-8 file that the user has named. An old file is
    replaced as a whole.
    """
    write_bytes(path, text.encode())


def refuse_foreign_file(path: Path) -> None:
    """Raise WriteError if a file whose name mapmore chooses exists, unless `note_chosen` has noted
    the file and nobody has changed it since. Raise WriteError also if the file is still needed.
    """
    refuse_needed(path)
    refuse_irregular(path.parent / WRITTEN)
    if not path.is_file() or path.stat().st_size == 0:
        return
    present = hashes_of(path.parent, [path.name])[path.name]
    if present not in _hashes_in(path.parent).get(path.name, "").split():
        raise WriteError(
            f"{path}: the file exists, and it was not written by mapmore or was changed "
            "afterwards, so it is not replaced",
            "move it away, or choose another place with -o",
        )


def note_chosen(folder: Path, names: Iterable[str]) -> None:
    """Store the hashes of files whose names mapmore has chosen. As long as a file has its stored
    hash, `refuse_foreign_file` allows mapmore to replace it. If the stored hashes are lost, the
    files are not replaced any more.
    """
    _store(folder, hashes_of(folder, names))


def _store(folder: Path, hashes: Mapping[str, str]) -> None:
    """Store hashes of files of a folder, by name, beside those of its other files."""
    hashes = {**_hashes_in(folder), **hashes}
    text = json.dumps(hashes, indent=1, ensure_ascii=False, sort_keys=True) + "\n"
    if not holds(folder / WRITTEN, text.encode()):
        write_own(folder / WRITTEN, text)


def _hashes_in(folder: Path) -> dict[str, str]:
    """Return the hashes that are stored for the files of a folder, by name; empty if they cannot be
    read. While a file is being replaced, two hashes with a space between them are stored for it:
    that of the old content and that of the new one.
    """
    with suppress(OSError, ValueError, RecursionError):
        noted = json.loads(content_of(folder / WRITTEN))
        if isinstance(noted, dict):
            there = [path.name for path in folder.iterdir() if path.name in noted]
            return {name: str(noted[name]) for name in there}
    return {}


def write_chosen(folder: Path, files: Mapping[str, bytes]) -> list[Path]:
    """Write `files`, contents by name, whose names mapmore chooses, into a folder of the user, and
    return their paths. The folder is made if necessary. A file that already has the same content is
    not written.

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
    # Both hashes are stored first: if this process is killed now, each file is either old or new.
    old, new = _hashes_in(folder), {p.name: sha256(data).hexdigest() for p, data in changed.items()}
    _store(folder, {name: f"{old.get(name, '')} {digest}".strip() for name, digest in new.items()})
    for path, data in changed.items():
        write_own(path, data)
    note_chosen(folder, files)
    return [folder / name for name in files]
