"""Tables that come row by row, cell by cell: a sheet of a workbook, a segment of a LabVIEW file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from mapmore_cli.storage.tables import RawTable, SourceColumn, TableRequest
from mapmore_cli.storage.tables.cells import NotANumber

Row = tuple[int, Sequence[Any]]
"""Number in the file, from 1, and the cells."""


def table_of_rows(
    rows: Iterable[Row],
    places: Mapping[SourceColumn, int],
    names: Sequence[str] | None,
    request: TableRequest,
    label: str,
) -> RawTable:
    """Return the columns at these 0-based `places` of the rows; a cell that is empty, or that a row
    is too short for, is NaN.

    `names` are the titles of all columns, None where there are none. Raises NotANumber, with row
    and column, for a cell that is no number.
    """
    numbers: list[int] = []
    values: list[float] = []
    wanted = [(column, place, request.cells(column)) for column, place in places.items()]
    for number, row in rows:
        numbers.append(number)
        for column, place, read in wanted:
            try:
                values.append(read(row[place] if place < len(row) else ""))
            except NotANumber as odd:
                title = column if names is None else names[place]
                raise odd.at(f"{label}:row {number}, column {title}") from None
    columns = np.array(values).reshape(len(numbers), len(wanted)).T
    return RawTable(
        dict(zip(places, columns, strict=True)), np.array(numbers, dtype=np.int64), label
    )
