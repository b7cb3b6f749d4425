"""Represent facts about the cells of a workbook, for example errors and hidden rows. The values of
the cells are read elsewhere.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

Fact = tuple[int, int, int, int, str]
"""A fact about a range of cells: its first row and column, its last row and column (0-based), and
the fact itself. The fact is the text of an error, `NEVER_COMPUTED`, `PERCENT`, `HIDDEN`, or an
empty text for merged cells.
"""

NEVER_COMPUTED = "="

PERCENT = "%"
"""The number is shown in per cent: 0.2 as 20 %."""

HIDDEN = "hidden"
"""Rows (all columns) or columns (all rows) that are not shown."""

MOST = 1 << 20
"""Largest number of rows and columns of a sheet."""


def hidden_rows(first: int, last: int) -> Fact:
    """Return the fact that the rows from `first` to `last` (0-based) are hidden."""
    return first, 0, last, MOST, HIDDEN


def hidden_columns(first: int, last: int) -> Fact:
    """Return the fact that the columns from `first` to `last` (0-based) are hidden."""
    return 0, first, MOST, last, HIDDEN


def is_percent(layout: str) -> bool:
    """Return True if a number format shows numbers in per cent: it contains a % sign that is not
    inside quoted text.
    """
    return "%" in re.sub(r'"[^"]*"|\\.|\[[^\]]*\]', "", layout)


PERCENT_BUILT_IN = frozenset({9, 10})
"""Numbers of the built-in formats `0%` and `0.00%`, which workbooks do not write out."""

ERRORS = {
    0x00: "#NULL!",
    0x07: "#DIV/0!",
    0x0F: "#VALUE!",
    0x17: "#REF!",
    0x1D: "#NAME?",
    0x24: "#NUM!",
    0x2A: "#N/A",
}
"""Texts of errors by their numbers in binary workbooks."""


def never_computed(empty: Iterable[tuple[int, int]], computed: bool) -> Iterator[Fact]:
    """Yield the formulas of a sheet that were never computed. `empty` holds the row and column of
    each formula whose stored value is an empty text, and `computed` is True if another formula of
    the sheet has a value.

    A program computes either all formulas of a sheet or none. Therefore, if `computed` is True, the
    empty texts are the values of their formulas, and nothing is yielded.
    """
    if not computed:
        yield from ((row, column, row, column, NEVER_COMPUTED) for row, column in empty)


def letters(column: int) -> str:
    """Return the letters of a column in a workbook: B for 1, AA for 26."""
    return (letters(column // 26 - 1) if column > 25 else "") + chr(ord("A") + column % 26)


def number_of_letters(name: str) -> int:
    """Return the 0-based index of the column with these letters."""
    number = 0
    for letter in name:
        number = number * 26 + ord(letter) - ord("A") + 1
    return number - 1
