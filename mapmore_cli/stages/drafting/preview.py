"""The first lines of a file: how it is laid out, before anything is known of what it holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.readers import reader_of, suffix_of
from mapmore_cli.storage.tables.reader import Top

LINES = 200
MOST_HEADER_LINES = 9

Row = Sequence[Any]


@dataclass(frozen=True)
class Preview:
    """How a file is read: by which `reader` with which `settings` of `data`, and the `titles` of its columns where it has a header.

    `below` are the texts under the titles, as units, where the header has more lines. `left` counts the sheets of
    a workbook that are laid out in another way.
    """

    reader: str
    width: int
    titles: tuple[str, ...] | None
    settings: dict[str, Any] = field(default_factory=dict)
    below: tuple[str, ...] = ()
    left: int = 0

    @property
    def columns(self) -> tuple[str | int, ...]:
        """How the spec names the columns: by their titles where each has one of its own, else by their indices."""
        named = self.titles is not None and all(self.titles) and len(set(self.titles)) == self.width
        return self.titles if named and self.titles is not None else tuple(range(self.width))


def preview(path: Path) -> Preview:
    """Look at the beginning of a file; DataError where it holds no table of numbers that `init` can lay out."""
    reader = reader_of(path)
    if reader is None:
        raise DataError(f"{path.name}: no reader takes {suffix_of(path) or 'files without a suffix'}", "save the table as CSV")
    if reader.peek is None:
        remedy = f"write `columns` by hand, as `pressure: {{column: {reader.column}, unit: kPa}}`"
        raise DataError(f"{path.name}: its arrays have to be named", remedy)
    tops = list(reader.peek(path, LINES))
    layouts = [layout for layout in (_layout(top, reader.name) for top in tops) if layout is not None]
    if not layouts:
        raise DataError(f"{path.name}: no table of numbers was found in its first {len(tops[0].rows)} lines", "save the table as CSV")
    found = max(layouts, key=lambda layout: layout[0])[1]
    return _of_all_sheets(found, [layout for _, layout in layouts], len(tops)) if reader.name == "xlsx" else found


def _of_all_sheets(found: Preview, layouts: Sequence[Preview], sheets: int) -> Preview:
    """The layout of every sheet where all of them are alike, else that of the one with the most rows."""

    def shape(layout: Preview) -> tuple[Any, ...]:
        return layout.titles, layout.width, {key: value for key, value in layout.settings.items() if key != "sheet"}

    alike = [layout for layout in layouts if shape(layout) == shape(found)]
    if len(alike) == sheets > 1:
        return replace(found, settings={**found.settings, "sheet": "*"})
    return replace(found, left=sheets - 1)


def _layout(first_rows: Top, reader: str) -> tuple[int, Preview] | None:
    """The table that the last rows belong to, with the number of rows that do; None where they are no numbers in two columns or more.

    Cells may be empty. Rows right before it with as many cells are the header, what stands before these is skipped. The very last row may
    be cut off.
    """
    rows, is_number = first_rows.rows, first_rows.is_number
    whole = rows[:-1] if len(rows) > 1 else rows
    width = len(whole[-1]) if whole else 0
    blank = [not any(_filled(row)) for row in whole]
    data = [is_blank or (len(row) == width and all(map(is_number, _filled(row)))) for row, is_blank in zip(whole, blank, strict=True)]
    first = next((i for i in range(len(whole), 0, -1) if not data[i - 1]), 0)
    while first < len(whole) and blank[first]:
        first += 1
    top = next((i for i in range(first, 0, -1) if blank[i - 1] or len(whole[i - 1]) != width), 0)
    header = first - top
    if width < 2 or first == len(whole) or header > MOST_HEADER_LINES:
        return None
    titles = tuple("" if cell is None else str(cell).strip().strip('"') for cell in whole[top]) if header else None
    below = tuple(" ".join(str(row[place]) for row in whole[top + 1 : first] if row[place] is not None) for place in range(width))
    shape = {**({} if header == 1 else {"header": header or False}), **({"skip_rows": top} if top else {})}
    return len(whole) - first, Preview(reader, width, titles, {**first_rows.settings, **shape}, below if header > 1 else ())


def _filled(row: Row) -> list[Any]:
    return [cell for cell in row if cell is not None and str(cell).strip()]
