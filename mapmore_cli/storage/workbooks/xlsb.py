"""Extract facts about cells, for example errors, from binary workbooks in an archive (.xlsb). The
values of the cells are read elsewhere.

Each record is preceded by its kind and its length, which are encoded with seven bits per byte
([MS-XLSB], 2.1.4).
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from struct import unpack_from

from mapmore_cli.storage.workbooks.facts import (
    ERRORS,
    PERCENT,
    PERCENT_BUILT_IN,
    Fact,
    hidden_columns,
    hidden_rows,
    is_percent,
    never_computed,
)
from mapmore_cli.storage.workbooks.markup import part_of_sheet

BOOK, STYLES = "xl/workbook.bin", "xl/styles.bin"
# kinds of records that contain a cell; the record begins with the column and the style of the cell
CELLS = range(1, 12)
COLUMNS, FORMAT, STYLES_OF_CELLS, END_OF_STYLES, STYLE = 60, 44, 617, 618, 47
ROW, ERROR_CELL, SHEET, MERGED = 0, 3, 156, 176
FORMULA_TEXT, FORMULA_NUMBER, FORMULA_FLAG, FORMULA_ERROR = 8, 9, 10, 11


def facts_of(archive: zipfile.ZipFile, title: str) -> Iterator[Fact]:
    """Yield facts about the cells of a sheet, for example errors and hidden rows. Raises
    struct.error if a record is incomplete.
    """
    content = archive.read(part_of_sheet(archive, BOOK, _key_of_sheet(archive.read(BOOK), title)))
    percent, row, empty, computed = _percent_styles(archive), 0, list[tuple[int, int]](), False
    for kind, record in _records(content):
        if percent and kind in CELLS:
            column, style = unpack_from("<2I", record)
            if style & 0xFFFFFF in percent:
                yield row, column, row, column, PERCENT
        if kind == ROW:
            (row,) = unpack_from("<I", record)
            if len(record) > 11 and record[11] & 0x10:
                yield hidden_rows(row, row)
        elif kind == COLUMNS:
            first, last, _, _, flags = unpack_from("<4IH", record)
            if flags & 1:
                yield hidden_columns(first, last)
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


def _percent_styles(archive: zipfile.ZipFile) -> frozenset[int]:
    """Return the numbers of the styles of cells that show per cent."""
    if STYLES not in archive.namelist():
        return frozenset()
    formats, styles, is_of_cells = set(PERCENT_BUILT_IN), list[int](), False
    for kind, record in _records(archive.read(STYLES)):
        is_of_cells = kind == STYLES_OF_CELLS or (is_of_cells and kind != END_OF_STYLES)
        if kind == FORMAT and is_percent(_text(record, 2)[0]):
            formats.add(unpack_from("<H", record)[0])
        elif kind == STYLE and is_of_cells:
            styles.append(unpack_from("<H", record, 2)[0])
    return frozenset(number for number, layout in enumerate(styles) if layout in formats)


def _records(content: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield the kind and the content of every record."""
    place = 0
    while place < len(content):
        kind, place = content[place], place + 1
        if kind & 128:
            kind, place = (kind & 127) | content[place] << 7, place + 1
        length, place = _length(content, place)
        yield kind, content[place : place + length]
        place += length


def _length(content: bytes, place: int) -> tuple[int, int]:
    """Decode the length of a record, which is stored at a position. Return the length and the
    position after it.
    """
    length = 0
    for number in range(4):
        part = content[place + number]
        length |= (part & 127) << 7 * number
        if not part & 128:
            break
    return length, place + number + 1


def _key_of_sheet(book: bytes, title: str) -> str:
    """Return the key of the link from a workbook to the sheet with this title. Raises ValueError if
    there is no such sheet.
    """
    for kind, record in _records(book):
        if kind == SHEET:
            key, place = _text(record, 8)
            if _text(record, place)[0] == title:
                return key
    raise ValueError(f"there is no sheet '{title}'")


def _text(record: bytes, place: int) -> tuple[str, int]:
    """Return the text at a position, and the position after it."""
    end = place + 4 + 2 * unpack_from("<I", record, place)[0]
    return record[place + 4 : end].decode("utf-16-le"), end
