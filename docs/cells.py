"""Read the tables of pages, and write the numbers that sentences quote from them: `python
docs/cells.py`.

A table of a page stands between `<!-- table NAME -->` and `<!-- end -->`, or in
`tables/PAGE/NAME.csv` (pages.py). A sentence quotes a cell with a mark that a reader does not see:

    errs by <!-- cell pgm; cubic; mean -->6.88<!-- / --> %

The command writes what stands between the two comments; a person writes the comments alone. A mark
never begins a line, because Markdown would end the paragraph there.

    cell TABLE; ROW; COLUMN       the text of a cell
    least TABLE; COLUMN           the least number of a column
    greatest TABLE; COLUMN        the greatest number of a column
    mean TABLE; COLUMN            the mean of a column, and `sum` its sum
    count TABLE; COLUMN; CELL     how many rows have this text in a column
    excess TABLE; ROW; COLUMN     by how many per cent a ratio is above one; `less`: below one

A format may follow, as `; .1f`, or `; ,.0f` with spaces between thousands; without it the text of
the table is copied. COLUMN is a heading without its unit. Where first cells repeat, ROW has as many
of the first cells as tell the rows apart, with a comma between them. A table of another page is
written `PAGE/TABLE`. Semicolons stand between the words because `|` would end a cell of Markdown.
"""

from __future__ import annotations

import csv
import re
import sys
from math import fsum
from pathlib import Path
from statistics import fmean

DOCS = Path(__file__).parent
README = DOCS.parent / "README.md"
BLOCK = re.compile(r"(<!-- table (\S+?)(?: (\d+))? -->)\n(.*?)(<!-- end -->)", re.DOTALL)
MARK = re.compile(
    r"(<!--\s+(cell|least|greatest|mean|sum|count|excess|less)\s+([^>]*?)\s+-->)(.*?)(<!-- / -->)",
    re.DOTALL,
)


def read_rows(page: Path, name: str) -> list[list[str]]:
    """Return headings and rows of a table, from its file or from the page.

    Raises:
        LookupError: the page has no such table.

    """
    path = DOCS / "tables" / page.stem / f"{name}.csv"
    if path.exists():
        with path.open(encoding="utf-8", newline="") as file:
            return list(csv.reader(file))
    for block in BLOCK.finditer(page.read_text(encoding="utf-8")):
        if block[2] == name:
            lines = [
                [cell.strip() for cell in line.strip("|").split("|")]
                for line in block[4].splitlines()
                if line.startswith("|")
            ]
            return [lines[0], *lines[2:]]
    raise LookupError(f"{page.name} has no table {name}")


def without_unit(heading: str) -> str:
    """Return a heading without its unit in brackets."""
    return re.sub(r" \[.*\]$", "", heading)


def cell_of(rows: list[list[str]], row: str, column: str) -> str:
    """Return the text of a cell.

    Raises:
        LookupError: the row or the column is missing, or several have the name.

    """
    headings, *body = rows
    lines = [cells for cells in body if row in _names(cells)]
    if len(lines) != 1:
        raise LookupError(f"{len(lines)} rows are called {row!r}")
    return lines[0][_place(headings, column)]


def _place(headings: list[str], column: str) -> int:
    """Return where the one column with a heading stands."""
    places = [i for i, heading in enumerate(headings) if column in (heading, without_unit(heading))]
    if len(places) != 1:
        raise LookupError(f"{len(places)} columns are called {column!r}")
    return places[0]


def _names(cells: list[str]) -> list[str]:
    """Return what a row may be called: its first cell, its first two, and so on."""
    return [", ".join(cells[:count]) for count in range(1, len(cells) + 1)]


def column_of(rows: list[list[str]], column: str) -> list[str]:
    """Return the cells of a column that are numbers."""
    headings, *body = rows
    place = _place(headings, column)
    return [cells[place] for cells in body if is_number(cells[place])]


def is_number(text: str) -> bool:
    """Say whether a cell is a number."""
    return re.fullmatch(r"-?[\d.]+(e[+-]?\d+)?", text) is not None


def quoted(kind: str, words: str, page: Path) -> str:
    """Return what a mark of a page has to show.

    Args:
        kind: `cell`, `least`, `greatest`, `mean`, `sum`, `count`, `excess` or `less`.
        words: table, row where there is one, column, and format, with semicolons between them.
        page: the page, whose tables are meant unless the words name another.

    Raises:
        LookupError: table, row or column are missing or ambiguous.

    """
    table, *rest = (" ".join(part.split()) for part in words.split(";"))
    other, _, name = table.rpartition("/")
    rows = read_rows(DOCS / f"{other}.md" if other else page, name)
    if kind in ("cell", "excess", "less"):
        row, column, *form = rest
        text = cell_of(rows, row, column)
        if kind != "cell":
            text = str((100 if kind == "excess" else -100) * (float(text) - 1))
    elif kind == "count":
        column, cell, *form = rest
        headings, *body = rows
        text = str(sum(cells[_place(headings, column)] == cell for cells in body))
    else:
        column, *form = rest
        cells = sorted(column_of(rows, column), key=float)
        text = {
            "least": cells[0],
            "greatest": cells[-1],
            "mean": f"{fmean(map(float, cells)):.17g}",
            "sum": f"{fsum(map(float, cells)):.17g}",
        }[kind]
    return format(float(text), form[0]).replace(",", " ") if form else text


def with_cells(text: str, page: Path) -> str:
    """Return the text of a page in which every mark shows its cell.

    Raises:
        LookupError: a mark names no cell; the message begins with the page and the mark.

    """

    def filled(mark: re.Match[str]) -> str:
        try:
            return f"{mark[1]}{quoted(mark[2], mark[3], page)}{mark[5]}"
        except (LookupError, ValueError) as error:
            raise LookupError(f"{page.name}: {mark[1]}: {error}") from error

    return MARK.sub(filled, text)


def write_cells(page: Path) -> None:
    """Write the numbers that the sentences of a page quote."""
    text = page.read_text(encoding="utf-8")
    if (changed := with_cells(text, page)) != text:
        page.write_text(changed, encoding="utf-8")


def pages() -> list[Path]:
    """Return README and the pages of the documentation."""
    return [README, *sorted(DOCS.glob("*.md"))]


if __name__ == "__main__":
    for path in map(Path, sys.argv[1:]) if sys.argv[1:] else pages():
        write_cells(path)
