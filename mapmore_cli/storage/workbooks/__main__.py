"""Read a workbook. This program runs as a separate process with the arguments PATH ROWS BYTES
SECONDS.

It writes the sheets to its output as a JSON list. The entries of a sheet are: its title, whether it
is visible, its first ROWS rows of cells (0 means all rows), and the 0-based indices of hidden rows
and columns. Some cells are written in a special form:

- A date or a time is `{"stamp": TEXT}`.
- A number that is shown in per cent is `{"percent": NUMBER}`.
- A cell that shows an error instead of a number is the text of the error.
- A formula that was never computed is `{"lacks": ""}`.
- An empty cell of a merged range is `{"lacks": "B3:B5"}`.

A damaged workbook can crash the compiled code that reads it, request all memory, or take very long.
Then only this process ends, because it may use at most BYTES of memory and SECONDS of processor
time.
"""

from __future__ import annotations

import json
import sys
import zipfile
from collections.abc import Iterable
from contextlib import suppress
from datetime import date, datetime, time
from itertools import islice, product
from pathlib import Path
from typing import Any

from mapmore_cli.storage.workbooks import binary, markup, xlsb
from mapmore_cli.storage.workbooks.facts import HIDDEN, MOST, NEVER_COMPUTED, PERCENT, Fact, letters

MOST_CELLS, CELLS_OF_BYTE = 100_000, 50
"""Number of cells that a sheet may span, and further cells for each byte of the file: a cell with a
number takes at least a byte, however well it is compressed.
"""

TOO_LARGE = 3  # exit code if the sheets have too many cells


Sheet = tuple[str, bool, list[list[Any]], list[int], list[int]]


def sheets_of(path: Path, most: int) -> list[Sheet]:
    """Return the sheets of a workbook, with at most `most` rows each; 0 means all rows. The format
    of the workbook is recognised by its content.
    """
    from python_calamine import SheetTypeEnum, SheetVisibleEnum, load_workbook

    room = MOST_CELLS + CELLS_OF_BYTE * path.stat().st_size
    with path.open("rb") as file:
        book = load_workbook(file)
        sheets = []
        for entry in book.sheets_metadata:
            if entry.typ == SheetTypeEnum.WorkSheet:
                sheet = book.get_sheet_by_name(entry.name)
                height, width = (last + 1 for last in sheet.end or (-1, -1))
                if height * width > room:
                    print(f"the sheet '{entry.name}' spans {height} rows and {width} columns")
                    sys.exit(TOO_LARGE)
                rows = sheet.to_python(skip_empty_area=False, nrows=most or None)
                cells = [[_plain(cell) for cell in row] for row in rows]
                merged = [(*first, *last, "") for first, last in sheet.merged_cell_ranges or []]
                every = _facts(path, entry.name)
                facts = [fact for fact in every if fact[-1] != HIDDEN]
                # calamine leaves out rows at the end that have no value, although facts about their
                # cells are known
                end = max((top + 1 for top, *_ in facts if not most or top < most), default=0)
                if end * width <= room:
                    cells += [[""] * len(cells[0]) for _ in range(end - len(cells) if cells else 0)]
                _mark(cells, [*merged, *facts])
                is_visible = entry.visible == SheetVisibleEnum.Visible
                sheets.append((entry.name, is_visible, cells, *_hidden(every, cells)))
        return sheets


def _facts(path: Path, title: str) -> list[Fact]:
    if not zipfile.is_zipfile(path):
        return binary.facts_of(path.read_bytes(), title)
    with zipfile.ZipFile(path) as archive:
        said_by = xlsb if xlsb.BOOK in archive.namelist() else markup
        return list(said_by.facts_of(archive, title))


def _hidden(facts: Iterable[Fact], cells: list[list[Any]]) -> tuple[list[int], list[int]]:
    """Return the indices of the hidden rows and of the hidden columns among those of `cells`."""
    height, width = len(cells), len(cells[0]) if cells else 0
    rows, columns = set[int](), set[int]()
    for top, first, bottom, last, fact in facts:
        if fact == HIDDEN and bottom == MOST:
            columns |= {*range(first, min(last + 1, width))}
        elif fact == HIDDEN:
            rows |= {*range(top, min(bottom + 1, height))}
    return [*rows], [*columns]


def _mark(cells: list[list[Any]], facts: Iterable[Fact]) -> None:
    """Replace cells about which a fact is known by a mark. Facts are errors, formulas that were
    never computed, numbers that are shown in per cent, and merged cells.
    """
    width = len(cells[0]) if cells else 0
    # the number of marked cells is limited, because many overlapping ranges would take very long
    left = 4 * width * len(cells)
    for top, first, bottom, last, fact in facts:
        rows, columns = range(top, min(bottom + 1, len(cells))), range(first, min(last + 1, width))
        for row, column in islice(product(rows, columns), max(left, 0)):
            left -= 1
            if fact == NEVER_COMPUTED:
                cells[row][column] = {"lacks": ""}
            elif fact == PERCENT:
                if isinstance(cells[row][column], int | float):
                    cells[row][column] = {"percent": cells[row][column]}
            elif fact:
                cells[row][column] = fact
            elif cells[row][column] == "" and (row, column) != (top, first):
                cells[row][column] = {
                    "lacks": f"{letters(first)}{top + 1}:{letters(last)}{bottom + 1}"
                }


def _plain(cell: object) -> object:
    """Return a date as midnight of that day, and whole numbers as integers: `2026`, not
    `2026.0`.
    """
    if isinstance(cell, date) and not isinstance(cell, datetime):
        return datetime.combine(cell, time())
    return int(cell) if isinstance(cell, float) and cell.is_integer() else cell


if __name__ == "__main__":
    # limits are set only if possible: Windows has no module `resource`, and a lower limit may
    # already be set
    with suppress(ImportError, ValueError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[3]),) * 2)
        resource.setrlimit(resource.RLIMIT_CPU, (int(sys.argv[4]),) * 2)
    try:
        sheets = sheets_of(Path(sys.argv[1]), int(sys.argv[2]))
        json.dump(sheets, sys.stdout, default=lambda cell: {"stamp": str(cell)})
    except SystemExit:
        raise
    # all errors are caught, because compiled code may raise errors that are not derived from
    # Exception
    except BaseException as fault:
        sys.exit(str(fault) or type(fault).__name__)
