"""Make tables from rows of cells, for example of a sheet of a workbook or of a segment of a LabVIEW
file, and from records with named cells.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import (
    GET_SAMPLES,
    RawTable,
    SourceColumn,
    TableRequest,
    locate_columns,
)
from mapmore_cli.storage.tables.cells import CellReader, NotANumber, holds_number
from mapmore_cli.storage.tables.thousands import may_be_grouped, refuse_grouped

Row = tuple[int, Sequence[Any]]
"""Number of a row in the file, counted from 1, and its cells."""

Wanted = tuple[SourceColumn, int, CellReader]
"""Title of a column, its 0-based index, and the reader of its cells."""


def table_of_rows(
    rows: Iterable[Row],
    places: Mapping[SourceColumn, int],
    names: Sequence[str] | None,
    request: TableRequest,
    label: str,
) -> RawTable:
    """Return the wanted columns of rows of cells as a table. `places` holds the 0-based index of
    each wanted column, and `names` the titles of all columns; it is None if there are no titles. A
    cell that is empty, or that is missing at the end of a short row, is NaN.

    Raises NotANumber, with row and column, for a cell that is no number.
    """
    rows, wanted = list(rows), wanted_of(places, names, request)
    numbers, columns = values_of_rows(rows, wanted, label)
    for (title, place, read), values in zip(wanted, columns, strict=True):
        if read.thousands is None and may_be_grouped(values):
            cells = ((number, row[place]) for number, row in rows if place < len(row))
            refuse_grouped(cells, request.decimal, f"{label}:row {{row}}, column {title}")
    return RawTable(dict(zip(places, columns, strict=True)), numbers, label)


def table_of_records(
    records: Sequence[tuple[int, Sequence[tuple[str, Any]]]], request: TableRequest
) -> RawTable:
    """Return the wanted columns of records as a table. A record is given by its number in the file
    and by pairs of a name and a cell. If a record has no cell with the name of a column, the value
    is NaN. If the request names no columns, all columns of numbers are returned.

    Raises DataError for a name that no record has, or that occurs twice in a record; NotANumber for
    a cell that is no number.
    """
    counts = Counter[str]()
    for _, pairs in records:
        counts |= Counter(name for name, _ in pairs)
    names, rows = list(counts.elements()), [(number, dict(pairs)) for number, pairs in records]
    if not names:
        raise DataError(f"{request.label}: has no records", GET_SAMPLES)
    if not request.columns:
        numeric = [
            name
            for name in counts
            if all(row.get(name) is None or holds_number(row[name]) for _, row in rows)
        ]
        request = replace(request, columns=tuple(numeric), clocks=frozenset(numeric))
    places = locate_columns(request, names, len(names))
    cells = ((number, [row.get(name) for name in names]) for number, row in rows)
    return table_of_rows(cells, places, names, request, request.label)


def wanted_of(
    places: Mapping[SourceColumn, int], names: Sequence[str] | None, request: TableRequest
) -> list[Wanted]:
    """Return the title, the 0-based index and the cell reader of each wanted column. `places` holds
    the index of each wanted column.
    """
    return [
        (column if names is None else names[place], place, request.cells(column))
        for column, place in places.items()
    ]


def values_of_rows(
    rows: Iterable[Row],
    wanted: Sequence[Wanted],
    label: str,
    hint: Callable[[Sequence[Any]], str | None] = lambda _row: None,
) -> tuple[IntArray, Array]:
    """Return the row numbers, (n,), and the values of the `wanted` columns, (k, n).

    Raises NotANumber, with row and column, for a cell that is no number. If `hint` returns a text
    for the row, this text replaces the usual remedy in the message.
    """
    numbers: list[int] = []
    values: list[float] = []
    for number, row in rows:
        numbers.append(number)
        for title, place, read in wanted:
            try:
                values.append(read(row[place] if place < len(row) else ""))
            except NotANumber as odd:
                raise odd.at(f"{label}:row {number}, column {title}", hint(row)) from None
    columns = np.array(values).reshape(len(numbers), len(wanted)).T
    return np.array(numbers, dtype=np.int64), columns
