"""What every reader is asked for and what it returns."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.errors import DataError

SourceColumn = str | int
"""A column of a file, by the name in its header or by 0-based index."""


@dataclass(frozen=True)
class TableRequest:
    """Which columns of a file are wanted; `label` is how messages name the file."""

    label: str
    columns: tuple[SourceColumn, ...]
    header: bool


@dataclass(frozen=True)
class RawTable:
    """Columns as the file holds them, before scaling and units.

    `columns` has one `(n,)` array for each column of the request, NaN where a cell is empty; `rows` is `(n,)`, where each sample
    stands in the file (line of a text file, row of a sheet, both from 1), for messages.
    """

    columns: Mapping[SourceColumn, Array]
    rows: IntArray


def locate_columns(request: TableRequest, names: Sequence[str] | None, width: int, hint: str | None = None) -> dict[SourceColumn, int]:
    """Return the 0-based index of every wanted column in a file of `width` columns.

    `names` are those of the header, None where there is none; `hint` replaces the usual remedy where the reader knows better.
    Raises DataError for a column that does not exist, or whose name stands twice in the header.
    """
    return {column: _locate(column, request.label, names, width, hint) for column in request.columns}


def _locate(column: SourceColumn, label: str, names: Sequence[str] | None, width: int, hint: str | None) -> int:
    if isinstance(column, int):
        if 0 <= column < width:
            return column
        raise DataError(f"{label}: there is no column {column}", hint or f"The file has {width} columns, numbered from 0 to {width - 1}.")
    if names is None:
        raise DataError(
            f"{label}: column '{column}' is asked for by name, but the spec says that the file has no header",
            f"Give its index (0 to {width - 1}), or set `header: true`.",
        )
    if names.count(column) == 1:
        return names.index(column)
    if column in names:
        raise DataError(f"{label}: column '{column}' stands {names.count(column)} times in the header", "Give its 0-based index instead.")
    near = difflib.get_close_matches(column, names, n=1) or [name for name in names if name.lower() == column.lower()]
    guess = f"Did you mean '{near[0]}'? " if near else ""
    raise DataError(f"{label}: there is no column '{column}'", hint or f"{guess}The header has: {', '.join(names)}.")
