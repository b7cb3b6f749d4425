"""Find tables that stand below each other in one text, or in one sheet of a workbook."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import TableRequest

Row = tuple[int, Sequence[Any]]
"""Number of a row in the file, counted from 1, and its cells."""

FEWEST = 2
"""Smallest number of rows of a table. A single row of numbers belongs to the text above the next
table.
"""


@dataclass(frozen=True)
class Below:
    """One of several tables: the words above it, its header lines, and its rows."""

    title: str
    header: Sequence[Row]
    rows: Sequence[Row]


def tables_below(rows: Iterable[Row], header: int, is_number: Callable[[Any], bool]) -> list[Below]:
    """Return the tables in rows without blank ones.

    A table has `header` lines of words directly above its numbers. It ends at a line without
    numbers or with another number of cells. If tables have no header lines, it also ends at a blank
    line.
    """
    found: list[Below] = []
    words: list[Row] = []
    body: list[Row] = []

    def close() -> None:
        nonlocal words, body
        if len(body) < FEWEST or len(words) < header:
            words += body
        else:
            above = words[: len(words) - header]
            cells = (str(cell).strip() for _, row in above for cell in row if _is_filled(cell))
            found.append(Below(" ".join(cells), words[len(above) :], body))
            words = []
        body = []

    for number, cells in rows:
        filled = [cell for cell in cells if _is_filled(cell)]
        count = sum(map(is_number, filled))
        has_numbers = count > 1 or 0 < count == len(filled)
        if body:
            before, last = body[-1]
            is_apart = not header and number > before + 1
            if not has_numbers or len(cells) != len(last) or is_apart:
                close()
        (body if has_numbers else words).append((number, cells))
    close()
    return found


def chosen_table(
    rows: Iterable[Row], request: TableRequest, is_number: Callable[[Any], bool]
) -> Below:
    """Return the table with the number that a request gives. Raises DataError if there is no such
    table.
    """
    tables = tables_below(rows, request.header, is_number)
    assert request.table is not None
    if request.table > len(tables):
        raise DataError(
            (
                f"{request.label}: there is no table {request.table}: the file has {len(tables)}, "
                f"one below the other, with {request.header} header lines each"
            ),
            "correct `table` or `header`",
        )
    return tables[request.table - 1]


def _is_filled(cell: object) -> bool:
    return cell is not None and bool(str(cell).strip())
