"""What a workbook says of its cells besides their values."""

from __future__ import annotations

Fact = tuple[int, int, int, int, str]
"""Cells from the first row and column to the last ones, from 0, and what is said of them: the text
of an error, `NEVER_COMPUTED`, or nothing where they are merged.
"""

NEVER_COMPUTED = "="


def letters(column: int) -> str:
    """Return the letters by which a workbook names a column: B of 1, AA of 26."""
    return (letters(column // 26 - 1) if column > 25 else "") + chr(ord("A") + column % 26)


def number_of_letters(name: str) -> int:
    """Return the column that letters name, from 0."""
    number = 0
    for letter in name:
        number = number * 26 + ord(letter) - ord("A") + 1
    return number - 1
