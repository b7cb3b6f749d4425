"""Find tables that stand below each other or side by side in one text or in one sheet of a
workbook. Also read a map as a table. (In a map, the first line and the first column hold the values
of two quantities, and the other cells hold the values of a third.)
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import TableRequest
from mapmore_cli.storage.tables.rows import Row

FEWEST = 2
"""Smallest number of rows of a table. A single row of numbers belongs to the text above the next
table.
"""


@dataclass(frozen=True)
class Below:
    """One of several tables in a file. `above` holds the words of each line above the table, for
    example its title; `header` holds its header lines, and `rows` its rows.
    """

    above: Sequence[str]
    header: Sequence[Row]
    rows: Sequence[Row]

    @property
    def title(self) -> str:
        """The words above the table."""
        return " ".join(filter(None, self.above))

    @property
    def begin(self) -> int:
        """The number of the first line of the table, also if the table has no rows."""
        return (self.header or self.rows)[0][0]


def tables_below(rows: Iterable[Row], header: int, is_number: Callable[[Any], bool]) -> list[Below]:
    """Return the tables in `rows` from the top to the bottom. Tables that stand side by side follow
    each other from the left to the right. `rows` contains no blank lines; a jump in the row numbers
    shows that the file has one.

    A table has `header` lines of words directly above its numbers. It ends at a line without
    numbers. If tables have no header lines, a table also ends at a blank line, and at the beginning
    of at least `FEWEST` rows with another number of cells. A line whose first cell is a label, such
    as `Maximum:`, belongs to the header if numbers stand below the label. If any other row has too
    few or too many cells, it stays in the table, so that the reader raises an error for it.
    """
    tables: list[Below] = []
    words: list[Row] = []
    body: list[Row] = []

    def close() -> None:
        nonlocal words, body
        if len(body) >= FEWEST and len(words) >= header:
            above, titles = words[: len(words) - header], words[len(words) - header :]
            tables.extend(_side_by_side(above, titles, body))
            words = []
        elif body and tables and not (header or words) and _is_next(tables[-1].rows, body[0]):
            tables[-1] = replace(tables[-1], rows=[*tables[-1].rows, *body])
        else:
            words += body
        body = []

    for number, cells in rows:
        filled = [cell for cell in cells if _text(cell)]
        count = sum(map(is_number, filled))
        has_numbers = count > 1 or 0 < count == len(filled)
        if body and names_its_line(body[0][1][0]) and is_number(cells[0]):
            # the rows in `body` are not data, but header lines with numbers, such as `Maximum:;1;2`
            words += body
            body = []
        if body:
            is_next = _is_next(body, (number, cells))
            is_titled = 0 < header <= len(words) and len(body) >= FEWEST
            fits = len(cells) == len(body[0][1]) or (is_titled and is_next)
            if not (has_numbers and fits and (header or is_next)):
                close()
        (body if has_numbers else words).append((number, cells))
    close()
    return _without_head(tables)


def _without_head(tables: Sequence[Below]) -> list[Below]:
    """Return the tables without the head of the file, for example the name of the logger and the
    date. The lines of the head stand above the first tables, and are in their `above`. Let n be the
    largest number of lines of words above any later table: then only the last n lines are kept for
    the first tables. If n is 0, all lines are kept.
    """
    later = [len(table.above) for table in tables if table.begin > tables[0].begin]
    lines = max(later, default=0)
    # this removes lines from the first tables only, because no later table has more than `lines` of
    # them
    return [replace(table, above=table.above[-lines:]) for table in tables] if lines else [*tables]


def names_its_line(cell: Any) -> bool:
    """Return True if a cell is a label for the other cells of its line, for example `Unit:`."""
    return _text(cell)[1:].endswith((":", "="))


def _is_next(rows: Sequence[Row], row: Row) -> bool:
    """Return True if a row directly follows the last of the `rows`, without a blank line between
    them.
    """
    return row[0] == rows[-1][0] + 1


def _side_by_side(above: Sequence[Row], header: Sequence[Row], rows: Sequence[Row]) -> list[Below]:
    """Return the tables that stand side by side. If the header lines do not repeat, there is a
    single table.

    If a line above the header has words over every table, these words belong to the titles of the
    tables. All tables get the header lines of the first table, so that a spec can use the same
    names of columns for all of them.
    """
    blocks = _repeated_columns([cells for _, cells in header])
    if not blocks:
        return [Below([_joined(cells) for _, cells in above], header, rows)]
    words = [[_joined(cells[block]) for block in blocks] for _, cells in above]
    titles = [*zip(*filter(all, words), strict=True)]
    shared = [(number, cells[blocks[0]]) for number, cells in header]
    tables = []
    for block, title in zip(blocks, titles or [()] * len(blocks), strict=True):
        parts = [(number, _padded(cells[block], blocks[0].stop)) for number, cells in rows]
        tables.append(Below(title, shared, [part for part in parts if _joined(part[1])]))
    return tables


def _repeated_columns(header: Sequence[Sequence[Any]]) -> list[slice]:
    """Return the columns of each table, as slices, if several tables stand side by side. This is so
    if all header lines repeat at equal distances, and the first line has at least two different
    titles. Otherwise, the list is empty.

    The number at the end of titles such as `Force.1` is ignored if there is a title `Force`,
    because pandas writes repeated titles in this way.
    """
    titles, *others = [[_text(cell) for cell in line] for line in header] or [[]]
    for place, title in enumerate(titles):
        base, _, number = title.rpartition(".")
        if number.isdigit() and base in titles[:place]:
            titles[place] = base
    starts = [place for place, title in enumerate(titles) if title == titles[0]]
    if len(starts) < 2 or len({*titles} - {""}) < 2:
        return []
    blocks = [slice(start, start + starts[1]) for start in range(0, len(titles), starts[1])]
    alike = {
        tuple(tuple(_padded(line[block], starts[1])) for line in (titles, *others))
        for block in blocks
    }
    return blocks if len(alike) == 1 else []


def _padded(cells: Sequence[Any], width: int) -> list[Any]:
    """Return the cells, extended by empty cells at the end to `width` cells."""
    return [*cells, *[""] * (width - len(cells))]


def chosen_table(
    rows: Iterable[Row], request: TableRequest, is_number: Callable[[Any], bool]
) -> Below:
    """Return the table with the number `request.table`; if `request.table` is `map`, return the map
    as a table. Raises DataError if there is no such table or no map.
    """
    if request.table == "map":
        return _map_as_table(rows, request.label)
    tables = tables_below(rows, request.header, is_number)
    assert request.table is not None
    if request.table > len(tables):
        raise DataError(
            (
                f"{request.label}: there is no table {request.table}: with `header: "
                f"{request.header}`, {len(tables)} tables were found in the file"
            ),
            "correct `table` or `header`",
        )
    return tables[request.table - 1]


MAP_COLUMNS = ("row", "column", "cell")
"""Titles of the columns of a map: the value at the beginning of the row, the value at the top of
the column, and the cell where both meet.
"""


def _map_as_table(rows: Iterable[Row], label: str) -> Below:
    """Return a map as a table with one row for each cell of the map: the value at the beginning of
    the row, the value at the top of the column, and the cell. Raises DataError if there are no
    cells.
    """
    top, *below = [*rows] or [(0, [])]
    across = [(place, cell) for place, cell in enumerate(top[1]) if place and _text(cell)]
    cells = [
        (number, [row[0], value, row[place] if place < len(row) else ""])
        for number, row in below
        for place, value in across
    ]
    if not cells:
        raise DataError(
            f"{label}: contains no map, in which the first line and the first column hold the "
            "values of two quantities, and the other cells those of a third",
            "correct `skip_rows`, or remove `table: map` if the file is an ordinary table",
        )
    return Below((), [(top[0], MAP_COLUMNS)], cells)


def _joined(cells: Iterable[Any]) -> str:
    """Return the texts of the filled cells, with a blank between them."""
    return " ".join(filter(None, map(_text, cells)))


def _text(cell: object) -> str:
    """Return the text in a cell without blanks around it; empty for an empty cell."""
    return "" if cell is None else str(cell).strip()
