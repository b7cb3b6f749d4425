"""The first lines of a file: how it is laid out, before anything is known of what it holds."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from mapmore_cli.annexes.drafting.filenames import UNIT
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.spec.units import check_unit
from mapmore_cli.storage.readers import reader_of, suffix_of
from mapmore_cli.storage.tables import Top

WIDEST, LINES = 2000, 200  # columns, and lines of a table, that `init` looks at
MOST_UNIT_LINES = 2  # that have a number, as `kPa;1`
REMARKS = ("#", "%", "//", "!")  # what a line begins with that is no data
FEW = 5  # lines
LETTERS = "smNVAKgh1%-"  # that are units as everybody writes them
# as microcontrollers plot: `t:12,p:3.4`
_LABELLED = re.compile(r"\s*[A-Za-z_]\w*\s*[:=]\s*[-+]?[.\d]\S*")
UNREAD = {
    "zip 7z rar tar tgz zst": "unpack it",
    "mf4 mdf": "export it as CSV, as by `asammdf.MDF(path).export('csv')`",
    "json ndjson jsonl": "save a table, as by `pandas.json_normalize(records).to_csv(...)`",
    "npy": "save it under a name, as by `numpy.savez('log.npz', force=force)`",
    "pkl pickle joblib": "it could run code, and is never opened; save its arrays as CSV or .npz",
    "bag db3 mcap": "export its topics as CSV with the tools of ROS",
    "feather arrow orc": "save it as Parquet, as by `pandas.read_feather(path).to_parquet(...)`",
    "db sqlite mdb accdb numbers wav c3d bin raw": "export its table as CSV",
}
"""Suffixes of files that may hold data and that no reader takes, and what to do."""

Row = Sequence[Any]


@dataclass(frozen=True)
class Preview:
    """How a file is read: by which `reader` with which `settings` of `data`, and the `titles` of
    its columns where it has a header.

    - `units`: of each column as the file writes it, empty where it writes none.
    - `sheets`: those of a workbook that are laid out alike, where there is more than one and they
      are not all; `left` are the others; `told` those that are read, where each tells what was
      held, as `2 bar`.
    - `addresses`: lead to the columns of a file that is a tree.
    - `remark`: True where the titles stand in a line that is no header to read.
    - `numeric`: the places of columns of numbers.
    """

    reader: str
    width: int
    titles: tuple[str, ...] | None
    settings: dict[str, Any] = field(default_factory=dict)
    units: tuple[str, ...] = ()
    sheets: tuple[str, ...] = ()
    left: tuple[str, ...] = ()
    addresses: tuple[str, ...] = ()
    remark: bool = False
    told: tuple[str, ...] = ()
    numeric: tuple[int, ...] = field(default=(), compare=False)

    @property
    def columns(self) -> tuple[str | int, ...]:
        """How the spec names the columns: by their addresses, else by the titles that one column
        alone has, else by their 0-based indices.
        """
        if self.addresses:
            return self.addresses
        titles = () if self.titles is None or self.remark else self.titles
        names = {title for title, count in Counter(titles).items() if title and count == 1}
        named = tuple(title if title in names else place for place, title in enumerate(titles))
        return named or tuple(range(self.width))


@dataclass(frozen=True)
class _Table:
    """A table in a file: its layout, how many rows it has, and how many columns of other texts than
    words.
    """

    layout: Preview
    rows: int
    doubtful: int
    sheet: str | None


def unread(path: Path) -> str | None:
    """Return why a file that may hold data is passed over, and what to do; None for others."""
    suffix = suffix_of(path)
    remedy = next((how for which, how in UNREAD.items() if suffix[1:] in which.split()), None)
    if remedy is None or reader_of(path) is not None:
        return None
    return f"{path.name}: no reader takes {suffix}; {remedy}"


def preview(path: Path, least: int = 2) -> Preview:
    """Look at the beginning of a file; DataError where it holds no table of numbers, in `least`
    columns, that `init` can lay out.
    """
    reader = reader_of(path)
    if reader is None:
        what = f"{path.name}: no reader takes {suffix_of(path) or 'files without a suffix'}"
        raise DataError(unread(path) or what, None if unread(path) else "save the table as CSV")
    remedy = f"write `columns` by hand, as `pressure: {{column: {reader.column}, unit: kPa}}`"
    if reader.peek is None:
        raise DataError(f"{path.name}: its arrays have to be named", remedy)
    try:
        tops = list(reader.peek(path, LINES))
    except DataError as fault:  # what a reader tells of a file says how to save it otherwise
        raise DataError(": ".join(filter(None, [fault.message, fault.remedy]))) from fault
    if (width := max((len(row) for top in tops for row in top.rows), default=0)) > WIDEST:
        raise DataError(f"{path.name}: has {width} columns, more than {WIDEST}", remedy)
    tables = [table for top in tops if (table := _table_in(top, reader.name, least)) is not None]
    if not tables:
        raise _no_table(path, tops, remedy)
    best = max(tables, key=lambda table: (-table.doubtful, table.rows))
    if best.sheet is None:
        return best.layout
    return _of_all_sheets(best, tables, [top.sheet for top in tops if top.sheet is not None])


def _no_table(path: Path, tops: Sequence[Top], remedy: str) -> DataError:
    last = [str(cell) for top in tops for row in top.rows[-FEW:] for cell in row]
    if any(map(_LABELLED.fullmatch, last)):
        line = f"sed -E 's/[A-Za-z_][A-Za-z_0-9]*[:=] *//g' '{path.name}' > '{path.stem}.csv'"
        return DataError(
            f"{path.name}: its cells are `name:number`; take the names off, as by: {line}"
        )
    lines = f" in its first {len(tops[0].rows)} lines" if tops and tops[0].rows else ""
    return DataError(
        f"{path.name}: no table of numbers was found{lines}", f"save the table as CSV, or {remedy}"
    )


def _of_all_sheets(best: _Table, tables: Sequence[_Table], sheets: Sequence[str]) -> Preview:
    """Return the layout of the sheet with the most rows, for it and all that are like it."""

    def shape(layout: Preview) -> Preview:
        return replace(layout, settings={**layout.settings, "sheet": ""})

    alike = tuple(str(table.sheet) for table in tables if shape(table.layout) == shape(best.layout))
    layout = replace(best.layout, left=tuple(sheet for sheet in sheets if sheet not in alike))
    if len(alike) == 1:
        return layout
    told = alike if all(re.search(rf"\d\s*{UNIT}", name, re.IGNORECASE) for name in alike) else ()
    is_every = len(alike) == len(sheets)
    settings = {**layout.settings, "sheet": "*" if is_every else alike[0]}
    return replace(layout, settings=settings, sheets=() if is_every else alike, told=told)


@dataclass(frozen=True)
class _Numbers:
    """Where the numbers of a table lie: in the columns `numeric` of rows of `wide` cells, from the
    row `first` on; behind the column `last` no cell is filled.
    """

    rows: Sequence[Row]
    wide: int
    numeric: tuple[int, ...]
    first: int
    last: int


def _table_in(top: Top, reader: str, least: int) -> _Table | None:
    """Return the table that the last rows belong to; None where they are no numbers in enough
    columns.

    Cells may be empty, a word may stand for a missing number, and whole columns may hold words. The
    very last row may be cut off, or be a remark.
    """
    rows, wide = _without_closing_lines(top.rows)
    later = [row for row in rows[len(rows) // 2 :] if len(row) == wide]
    columns = [_filled(cells) for cells in zip(*later, strict=True)]
    numeric = tuple(
        place
        for place, cells in enumerate(columns)
        if 2 * sum(map(top.is_number, cells)) > len(cells)
    )
    first = _first_of_numbers(rows, wide, numeric, top)
    if len(numeric) < least or first == len(rows):
        return None
    last = max(place for place, cells in enumerate(columns) if cells)
    layout = _laid_out(_Numbers(rows, wide, numeric, first, last), top, reader)
    words = [
        _filled([row[place] for row in rows[first:] if len(row) == wide])
        for place in range(wide)
        if place not in numeric
    ]
    doubtful = sum(any(map(str.isdigit, str(cells[0]))) for cells in words if cells)
    return _Table(layout, len(rows) - first, doubtful, top.sheet)


def _laid_out(numbers: _Numbers, top: Top, reader: str) -> Preview:
    """Return the layout of a table: which line above the numbers has the titles, and which the
    units.
    """
    lines = _header_lines(numbers, top)
    titled = _line_of_titles(lines, numbers)
    below = [lines[line] for line in sorted(lines) if titled is not None and line > titled]
    units = top.units or tuple(next((cells for cells in below if _mostly_units(cells)), ()))
    header, skipped, titles = 0, numbers.first, list[str]()
    if titled is not None:
        titles = lines[titled]
        if len(numbers.rows[titled]) <= numbers.wide:
            header, skipped = max(lines) - titled + 1, titled
    width = 1 + max(*numbers.numeric, *(place for place, title in enumerate(titles) if title))
    shape = {"header": header or False, "skip_rows": skipped}
    usual = {"header": 1, "skip_rows": 0}
    if top.addresses:
        shape = {}
    return Preview(
        reader,
        width,
        tuple([*titles, *[""] * width][:width]) if titles else None,
        {**top.settings, **{key: value for key, value in shape.items() if value != usual[key]}},
        tuple(map(_bare, units[:width])) if any(units) else (),
        addresses=top.addresses,
        remark=bool(titles) and not header,
        numeric=numbers.numeric,
    )


def _without_closing_lines(rows: Sequence[Row]) -> tuple[Sequence[Row], int]:
    """Return the rows without the last one and without closing remarks, and the number of cells
    that most of the later ones have.
    """
    whole = rows[:-1] if len(rows) > 1 else rows
    widths = Counter(len(row) for row in whole[len(whole) // 2 :] if _filled(row))
    wide = widths.most_common(1)[0][0] if widths else 0
    places = range(len(whole), 0, -1)
    is_whole = (place for place in places if len(row := whole[place - 1]) == wide and _filled(row))
    return whole[: next(is_whole, 0)], wide


def _first_of_numbers(rows: Sequence[Row], wide: int, numeric: Sequence[int], top: Top) -> int:
    """Return the place of the first row below the last one without numbers, or the number of rows.

    A line of units may have a number, as `kPa;1`.
    """
    cells = [_filled([row[place] for place in numeric]) if len(row) == wide else [] for row in rows]
    numbers = [sum(map(top.is_number, own)) for own in cells]
    places = range(len(rows), 0, -1)
    start = next((i for i in places if _filled(rows[i - 1]) and not numbers[i - 1]), 0)
    near = reversed(range(start, min(start + MOST_UNIT_LINES, len(rows)))) if start else ()
    first = next((i + 1 for i in near if cells[i] and 2 * numbers[i] <= len(cells[i])), start)
    return next((i for i in range(first, len(rows)) if _filled(rows[i])), len(rows))


def _header_lines(numbers: _Numbers, top: Top) -> dict[int, list[str]]:
    """Return the lines right above the numbers that may be titles or units, by their places: they
    reach as far as the numbers, and no cell beyond these is filled.

    Blank lines may stand below titles and above a line of units. The mark of a remark is no cell,
    where it stands alone.
    """
    lines: dict[int, list[str]] = {}
    for place in reversed(range(numbers.first)):
        cells = ["" if cell is None else str(cell).strip() for cell in numbers.rows[place]]
        if not any(cells):
            if all(map(_mostly_units, lines.values())):
                continue
            break
        if len(cells) == numbers.wide + 1 and cells[0] in REMARKS:
            cells = cells[1:]
        filled = _filled(numbers.rows[place])
        has_numbers = 2 * sum(map(top.is_number, filled)) > len(filled)
        if has_numbers or len(cells) <= numbers.last or any(cells[numbers.wide :]):
            break
        lines[place] = cells
    return lines


def _line_of_titles(lines: Mapping[int, list[str]], numbers: _Numbers) -> int | None:
    """Return the line with the most texts that names half of the columns of numbers, and is no line
    of units: the first of equals, and the last of remarks, where all are remarks.
    """

    def rank(line: int) -> tuple[bool, int, int]:
        is_remark = str(numbers.rows[line][0]).strip().startswith(REMARKS)
        return not is_remark, len(_filled(lines[line])), line if is_remark else -line

    naming = []
    for line, cells in sorted(lines.items()):
        named = _filled([cells[place] for place in numbers.numeric])
        if 2 * len(named) >= len(numbers.numeric):
            naming.append(line)
    titles = [line for line in naming if len(lines) == 1 or not _mostly_units(lines[line])]
    return max(titles or naming[:1], key=rank, default=None)


def _mostly_units(cells: Sequence[str]) -> bool:
    filled = _filled(cells)
    return 2 * sum(map(_is_unit, filled)) > len(filled)


def _is_unit(cell: str) -> bool:
    """Return True for a unit; of single letters, which titles are as well, for those in daily
    use.
    """
    unit = _bare(cell)
    if len(unit) == 1:
        return unit in LETTERS
    with suppress(SpecError):
        check_unit(unit)
        return True
    return False


def _bare(unit: str) -> str:
    """Return a unit without the mark of a remark before it and the brackets around it."""
    return re.sub(r"^[(\[{<]\s*(.*?)\s*[)\]}>]$", r"\1", unit.lstrip("# "))


def _filled(row: Row) -> list[Any]:
    return [cell for cell in row if cell is not None and str(cell).strip()]
