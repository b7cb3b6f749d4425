"""A text file from bytes to lines with their numbers, one by one; and text files written line by
line.
"""

from __future__ import annotations

import codecs
import csv
import gzip
import io
import os
import re
import zlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, BinaryIO, TextIO, cast

from mapmore_cli.domain.errors import DataError, WriteError
from mapmore_cli.storage.atomic import written
from mapmore_cli.storage.tables import reading, refuse_bombs
from mapmore_cli.storage.tables.cells import holds_number

HEAD = 65536  # bytes by which the encoding is guessed
MOSTLY = 0.7  # of every second byte, that is zero where plain letters are written in UTF-16
UNDEFINED = bytes((0x81, 0x8D, 0x8F, 0x90, 0x9D))  # in cp1252

LONGEST = 10_000_000
"""Characters of a line; a file of megabytes without a line end is no table."""

BLOCK = 1 << 17
"""Characters that are read at once: what is computed of them stays in the processor's cache."""

TEXT_ERRORS = "surrogateescape"
TOLD_EVERY = 4096  # lines

UNREADABLE = (OSError, EOFError, zlib.error)
"""What opening, reading and unpacking raise."""


def is_zipped(raw: BinaryIO) -> bool:
    """Whether an open file is gzipped, by its content."""
    raw.seek(0)
    magic = raw.read(2)
    raw.seek(0)
    return magic == b"\x1f\x8b"


def _unzipped(raw: BinaryIO, zipped: bool) -> IO[bytes]:
    return cast(IO[bytes], gzip.GzipFile(fileobj=raw)) if zipped else raw


@contextmanager
def open_lines(
    path: Path, encoding: str, label: str, errors: str = "strict"
) -> Iterator[tuple[Iterator[str], BinaryIO]]:
    """Open the lines of a file, plain or gzipped (recognised by content), which end in LF, CR LF or
    CR; and the file itself.
    """
    # utf-8-sig swallows a byte order mark; newline="" leaves CR, LF and CRLF to the parser
    encoding = "utf-8-sig" if codecs.lookup(encoding).name == "utf-8" else encoding
    with path.open("rb") as raw:
        zipped = is_zipped(raw)
        with io.TextIOWrapper(
            _unzipped(raw, zipped), encoding=encoding, errors=errors, newline=""
        ) as text:
            yield (
                bounded_lines(text, label, os.fstat(raw.fileno()).st_size if zipped else None),
                raw,
            )


def lines_of(
    path: Path, told: Callable[[int, int], None] = lambda _read, _size: None
) -> Iterator[str]:
    """Yield the lines of a file with their ends; DataError where it is missing, unreadable or cut
    off.

    `told` is told now and then how many bytes of the file have been read, and how many it has.
    """
    with reading(str(path), "gzip file", UNREADABLE), path.open("rb") as raw:
        size = (
            os.fstat(raw.fileno()).st_size if raw.seekable() else 0
        )  # a pipe has no size and no place
        with as_text(_unzipped(raw, path.suffix == ".gz")) as text:
            for number, line in enumerate(bounded_lines(text, str(path))):
                if number % TOLD_EVERY == 0 and size:
                    told(raw.tell(), size)
                yield line


def as_text(binary: IO[bytes]) -> TextIO:
    """Return a text stream over a binary one; a byte order mark is swallowed."""
    return io.TextIOWrapper(binary, encoding="utf-8-sig", errors=TEXT_ERRORS, newline="")


def bounded_lines(text: TextIO, label: str, packed: int | None = None) -> Iterator[str]:
    """Yield the lines of a text with their ends, LF, CR LF or CR; `packed` is the size of the file
    where it is a packed one.

    Raises DataError for a line that is too long for a table, and for text that is hundreds of times
    larger than its file.
    """
    rest, number, size = "", 0, 0
    while chunk := text.read(BLOCK):
        size += len(chunk)
        if packed is not None:
            refuse_bombs(f"{label}: the file", size, packed)
        end = (
            chunk.rfind("\n") + 1 or chunk.rfind("\r", 0, -1) + 1
        )  # a CR at the end may go on with LF
        if not end:
            rest += chunk
        else:
            lines = io.StringIO(rest + chunk[:end], newline="")
            rest = chunk[end:]
            for line in lines:
                number += 1
                yield line
        if len(rest) > LONGEST:
            raise DataError(
                f"{label}:row {number + 1}: is longer than {LONGEST // 10**6} million characters",
                "give a table",
            )
    yield from io.StringIO(rest, newline="")


def guess_encoding(path: Path) -> str:
    """Return the encoding of a text file, plain or gzipped, as its beginning tells."""
    with path.open("rb") as raw:
        return encoding_of(_unzipped(raw, is_zipped(raw)).read(HEAD))


def encoding_of(head: bytes) -> str:
    """Return the encoding that the first bytes of a text are in: `utf-8`, one of UTF-16, or else
    what Windows calls ANSI.
    """
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    pairs = len(head) // 2
    for name, zeros in (("utf-16-le", head[1::2].count(0)), ("utf-16-be", head[::2].count(0))):
        if pairs and zeros > MOSTLY * pairs:
            return name
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)  # the last character may be cut
    except UnicodeDecodeError:
        return "cp1252" if all(byte not in head for byte in UNDEFINED) else "latin-1"
    return "utf-8"


def quote_left_open(lines: Sequence[str], cells: Sequence[str], delimiter: str) -> bool:
    """Whether a quotation mark in a record was never meant to span its `lines`: it is not closed,
    or took whole records for text.
    """
    if not any('"' in line for line in lines):
        return False
    try:
        deque(csv.reader(lines, delimiter=delimiter, strict=True), maxlen=0)
    except csv.Error as error:
        if "end of data" in str(error) or len(lines) > 1:
            return True
    return any(_holds_record(line, delimiter) for cell in cells for line in cell.splitlines()[1:])


def _holds_record(line: str, delimiter: str) -> bool:
    """Whether a line inside of a cell looks like one of the table: delimited, with a number in
    it.
    """
    return delimiter in line and any(
        holds_number(cell.strip(' "')) for cell in line.split(delimiter)
    )


def records_of(
    lines: Iterable[str], delimiter: str, label: str, row: int = 0
) -> Iterator[tuple[str, list[str], int]]:
    """Yield the text of each record, its fields, and the number of its last line; `row` come
    before.

    A quoted field may go on over several lines. One whose quotation marks are damaged, as in
    `"20"1.2`, is the text as it stands, which is no number. No line is taken before its time.
    """
    taken: list[str] = []

    def remembered() -> Iterator[str]:
        for line in lines:
            taken.append(line)
            yield line

    mark = re.escape(delimiter)
    fields = re.compile(rf'("(?:[^"]|"")*"|[^"{mark}]*)([^{mark}]*)(?:{mark}|\Z)')
    try:
        for cells in csv.reader(remembered(), delimiter=delimiter):
            if quote_left_open(taken, cells, delimiter):
                raise open_quote(label, row + 1)
            text, row = "".join(taken), row + len(taken)
            taken.clear()
            if '"' in text:
                whole = zip(cells, fields.findall(text.rstrip("\r\n")), strict=False)
                cells = [quoted + rest if rest.strip() else cell for cell, (quoted, rest) in whole]
            yield text, cells, row
    except csv.Error as error:  # a field that is longer than any number
        raise open_quote(label, row + 1) from error


def open_quote(label: str, row: int) -> DataError:
    """Return what is told of a record in which a quotation mark was left open."""
    return DataError(
        f"{label}:row {row}: a quotation mark opens here and is not closed",
        "close it, or remove it",
    )


@contextmanager
def replaced(path: Path) -> Iterator[TextIO]:
    """Open a text stream that takes the place of `path` when the block ends without an error
    (`atomic.written`).

    Errors of the file system inside the block count as errors of this file, and are WriteErrors;
    BrokenPipeError where nobody reads more.
    """
    try:
        with written(path) as raw, _encoded(raw, path.suffix == ".gz") as text:
            yield text
    except BrokenPipeError:
        raise
    except OSError as fault:
        raise WriteError(
            f"{path}: cannot be written ({fault.strerror})",
            "choose another place with -o, or make room",
        ) from fault


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
