"""The process that reads a workbook for `readers/xlsx.py`, run as `workbooks.py PATH ROWS BYTES`.

It writes a list of sheets as JSON to its output: title, whether it is visible, the first ROWS rows
of cells (all where 0; a date or a time is `{"stamp": TEXT}`), and the merged cells as [[top, left],
[bottom, right]], from 0.

A damaged workbook can end the machine code that reads it, or ask for all memory. Then it ends this
process, which may have so many BYTES, and not the program.
"""

from __future__ import annotations

import json
import sys
from contextlib import suppress
from datetime import date, datetime, time
from pathlib import Path
from typing import Any

Range = tuple[tuple[int, int], tuple[int, int]]


def sheets_of(path: str, most: int) -> list[tuple[str, bool, list[list[Any]], list[Range]]]:
    """Return what is in the sheets of a workbook, whose content tells its kind."""
    from python_calamine import SheetTypeEnum, SheetVisibleEnum, load_workbook

    with Path(path).open("rb") as file:
        book = load_workbook(file)
        sheets = []
        for one in book.sheets_metadata:
            if one.typ == SheetTypeEnum.WorkSheet:
                sheet = book.get_sheet_by_name(one.name)
                rows = sheet.to_python(skip_empty_area=False, nrows=most or None)
                cells = [[_plain(cell) for cell in row] for row in rows]
                visible = one.visible == SheetVisibleEnum.Visible
                sheets.append((one.name, visible, cells, sheet.merged_cell_ranges or []))
        return sheets


def _plain(cell: Any) -> Any:
    """Return a date as midnight of that day, and whole numbers as such: `2026`, not `2026.0`."""
    if isinstance(cell, date) and not isinstance(cell, datetime):
        return datetime.combine(cell, time())
    return int(cell) if isinstance(cell, float) and cell.is_integer() else cell


if __name__ == "__main__":
    with suppress(ImportError, ValueError):  # not under Windows; there may be a lower limit
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[3]),) * 2)
    try:
        sheets = sheets_of(sys.argv[1], int(sys.argv[2]))
        json.dump(sheets, sys.stdout, default=lambda cell: {"stamp": str(cell)})
    except BaseException as fault:  # machine code that gives up raises no Exception
        sys.exit(str(fault) or type(fault).__name__)
