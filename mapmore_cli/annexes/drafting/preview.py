"""Find the layout of a file from its first lines, before the meaning of its columns is known."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path

from mapmore_cli.annexes.drafting.first_lines import LINES, comment_among, refuse_serial, unread
from mapmore_cli.annexes.drafting.found_table import FoundTable, table_in
from mapmore_cli.annexes.drafting.layout import FileLayout
from mapmore_cli.annexes.drafting.rows import nonempty
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.readers import reader_of, suffix_of
from mapmore_cli.storage.tables import Reader, TableRequest, Top
from mapmore_cli.storage.tables.below import Below
from mapmore_cli.storage.tables.cells import CellReader, NotANumber

WIDEST = 2000  # largest number of columns that `init` reads


def preview(path: Path) -> FileLayout:
    """Return the layout of a file from its beginning. Raises DataError if it holds no table of
    numbers with at least two columns that `init` can read.
    """
    reader = reader_of(path)
    if reader is None:
        problem = f"{path.name}: no reader takes {suffix_of(path) or 'files without a suffix'}"
        raise DataError(unread(path) or f"{problem}; save the table as CSV")
    if path.stat().st_size == 0:
        raise DataError(f"{path.name}: is empty", "get it again, or leave it out")
    column = f"{{column: {reader.column}, unit: kPa}}"
    remedy = f"write `columns` by hand, for example `pressure: {column}`"
    if reader.peek is None:
        raise DataError(f"{path.name}: `init` cannot see which arrays in it are columns", remedy)
    try:
        tops = list(reader.peek(path, LINES))
    except DataError as fault:  # the error of the reader says how to save the file in another form
        raise DataError(": ".join(filter(None, [fault.message, fault.remedy]))) from fault
    if (width := max((len(row) for top in tops for row in top.rows), default=0)) > WIDEST:
        raise DataError(
            f"{path.name}: has {width} columns, more than {WIDEST}, too many for `init`",
            remedy,
        )
    refuse_serial(path, tops)
    tables = [table for top in tops if (table := table_in(top)) is not None]
    if not tables:
        lines = f" in its first {len(tops[0].rows)} lines" if tops and tops[0].rows else ""
        raise DataError(
            f"{path.name}: no table of numbers was found{lines}{_why_no_numbers(tops)}",
            f"save the table as CSV, or {remedy}",
        )
    best = max(tables, key=lambda table: table.rank)
    layout = best.layout(reader.name)
    if best.top.sheet is not None:
        layouts = {table.top.sheet: table.layout(reader.name) for table in tables}
        layout = _of_all_sheets(best.top.sheet, layouts, [top.sheet for top in tops])
    is_single = layout.alike or layout.is_map
    return layout if is_single else _with_tables_below(path, best, layout, reader)


def _why_no_numbers(tops: Sequence[Top]) -> str:
    """Return the reason why a cell in the middle of the first lines is no number, for a message;
    empty if all of these cells are numbers or words.
    """
    for top in (top for top in tops if top.rows):
        row = top.rows[len(top.rows) // 2]
        for cell in row if len(row) > 1 else ():
            try:
                CellReader(clock=True)(cell)
            except NotANumber as fault:
                if fault.known:
                    return f", because {fault.message}; {fault.remedy}"
    return ""


def _with_tables_below(
    path: Path, best: FoundTable, layout: FileLayout, reader: Reader
) -> FileLayout:
    """Return the layout, extended if the file or sheet has several tables. Tables with the same
    header are read together; the header with the most rows is used, and tables with other headers
    are left out.
    """
    if reader.below is None:
        return layout
    settings = {**layout.settings, "header": int(layout.settings.get("header", True))}
    settings.pop("skip_rows", None)
    known = {field.name for field in fields(TableRequest)} & {*settings}
    request = TableRequest(path.name, (), **{key: settings[key] for key in known})
    tables = reader.below(path, request)
    if len(tables) < 2:
        return layout
    headers = [tuple(_titles_of(table)) for table in tables]
    mark = comment_among(path, layout) if layout.titles else None
    comments = [titles for titles in headers if mark is not None and titles[0].startswith(mark)]
    if mark is not None and all(titles in comments for titles in headers[1:]):
        return layout  # the file has a single table, with comments between its rows
    # a line with a mark and several cells may hold the titles of another table
    if any(len(titles) > 1 for titles in comments):
        mark = None
    if mark is not None:
        tables = reader.below(path, replace(request, comment=mark))
        headers = [tuple(_titles_of(table)) for table in tables]
    rows = Counter[tuple[str, ...]]()
    for header, table in zip(headers, tables, strict=True):
        rows[header] += len(table.rows)
    wanted = rows.most_common(1)[0][0]
    numbered = zip(enumerate(tables, start=1), headers, strict=True)
    # a table to the right of another may have titles, but no rows; it is left out
    alike = [(at, table) for (at, table), titles in numbered if titles == wanted and table.rows]
    first = alike[0][1]
    cells = [row for _, row in (*first.header, *first.rows[:LINES])]
    best_table = table_in(replace(best.top, rows=cells))
    if best_table is None:
        return layout
    left = (f"table {at} ({', '.join(x)})" for at, x in enumerate(headers, start=1) if x != wanted)
    whole = best_table.layout(reader.name)
    whole.settings.pop("skip_rows", None)
    if mark is not None:
        whole.settings["comment"] = mark
    return replace(
        whole,
        tables=tuple(at for at, _ in alike),
        above=tuple(table.title for _, table in alike),
        left=(*layout.left, *left),
        alike=layout.alike,
    )


def _titles_of(table: Below) -> list[str]:
    """Return the titles of a table: the filled cells of its header, or its number of columns if
    there is no header.
    """
    if not table.header:
        return [f"{len(table.rows[0][1])} columns"]
    return [str(cell).strip() for cell in nonempty(table.header[0][1])]


def _of_all_sheets(
    best: str, layouts: Mapping[str | None, FileLayout], sheets: Sequence[str | None]
) -> FileLayout:
    """Return the layout of the sheet `best`, with the names of all sheets that have this layout."""
    shapes = {
        sheet: replace(layout, settings={**layout.settings, "sheet": ""})
        for sheet, layout in layouts.items()
    }
    alike = tuple(str(sheet) for sheet, shape in shapes.items() if shape == shapes[best])
    left = tuple(str(sheet) for sheet in sheets if sheet not in alike)
    layout = replace(layouts[best], left=left)
    if len(alike) == 1:
        return layout
    settings = {**layout.settings, "sheet": alike[0] if left else "*"}
    return replace(layout, settings=settings, alike=alike)
