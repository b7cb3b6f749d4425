"""Numbers as people and programs write them into cells."""

from __future__ import annotations

import math

MISSING = frozenset({"na", "n/a", "#n/a", "null", "none"})
"""What programs write, besides an empty cell and `nan`, where there is no value; lower case."""


def number_of(cell: str) -> float:
    """Return the number in a cell, NaN where the value is missing; ValueError for anything else."""
    if "_" in cell:  # Python reads 1_5 as 15
        raise ValueError(cell)
    try:
        return float(cell)
    except ValueError:
        word = cell.strip().lower()
        if not word or word in MISSING:
            return math.nan
        raise


def shortened(cell: str, limit: int = 40) -> str:
    """Return a cell's text as a message may show it."""
    shown = cell.encode("unicode_escape").decode("ascii") if not cell.isprintable() else cell
    return shown if len(shown) <= limit else shown[: limit - 3] + "..."
