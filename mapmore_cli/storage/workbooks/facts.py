"""What a workbook says of its cells besides their values."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

Fact = tuple[int, int, int, int, str]
"""Cells from the first row and column to the last ones, from 0, and what is said of them: the text
of an error, `NEVER_COMPUTED`, `PERCENT`, `HIDDEN`, or nothing where they are merged.
"""

NEVER_COMPUTED = "="

PERCENT = "%"
"""A number that is shown in per cent: 0.2 as 20 %."""

HIDDEN = "hidden"
"""Rows that are not shown, of all columns, or columns that are not shown, of all rows."""

MOST = 1 << 20
"""Rows and columns that no sheet has more of."""


def hidden_rows(first: int, last: int) -> Fact:
    """Return that rows are hidden."""
    return first, 0, last, MOST, HIDDEN


def hidden_columns(first: int, last: int) -> Fact:
    """Return that columns are hidden."""
    return 0, first, MOST, last, HIDDEN


def is_percent(layout: str) -> bool:
    """Return whether a number format shows per cent: its mark stands outside of quoted text."""
    return "%" in re.sub(r'"[^"]*"|\\.|\[[^\]]*\]', "", layout)


PERCENT_BUILT_IN = frozenset({9, 10})
"""Numbers of the formats `0%` and `0.00%`, which no workbook writes out."""

ERRORS = {
    0x00: "#NULL!",
    0x07: "#DIV/0!",
    0x0F: "#VALUE!",
    0x17: "#REF!",
    0x1D: "#NAME?",
    0x24: "#NUM!",
    0x2A: "#N/A",
}
"""The texts of errors by their numbers in binary workbooks."""


def never_computed(empty: Iterable[tuple[int, int]], computed: bool) -> Iterator[Fact]:
    """Yield the formulas that were never computed, of those at the rows and columns where the value
    is an `empty` text.

    A formula may also give an empty text: it is taken for such a one if any other of the sheet has
    been `computed`.
    """
    if not computed:
        yield from ((row, column, row, column, NEVER_COMPUTED) for row, column in empty)


def letters(column: int) -> str:
    """Return the letters by which a workbook names a column: B of 1, AA of 26."""
    return (letters(column // 26 - 1) if column > 25 else "") + chr(ord("A") + column % 26)


def number_of_letters(name: str) -> int:
    """Return the column that letters name, from 0."""
    number = 0
    for letter in name:
        number = number * 26 + ord(letter) - ord("A") + 1
    return number - 1
