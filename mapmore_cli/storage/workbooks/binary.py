"""Extract facts about cells, for example errors, from workbooks of older programs (.xls). The
values of the cells are read elsewhere.

An .xls file is divided into sectors of equal size. A table gives the next sector of each sector, so
that chains of sectors form streams ([MS-CFB]). One stream consists of the records of the workbook
and its sheets ([MS-XLS]).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from struct import error, unpack_from

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

BEGINS = b"\xd0\xcf\x11\xe0"
BEGIN, END, SHEET, BOOL_OR_ERROR, FORMULA = 0x809, 0x0A, 0x85, 0x205, (0x06, 0x206, 0x406)
ROW, COLUMNS, STYLE, FORMAT = 0x208, 0x7D, 0xE0, 0x41E
NUMBERS, ROW_OF_NUMBERS = (0x203, 0x27E, *FORMULA), 0xBD
# numbers from this one on are no sectors: they mean, for example, the end of a chain
IN_STREAM = 0xFFFFFFF0


def facts_of(content: bytes, title: str) -> list[Fact]:
    """Return facts about the cells of a sheet, for example errors and hidden rows; empty if they
    cannot be extracted.
    """
    with suppress(error, IndexError, ValueError):
        if content.startswith(BEGINS):
            return list(_facts_of_records(_stream(content), title))
    return []


def _stream(content: bytes) -> bytes:
    """Return the bytes of the stream, in an .xls file, that consists of the records of the
    workbook.
    """
    size, small = 1 << unpack_from("<H", content, 30)[0], 1 << unpack_from("<H", content, 32)[0]
    directory, _, limit, small_table, _, more = unpack_from("<6I", content, 48)
    places = list(unpack_from("<109I", content, 76))
    while more < IN_STREAM and len(places) * size < len(content):
        *further, more = unpack_from(f"<{size // 4}I", content, (more + 1) * size)
        places += further
    table = _numbers(b"".join(_sector(content, n, size) for n in places if n < IN_STREAM))

    def chained(start: int, chain: Sequence[int], source: bytes, step: int, first: int) -> bytes:
        parts, at = list[bytes](), start
        while at < IN_STREAM and len(parts) <= len(chain):
            parts.append(source[(at + first) * step : (at + first + 1) * step])
            at = chain[at]
        return b"".join(parts)

    entries = chained(directory, table, content, size, 1)
    root = b""
    for place in range(0, len(entries), 128):
        name = entries[place : place + unpack_from("<H", entries, place + 64)[0]]
        start, length = unpack_from("<2I", entries, place + 116)
        if not place:
            root = chained(start, table, content, size, 1)
        if name.decode("utf-16-le").rstrip("\0") in ("Workbook", "Book"):
            if length >= limit:
                return chained(start, table, content, size, 1)[:length]
            inner = _numbers(chained(small_table, table, content, size, 1))
            return chained(start, inner, root, small, 0)[:length]
    return b""


def _sector(content: bytes, number: int, size: int) -> bytes:
    return content[(number + 1) * size : (number + 2) * size]


def _numbers(content: bytes) -> Sequence[int]:
    return unpack_from(f"<{len(content) // 4}I", content)


def _records(stream: bytes, place: int) -> Iterator[tuple[int, bytes]]:
    """Yield the kind and the content of each record of one substream (the workbook or a sheet),
    which begins at `place` in the stream.
    """
    depth = 0
    while place + 4 <= len(stream):
        kind, length = unpack_from("<2H", stream, place)
        yield kind, stream[place + 4 : place + 4 + length]
        depth += (kind == BEGIN) - (kind == END)
        if depth <= 0:
            return
        place += 4 + length


def _facts_of_records(stream: bytes, title: str) -> Iterator[Fact]:
    starts = [
        unpack_from("<I", content)[0]
        for kind, content in _records(stream, 0)
        if kind == SHEET and _title(content) == title
    ]
    percent = _percent_styles(stream)
    empty, computed = list[tuple[int, int]](), False
    for kind, content in _records(stream, starts[0]):
        if percent and kind in NUMBERS:
            row, column, style = unpack_from("<3H", content)
            if style in percent:
                yield row, column, row, column, PERCENT
        if kind == ROW_OF_NUMBERS and percent:
            row, column = unpack_from("<2H", content)
            for place in range(4, len(content) - 2, 6):
                if unpack_from("<H", content, place)[0] in percent:
                    yield row, column + place // 6, row, column + place // 6, PERCENT
        elif kind == ROW and unpack_from("<H", content, 12)[0] & 0x20:
            (row,) = unpack_from("<H", content)
            yield hidden_rows(row, row)
        elif kind == COLUMNS and unpack_from("<H", content, 8)[0] & 1:
            yield hidden_columns(*unpack_from("<2H", content))
        elif kind == BOOL_OR_ERROR and content[7]:
            row, column = unpack_from("<2H", content)
            yield row, column, row, column, ERRORS.get(content[6], "#VALUE!")
        elif kind in FORMULA:
            row, column = unpack_from("<2H", content)
            value = content[6:14]
            if value.endswith(b"\xff\xff") and value[0] == 2:
                yield row, column, row, column, ERRORS.get(value[2], "#VALUE!")
            elif value.endswith(b"\xff\xff") and value[0] == 3:
                empty.append((row, column))
            else:
                computed = True
    yield from never_computed(empty, computed)


def _percent_styles(stream: bytes) -> frozenset[int]:
    """Return the numbers of the styles of cells that show per cent."""
    formats, styles = set(PERCENT_BUILT_IN), list[int]()
    for kind, content in _records(stream, 0):
        if kind == FORMAT:
            number, length, is_wide = unpack_from("<2HB", content)
            text = content[5 : 5 + length * (2 if is_wide & 1 else 1)]
            if is_percent(text.decode("utf-16-le" if is_wide & 1 else "latin-1")):
                formats.add(number)
        elif kind == STYLE:
            styles.append(unpack_from("<H", content, 2)[0])
    return frozenset(number for number, layout in enumerate(styles) if layout in formats)


def _title(content: bytes) -> str:
    """Return the title of a sheet from its record."""
    length, is_wide, letters = content[6], content[7] & 1, content[8:]
    return (
        letters[: 2 * length].decode("utf-16-le") if is_wide else letters[:length].decode("latin-1")
    )
