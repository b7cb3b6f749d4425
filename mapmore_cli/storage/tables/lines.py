"""Read a text file, plain or compressed, as numbered lines, and guess its encoding."""

from __future__ import annotations

import bz2
import codecs
import csv
import gzip
import io
import lzma
import os
import re
import stat
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from io import BufferedReader
from pathlib import Path
from typing import IO, Any, TextIO

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import reading, refuse_bombs
from mapmore_cli.storage.tables.cells import holds_number

LONGEST = 10_000_000
"""Largest number of characters in a line; a file of megabytes without a line end is no table."""

PACKED_TEXT = 4_000_000
"""Unpacked size of a compressed text, in bytes, above which its compression ratio is checked. The
limit is low because damaged lines are read one by one, which takes seconds per megabyte on a slow
machine.
"""

CHUNK = 1 << 20
"""Number of bytes that are read at a time. If one of the lines in them is irregular, PyArrow cannot
be used, and all of these lines are read record by record.
"""

LAST_LINES = 50
"""Number of lines at the end of a text that are compared with each other, to find out whether the
last of them is incomplete.
"""

KEPT = 1 << 16
"""Number of bytes before the current position that stay in the buffer, so that the last line can be
compared with the lines before it.
"""

LINE = re.compile(rb"[^\r\n]*(?:\r\n?|\n)")

TEXT_ERRORS = "surrogateescape"

PADDING = b"\0\x1a"
"""Fill characters (padding) that may follow the text of a file. Space that a logger has reserved
and not used is filled with NUL, and texts of DOS programs end with Ctrl-Z.
"""

UNREADABLE = (OSError, EOFError, zlib.error, lzma.LZMAError)
"""Errors of opening, reading and unpacking a file."""

_UNPACKED: dict[bytes, Callable[[Any], Any]] = {
    b"\x1f\x8b": gzip.open,
    b"BZh": bz2.open,
    b"\xfd7zXZ": lzma.open,
}
"""Functions that unpack compressed files, by the bytes with which such files begin."""


def name_of_packed(name: str) -> str:
    """Return the name of a file without the suffix of its compression: `a.csv` for `a.csv.gz`."""
    return re.sub(r"\.(gz|bz2|xz)$", "", name, flags=re.IGNORECASE)


def is_zipped(raw: BufferedReader) -> bool:
    """Return True if an open file is compressed with gzip, bzip2 or xz, judged by its beginning."""
    return raw.peek(5).startswith(tuple(_UNPACKED))


def _unzipped(raw: BufferedReader) -> IO[bytes]:
    ways = (way for begin, way in _UNPACKED.items() if raw.peek(5).startswith(begin))
    return next((way(raw) for way in ways), raw)


@contextmanager
def open_lines(
    path: Path, encoding: str, label: str, errors: str = "strict"
) -> Iterator[tuple[Lines, BufferedReader]]:
    """Open a text file, plain or compressed. Return an iterator over its lines, and the open file.
    Lines may end with LF, CR LF or CR.
    """
    with path.open("rb") as raw:
        status = os.fstat(raw.fileno())
        packed = status.st_size if is_zipped(raw) else None
        lines = Lines(_unzipped(raw), encoding, errors, label, packed)
        lines.endless = not stat.S_ISREG(status.st_mode)
        yield lines, raw


def lines_of(path: Path, told: Callable[[int, int], None]) -> Iterator[str]:
    """Yield the lines of a text file, each with its line break. Raises DataError if the file is
    missing, unreadable or incomplete.

    The function `told` is called from time to time with the number of bytes read so far and the
    size of the file.
    """
    label = str(path)
    with (
        reading(label, "text file", UNREADABLE),
        open_lines(path, "utf-8", label, TEXT_ERRORS) as (lines, raw),
    ):
        # the size of a pipe is unknown
        size = os.fstat(raw.fileno()).st_size if raw.seekable() else 0
        for number, line in enumerate(lines):
            if number % 4096 == 0 and size:
                told(raw.tell(), size)
            yield line


def as_text(binary: IO[bytes]) -> TextIO:
    """Return a text stream over a binary stream; a byte order mark is skipped."""
    return io.TextIOWrapper(binary, encoding="utf-8-sig", errors=TEXT_ERRORS, newline="")


class Lines(Iterator[str]):
    """Iterator over the lines of a text, each with its line break. `block` returns many lines at a
    time. A byte order mark is skipped.

    `taken` and `rows` are the number of bytes (in UTF-8) and the number of lines that were consumed
    so far. `padding` is the number of fill characters (`PADDING`) at the end, which do not belong
    to the text.

    Raises DataError for a line that is too long for a table. `packed` is the size of a compressed
    file; if the text is hundreds of times larger, DataError is raised too.
    """

    def __init__(
        self, stream: Any, encoding: str, errors: str, label: str, packed: int | None
    ) -> None:
        self._stream, self._label, self._packed = stream, label, packed
        self._plain = codecs.lookup(encoding).name == "utf-8"
        self._decoder = codecs.getincrementaldecoder(encoding)(errors)
        self._held, self._at, self._ended, self._size = b"", 0, False, 0
        # fill characters at the end of the part that was read so far; they belong to the text if
        # more text follows
        self._tail = b""
        self.taken = self.rows = self.padding = 0
        # if `endless` is True, the file is, for example, a device that may deliver fill characters
        # without end; too many of them then raise an error
        self.endless = False

    def __next__(self) -> str:
        line = self._line()
        if not line:
            raise StopIteration
        text = line.decode("utf-8", TEXT_ERRORS)
        text = text if self.taken else text.removeprefix("\ufeff")
        self.take(line, 1)
        return text

    def block(self) -> bytes:
        """Return the next lines, about `CHUNK` bytes in UTF-8; empty at the end of the text. The
        lines are consumed only when they are passed to `take`.
        """
        line = self._line()
        while not self._ended and len(self._held) - self._at < CHUNK:
            self._more()
        # a CR at the end of the buffer is not regarded as a line break, because an LF may follow
        ends = (self._held.rfind(b"\n", self._at), self._held.rfind(b"\r", self._at, -1))
        end = len(self._held) if self._ended else max(1 + max(ends), self._at + len(line))
        return self._held[self._at : end]

    def take(self, lines: bytes, count: int) -> None:
        """Consume the next `lines`, which `block` has returned; `count` is their number."""
        self._at += len(lines)
        self.taken, self.rows = self.taken + len(lines), self.rows + count

    @property
    def is_open(self) -> bool:
        """Return True if the last line that was consumed has no line break at its end."""
        return self._held[: self._at][-1:] not in (b"", b"\n", b"\r")

    def last_lines(self) -> list[str]:
        """Return at most `LAST_LINES` of the lines that were consumed last."""
        text = self._held[: self._at]
        # the first line in the buffer is left out if its beginning may be missing
        lines = text.splitlines()[0 if len(text) == self.taken else 1 :]
        return [line.decode("utf-8", TEXT_ERRORS) for line in lines[-LAST_LINES:]]

    def _line(self) -> bytes:
        """Return the next complete line without consuming it; empty at the end of the text."""
        while True:
            line = LINE.match(self._held, self._at)
            if line and (line.end() < len(self._held) or line[0].endswith(b"\n")):
                return line[0]
            if not self._more():
                return self._held[self._at :]

    def _more(self) -> bool:
        """Read the next part of the text into the buffer. Return False at the end of the text."""
        kept, rest = self._held[: self._at][-KEPT:], self._held[self._at :]
        if len(rest) > LONGEST or (self.endless and self.padding > LONGEST):
            raise DataError(
                f"{self._label}:row {self.rows + 1}: is longer than {LONGEST // 10**6} million "
                "characters",
                "give a text file with a table",
            )
        data = self._stream.read1(CHUNK)
        self._ended = not data
        if not (self._plain and data.isascii() and not self._decoder.getstate()[0]):
            text = self._decoder.decode(data, final=self._ended)
            data = text.encode("utf-8", TEXT_ERRORS)
        self._held, self._at = kept + rest + self._without_tail(data), len(kept)
        if self._ended and self._held[-1:] not in (b"", b"\n", b"\r") and LINE.match(self._tail):
            # if a line break follows fill characters, they are no padding, but belong to a damaged
            # cell
            self._held, self._tail, self.padding = self._held + self._tail, b"", 0
        self._size += len(data)
        if self._packed is not None:
            refuse_bombs(f"{self._label}: the file", self._size, self._packed, PACKED_TEXT)
        return not self._ended

    def _without_tail(self, data: bytes) -> bytes:
        """Remove fill characters at the end of `data`, and return the rest. The fill characters are
        stored; if more text follows later, they are put before it.
        """
        end = len(data.rstrip(PADDING + b" \r\n"))
        if end:
            data, end = self._tail + data, len(self._tail) + end
            self._tail, self.padding = b"", 0
        begins = (data.find(PADDING[i : i + 1], end) for i in range(len(PADDING)))
        begin = min((place for place in begins if place >= 0), default=len(data))
        if self._tail:
            begin = 0
        tail = data[begin:]
        self.padding += sum(tail.count(PADDING[i : i + 1]) for i in range(len(PADDING)))
        # only as many fill characters are stored as the longest line of a table may have
        self._tail = (self._tail + tail)[:LONGEST]
        return data[:begin]


def head_of(path: Path) -> bytes:
    """Return the first bytes of a file, plain or compressed; empty if it cannot be read."""
    with suppress(*UNREADABLE), path.open("rb") as raw:
        return _unzipped(raw).read(65536)
    return b""


def guess_encoding(path: Path) -> str:
    """Return the encoding of a text file, plain or compressed, judged by its beginning."""
    return encoding_of(head_of(path))


def encoding_of(head: bytes) -> str:
    """Return the encoding of a text, guessed from its first bytes: `utf-8`, UTF-16, an encoding for
    Chinese or Japanese, or otherwise the encoding of Windows for Western European languages
    (`cp1252`), or `latin-1` if no other fits.
    """
    head = head.rstrip(PADDING)
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    for name, halves in (("utf-16-le", head[1::2]), ("utf-16-be", head[::2])):
        # in UTF-16, every second byte of ASCII characters is zero
        if halves.count(0) > 0.35 * len(head):
            return name
    for name in ("utf-8", "gb18030", "shift_jis", "cp1252"):
        if _is_written_in(head, name):
            return name
    return "latin-1"


_PAIRS = {
    "gb18030": (rb"[\xa1-\xf7][\xa1-\xfe]", rb"[\xb0-\xd7]."),
    "shift_jis": (rb"[\x81-\x9f][\x40-\x7e\x80-\xfc]", rb"[\x82-\x9f]."),
}
"""For two encodings: a pattern of two bytes that form one character, and a pattern of those pairs
that are frequent letters. All other characters of the texts are ASCII.

The frequent letters distinguish these texts from texts in European languages. There, bytes above
0x7f usually stand alone. But two small letters with accents in a row look like a rare Chinese
letter, and the apostrophe of Windows with the letter after it looks like a Japanese letter.
"""


def _is_written_in(head: bytes, name: str) -> bool:
    """Return True if a text that begins with these bytes is probably in the encoding `name`.

    The bytes must be valid in this encoding. An encoding for Chinese or Japanese, which has
    characters of two bytes, must fulfil two more conditions: at least half of these characters are
    letters that are frequent in the language, and at least two such characters follow each other.
    """
    try:
        # an incremental decoder is used, because it accepts an incomplete character at the end of
        # `head`
        codecs.getincrementaldecoder(name)().decode(head)
    except UnicodeDecodeError:
        return False
    if name not in _PAIRS:
        return True
    pair, frequent = _PAIRS[name]
    pairs = [symbol for symbol in re.findall(rb"[\x00-\x7f]|%b" % pair, head) if len(symbol) == 2]
    letters = [symbol for symbol in pairs if re.fullmatch(frequent, symbol)]
    is_whole = re.fullmatch(rb"(?:[\x00-\x7f]|%b)*[\x81-\xfe]?" % pair, head) is not None
    has_word = re.search(rb"(?:%b){2}" % pair, head) is not None
    return is_whole and has_word and 2 * len(letters) >= len(pairs)


def csv_records(
    lines: Iterable[str], delimiter: str, label: str, row: int = 0
) -> Iterator[tuple[str, list[str], int]]:
    """Yield each record of a CSV text: its text, its fields, and the number of its last line. `row`
    is the number of lines before the first. Lines are consumed only when they are needed.

    A quoted field may contain line breaks. If quotation marks in a line are damaged, as in
    `"20"1.2`, the line is split at every delimiter. Raises DataError if a quotation mark is not
    closed, or if whole records seem to be inside quotation marks.
    """
    texts: list[str] = []

    def remembered() -> Iterator[str]:
        for line in lines:
            texts.append(line)
            yield line

    reader = csv.reader(remembered(), delimiter=delimiter, strict=True)
    while True:
        try:
            cells = next(reader, None)
        except csv.Error as error:
            if len(texts) != 1 or "end of data" in str(error):
                raise _left_open(label, row) from error
            cells = texts[0].rstrip("\r\n").split(delimiter)
        if cells is None:
            return
        if len(texts) > 1 and any(_holds_record(cell, delimiter) for cell in cells):
            raise _left_open(label, row)
        row += len(texts)
        yield "".join(texts), cells, row
        texts.clear()


def _left_open(label: str, row: int) -> DataError:
    message = f"{label}:row {row + 1}: a quotation mark opens here and is not closed"
    return DataError(message, "close it, or remove it")


def _holds_record(cell: str, delimiter: str) -> bool:
    """Return True if a cell contains several lines, and one of them, except the first, looks like a
    record of the table: it contains a delimiter and a number. A quotation mark before it is then
    probably not closed.
    """
    return any(
        delimiter in line and any(holds_number(part.strip(' "')) for part in line.split(delimiter))
        for line in cell.splitlines()[1:]
    )
