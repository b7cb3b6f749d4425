"""Recognise empty cells and units in the rows of a table."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.study.units import check_unit

LETTERS = "smNVAKgh1%°-"  # single characters that are common units

Row = Sequence[Any]


def filled_by_column(rows: Sequence[Row], wide: int) -> list[list[Any]]:
    """Return the filled cells of each column. Only the rows that have `wide` cells are used."""
    return [*map(nonempty, zip(*(row for row in rows if len(row) == wide), strict=True))]


def are_units(cells: Sequence[str]) -> bool:
    """Return True if more than half of the filled cells are units."""
    filled = nonempty(cells)
    return 2 * sum(map(_reads_as_unit, filled)) > len(filled)


def _reads_as_unit(cell: str) -> bool:
    """Return True if a cell is a unit. A single letter may also be the title of a column, so it is
    treated as a unit only if it is one of the common units in `LETTERS`.
    """
    unit = without_brackets(cell)
    if len(unit) == 1:
        return unit in LETTERS
    with suppress(SpecError):
        check_unit(unit)
        return True
    return False


def without_brackets(unit: str) -> str:
    """Return a unit without brackets, and without a sign such as `#` that marks its line as a
    remark.
    """
    return re.sub(r"^[(\[{<]\s*(.*?)\s*[)\]}>]$", r"\1", unit.lstrip("# "))


def nonempty(row: Row) -> list[Any]:
    """Return the cells of a row that are not empty."""
    return [cell for cell in row if cell is not None and str(cell).strip()]
