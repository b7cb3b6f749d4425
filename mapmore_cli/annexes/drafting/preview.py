"""The first lines of a file: how it is laid out, before anything is known of what it holds."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from mapmore_cli.annexes.drafting.filenames import UNIT
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.readers import reader_of, suffix_of
from mapmore_cli.storage.tables import Top

WIDEST, LINES = 2000, 200  # columns, and lines of a table, that `init` looks at
MOST_HEADER_LINES, MOST_UNIT_LINES = 9, 2
REMARKS = ("#", "%", "//", "!")  # what a line begins with that is no data
FEW = 5  # lines
# as microcontrollers plot: `t:12,p:3.4`
_LABELLED = re.compile(r"\s*[A-Za-z_]\w*\s*[:=]\s*[-+]?[.\d]\S*")
Row = Sequence[Any]


@dataclass(frozen=True)
class Preview:
    """How a file is read: by which `reader` with which `settings` of `data`, and the `titles` of
    its columns where it has a header.

    `below` are the texts under the titles, as units, where the header has more lines. `sheets` are
    those of a workbook that are laid out alike, where there is more than one and they are not all;
    `left` are the others. `addresses` lead to the columns of a file that is a tree. `remark` says
    that the titles stand in a remark before the numbers, which is no header to read; `told`
    are the sheets that are read, where each tells what was held, as `2 bar`; `numeric` are the
    places of columns of numbers.
    """

    reader: str
    width: int
    titles: tuple[str, ...] | None
    settings: dict[str, Any] = field(default_factory=dict)
    below: tuple[str, ...] = ()
    sheets: tuple[str, ...] = ()
    left: tuple[str, ...] = ()
    addresses: tuple[str, ...] = ()
    remark: bool = False
    told: tuple[str, ...] = ()
    numeric: tuple[int, ...] = field(default=(), compare=False)

    @property
    def columns(self) -> tuple[str | int, ...]:
        """How the spec names the columns: by their addresses, by their titles where each has one of
        its own, else by their indices.
        """
        if self.addresses:
            return self.addresses
        named = (
            self.titles is not None
            and not self.remark
            and all(self.titles)
            and len(set(self.titles)) == self.width
        )
        return self.titles if named and self.titles is not None else tuple(range(self.width))


@dataclass(frozen=True)
class _Table:
    """A table that was found: its layout, how many rows it has, and how many columns of other texts
    than words.
    """

    layout: Preview
    rows: int
    doubtful: int
    sheet: str | None


def preview(path: Path, least: int = 2) -> Preview:
    """Look at the beginning of a file; DataError where it holds no table of numbers, in `least`
    columns, that `init` can lay out.
    """
    reader = reader_of(path)
    if reader is None:
        raise DataError(
            f"{path.name}: no reader takes {suffix_of(path) or 'files without a suffix'}",
            "save the table as CSV",
        )
    remedy = f"write `columns` by hand, as `pressure: {{column: {reader.column}, unit: kPa}}`"
    if reader.peek is None:
        raise DataError(f"{path.name}: its arrays have to be named", remedy)
    try:
        tops = list(reader.peek(path, LINES))
    except DataError as fault:  # what a reader tells of a file says how to save it otherwise
        raise DataError(
            ": ".join([fault.message, *([fault.remedy] if fault.remedy else [])])
        ) from fault
    if (width := max((len(row) for top in tops for row in top.rows), default=0)) > WIDEST:
        raise DataError(f"{path.name}: has {width} columns, more than {WIDEST}", remedy)
    tables = [
        table for table in (_table_in(top, reader.name, least) for top in tops) if table is not None
    ]
    if not tables:
        if any(
            _LABELLED.fullmatch(str(cell))
            for top in tops
            for row in top.rows[-FEW:]
            for cell in row
        ):
            line = f"sed -E 's/[A-Za-z_][A-Za-z_0-9]*[:=] *//g' '{path.name}' > '{path.stem}.csv'"
            raise DataError(
                f"{path.name}: its cells are `name:number`; take the names off, as by: {line}"
            )
        lines = f" in its first {len(tops[0].rows)} lines" if tops[0].rows else ""
        raise DataError(
            f"{path.name}: no table of numbers was found{lines}",
            f"save the table as CSV, or {remedy}",
        )
    found = max(tables, key=lambda table: (-table.doubtful, table.rows))
    return (
        found.layout
        if found.sheet is None
        else _of_all_sheets(found, tables, [top.sheet for top in tops if top.sheet is not None])
    )


def _of_all_sheets(found: _Table, tables: Sequence[_Table], sheets: Sequence[str]) -> Preview:
    """Return the layout of the sheet with the most rows, for it and all that are like it."""

    def shape(layout: Preview) -> Preview:
        return replace(layout, settings={**layout.settings, "sheet": ""}, below=())

    alike = tuple(
        str(table.sheet) for table in tables if shape(table.layout) == shape(found.layout)
    )
    layout = replace(found.layout, left=tuple(sheet for sheet in sheets if sheet not in alike))
    if len(alike) == 1:
        return layout
    told = alike if all(re.search(rf"\d\s*{UNIT}", name, re.IGNORECASE) for name in alike) else ()
    is_every = len(alike) == len(sheets)
    settings = {**layout.settings, "sheet": "*" if is_every else alike[0]}
    return replace(layout, settings=settings, sheets=() if is_every else alike, told=told)


def _table_in(first_rows: Top, reader: str, least: int) -> _Table | None:
    """Return the table that the last rows belong to; None where they are no numbers in enough
    columns.

    Cells may be empty, a word may stand for a missing number, and whole columns may hold words.
    Rows right before it with as many cells are the header, what stands before these is skipped. The
    very last row may be cut off, or be a remark.
    """
    whole, width = _without_closing_lines(first_rows.rows)
    numeric = _numeric_columns(
        [row for row in whole[len(whole) // 2 :] if len(row) == width], first_rows.is_number
    )
    if len(numeric) < least:
        return None
    blank = [not _nonempty(row) for row in whole]
    filled = [
        _nonempty([row[place] for place in numeric])
        if len(row) == width or (reader == "xlsx" and len(row) > width)
        else []
        for row in whole
    ]
    numbers = [sum(map(first_rows.is_number, cells)) for cells in filled]
    start = next((i for i in range(len(whole), 0, -1) if not (blank[i - 1] or numbers[i - 1])), 0)
    unit_lines = range(start, min(start + MOST_UNIT_LINES, len(whole)))  # `kPa;1` has a number
    first = next(
        (
            i + 1
            for i in reversed(unit_lines)
            if start and filled[i] and 2 * numbers[i] <= len(filled[i])
        ),
        start,
    )
    while first < len(whole) and blank[first]:
        first += 1
    # beyond the table a sheet may hold notes
    least = max(numeric) + 1 if reader == "xlsx" else width
    top = next(
        (
            i
            for i in range(first, 0, -1)
            if blank[i - 1] or not _may_be_titles(whole[i - 1], width, least)
        ),
        0,
    )
    if first == len(whole) or first - top > MOST_HEADER_LINES:
        return None
    counts = [len(_nonempty(row)) for row in whole[top:first]]
    # names of a rig or a date stand in few cells
    top += next((place for place, count in enumerate(counts) if 2 * count > max(counts)), 0)
    header = first - top
    above = [[*row, *(None for _ in range(width - len(row)))] for row in whole[top:first]]
    titles = (
        tuple("" if cell is None else str(cell).strip().strip('"') for cell in above[0])
        if header
        else None
    )
    below = tuple(
        " ".join(str(row[place]) for row in above[1:] if row[place] is not None)
        for place in range(width)
    )
    shape = {
        **({} if header == 1 else {"header": header or False}),
        **({"skip_rows": top} if top else {}),
    }
    layout = Preview(
        reader,
        width,
        titles,
        {**first_rows.settings, **shape},
        below if header > 1 else (),
        numeric=tuple(numeric),
    )
    if (
        not header
        and first
        and len(whole[first - 1]) == width + 1
        and whole[first - 1][0] in REMARKS
    ):
        layout = replace(layout, titles=tuple(map(str, whole[first - 1][1:])), remark=True)
    if first_rows.addresses:
        layout = replace(layout, settings={**first_rows.settings}, addresses=first_rows.addresses)
    words = [
        _nonempty([row[place] for row in whole[first:] if len(row) == width])
        for place in range(width)
        if place not in numeric
    ]
    doubtful = sum(any(mark in str(cells[0]) for mark in "0123456789") for cells in words if cells)
    return _Table(layout, len(whole) - first, doubtful, first_rows.sheet)


def _may_be_titles(row: Row, width: int, least: int) -> bool:
    """Return True for a row of as many cells as the table, or of as many filled ones as it needs at
    `least`.
    """
    return len(row) == width or (
        len(row) < width and len(row) >= least and len(_nonempty(row)) == len(row)
    )


def _without_closing_lines(rows: Sequence[Row]) -> tuple[Sequence[Row], int]:
    """Return the rows without the last one and without closing remarks, and the number of cells
    that most of the later ones have.
    """
    whole = rows[:-1] if len(rows) > 1 else rows
    widths = Counter(len(row) for row in whole[len(whole) // 2 :] if _nonempty(row))
    width = widths.most_common(1)[0][0] if widths else 0
    end = next(
        (
            i
            for i in range(len(whole), 0, -1)
            if len(whole[i - 1]) == width and _nonempty(whole[i - 1])
        ),
        0,
    )
    return whole[:end], width


def _numeric_columns(rows: Sequence[Row], is_number: Callable[[Any], bool]) -> list[int]:
    """Return the columns of which most cells that are filled are numbers."""
    columns = [_nonempty(cells) for cells in zip(*rows, strict=True)]
    return [
        place for place, cells in enumerate(columns) if 2 * sum(map(is_number, cells)) > len(cells)
    ]


def _nonempty(row: Row) -> list[Any]:
    return [cell for cell in row if cell is not None and str(cell).strip()]
