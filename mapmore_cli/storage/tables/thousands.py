"""Detect numbers in which the point separates thousands, although it is read as a decimal point:
for example, 1.050 means 1050 in a column that also contains 950.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.storage.tables.cells import MISSING, NotANumber, number_of

TINY = 0.1
"""Numbers with decimals are suspicious if they are below this fraction of the largest
whole number.
"""

ENOUGH = 100
"""If more than this many numbers such as 23.000 come before the first whole number without
decimals, the program that wrote the file keeps zeros at the end, and the point is a decimal point.
"""

BLOCK = 10_000
"""Number of values of a column that are checked at a time."""


def may_be_grouped(values: Array) -> bool:
    """Return True if the points in the numbers of a column may separate thousands. `values`, (n,),
    are the numbers as they were read, with the point as decimal point. Three conditions must be
    fulfilled: all numbers are below 1000; some are whole numbers; and all others are above 1 and
    have at most three decimals.
    """
    whole = others = 0
    for begin in range(0, len(values), BLOCK):
        size = np.abs(values[begin : begin + BLOCK])
        size = size[np.isfinite(size)]
        decimals = size[size != np.floor(size)]
        thousandths = 1000 * decimals
        if not (
            (size < 1000).all()
            and (decimals > 1).all()
            and (np.abs(thousandths - np.rint(thousandths)) < 1e-6).all()
        ):
            return False
        whole, others = whole + len(size) - len(decimals), others + len(decimals)
    return bool(whole and others)


def refuse_grouped(cells: Iterable[tuple[int, object]], decimal: str, column: str) -> None:
    """Raise NotANumber if the decimal point in a column seems to separate thousands. This is
    possible if the column consists of whole numbers up to 999 and of numbers with exactly three
    decimals, such as 1.050.

    The reason is that a program writes decimal numbers in one of two ways. If it drops zeros at the
    end, it writes 1.05 and not 1.050. If it keeps them, it also writes whole numbers with three
    decimals, such as 950.000. So if a number such as 1.050 ends with a zero, the point separates
    thousands. If no number ends with a zero, the error is raised only if the numbers with decimals
    would be very small compared with the whole numbers.

    `cells` yields each row number with the cell. `column` describes the column for the message;
    `{row}` in it is replaced by the row number.
    """
    grouped = re.compile(rf"[+-]?[1-9]\d{{0,2}}{re.escape(decimal)}\d{{3}}")
    first, zeros, largest, most = (0, ""), Counter[bool](), 0.0, 0.0
    for row, cell in cells:
        cell = cell.decode("utf-8", "replace") if isinstance(cell, bytes) else cell
        text = f"{cell:.17g}" if isinstance(cell, float) else str(cell).strip()
        if not text or text.lower() in MISSING:
            continue
        number = abs(number_of(cell, decimal) or 0.0)
        if re.fullmatch(r"[+-]?\d{1,3}", text):
            largest = max(largest, number)
        elif isinstance(cell, str) and grouped.fullmatch(text):
            first = first if first[1] else (row, text)
            most = max(most, number)
            zeros[text.endswith("000")] += text.endswith("0")
            if not largest and zeros[True] > ENOUGH:
                return
        else:
            return
    row, text = first
    if not text or not largest or not (zeros.total() or most < TINY * largest):
        return
    other = "," if decimal == "." else "."
    raise NotANumber(
        text,
        f"may be {text.replace(decimal, '')}: the column has whole numbers up to {largest:g}, and "
        "all its other numbers have exactly three decimals",
        f'if the mark separates thousands, write `thousands: "{decimal}"` at the column, or, if it '
        f'does so in all columns, `decimal: "{other}"` and `thousands: "{decimal}"` in `data`; if '
        'it is the decimal point, write `thousands: "\'"`, a mark that no cell contains',
    ).at(column.format(row=row))
