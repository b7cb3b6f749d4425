"""Recognise the format of a file by its first bytes, whatever its name."""

from __future__ import annotations

import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Collection
from pathlib import Path

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import Reader
from mapmore_cli.storage.tables.lines import head_of, is_zipped

OTHERS = {
    b"PK\x03\x04": "a ZIP archive",
    b"7z\xbc\xaf\x27\x1c": "a 7z archive",
    b"Rar!": "a RAR archive",
    b"\x28\xb5\x2f\xfd": "a file compressed with Zstandard",
    b"\xd0\xcf\x11\xe0": "an old document of Office",
    b"SQLite format 3": "an SQLite database",
    b"ARROW1": "a Feather file",
    b"\x93NUMPY": "a single NumPy array (.npy)",
    b"%PDF": "a PDF document",
    b"\x89PNG": "a picture",
    b"\xff\xd8\xff": "a picture",
}
"""Kinds of files that no reader reads, by their first bytes."""

UTF_16 = (BOM_UTF16_LE, BOM_UTF16_BE)
_LEAST = {bytes({*b"\t\r\n", *range(32, 127)}): 0.6, b"0123456789": 0.1}
"""Smallest fractions of printable ASCII characters and of digits in the first bytes of a text with
a table, in every encoding. In binary files, these fractions are about 0.4 and 0.04.
"""


def begins_like(reader: Reader, head: bytes) -> bool:
    """Return True if the first bytes of a file match the pattern `begins` of the reader."""
    return bool(reader.begins) and re.match(reader.begins, head, re.DOTALL) is not None


def is_binary(head: bytes) -> bool:
    """Return True if the first bytes of a file, `head`, cannot begin a text in any encoding."""
    # NUL bytes are removed, because UTF-16 has one beside each ASCII character
    filled = head.replace(b"\0", b"")
    return (
        b"\0" in head
        and not head.startswith(UTF_16)
        and any(
            len(filled) - len(filled.translate(None, some)) < least * len(filled)
            for some, least in _LEAST.items()
        )
    )


def refuse_other_format(
    reader: Reader, readers: Collection[Reader], path: Path, label: str
) -> None:
    """Raise DataError if a file does not suit its reader: if it begins like a file for another of
    the `readers`, or if the reader reads texts and the file is binary.
    """
    # the beginning of a pipe is not examined, because a pipe can be read only once
    head = head_of(path) if path.is_file() else b""
    if b"\0" not in head or begins_like(reader, head):
        return
    with path.open("rb") as raw:
        unpack = "unpack it, and " if is_zipped(raw) else ""
    for other in readers:
        if begins_like(other, head):
            raise DataError(
                f"{label}: is no file for the reader `{reader.name}`, because it begins like one "
                f"for the reader `{other.name}`",
                f"{unpack}write `reader: {other.name}`",
            )
    kind = next((kind for begin, kind in OTHERS.items() if head.startswith(begin)), None)
    if "encoding" in reader.keys and (kind or is_binary(head)):
        raise DataError(
            f"{label}: is no text file, but {kind or 'a binary file of an unknown format'}",
            "export its table as CSV with the program that wrote it; unpack an archive first",
        )
