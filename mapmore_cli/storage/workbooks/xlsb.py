"""What binary workbooks in an archive (.xlsb) say of cells besides their values.

Records follow each other, each with its kind and its length in front, seven bits to a byte
([MS-XLSB], 2.1.4).
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from struct import unpack_from

from mapmore_cli.storage.workbooks.facts import ERRORS, Fact, never_computed
from mapmore_cli.storage.workbooks.markup import part_of_sheet

BOOK = "xl/workbook.bin"
ROW, ERROR_CELL, SHEET, MERGED = 0, 3, 156, 176
FORMULA_TEXT, FORMULA_NUMBER, FORMULA_FLAG, FORMULA_ERROR = 8, 9, 10, 11


def facts_of(archive: zipfile.ZipFile, title: str) -> Iterator[Fact]:
    """Yield what is said of the cells of a sheet; raises struct.error where a record is cut."""
    content = archive.read(part_of_sheet(archive, BOOK, _key_of_sheet(archive.read(BOOK), title)))
    row, empty, computed = 0, list[tuple[int, int]](), False
    for kind, record in _records(content):
        if kind == ROW:
            (row,) = unpack_from("<I", record)
        elif kind in (ERROR_CELL, FORMULA_ERROR):
            column, error = unpack_from("<I4xB", record)
            yield row, column, row, column, ERRORS.get(error, "#VALUE!")
        elif kind == FORMULA_TEXT and unpack_from("<I", record, 8) == (0,):
            empty.append((row, *unpack_from("<I", record)))
        elif kind in (FORMULA_TEXT, FORMULA_NUMBER, FORMULA_FLAG):
            computed = True
        elif kind == MERGED:
            top, bottom, first, last = unpack_from("<4I", record)
            yield top, first, bottom, last, ""
    yield from never_computed(empty, computed)


def _records(content: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield kind and content of every record."""
    place = 0
    while place < len(content):
        kind, place = content[place], place + 1
        if kind & 128:
            kind, place = (kind & 127) | content[place] << 7, place + 1
        length, place = _length(content, place)
        yield kind, content[place : place + length]
        place += length


def _length(content: bytes, place: int) -> tuple[int, int]:
    """Return the length that stands at a place, and the place behind it."""
    length = 0
    for number in range(4):
        part = content[place + number]
        length |= (part & 127) << 7 * number
        if not part & 128:
            break
    return length, place + number + 1


def _key_of_sheet(book: bytes, title: str) -> str:
    """Return the key of the sheet of a title; raise ValueError if there is none."""
    for kind, record in _records(book):
        if kind == SHEET:
            key, place = _text(record, 8)
            if _text(record, place)[0] == title:
                return key
    raise ValueError(f"there is no sheet '{title}'")


def _text(record: bytes, place: int) -> tuple[str, int]:
    """Return the text that stands at a place, and the place behind it."""
    end = place + 4 + 2 * unpack_from("<I", record, place)[0]
    return record[place + 4 : end].decode("utf-16-le"), end
