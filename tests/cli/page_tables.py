"""The tables of pages, as texts by row and column, and their blocks."""

import re

from cells import DOCS, is_number, read_rows, without_unit

PAGE, MEMORY = DOCS / "measured-static.md", DOCS / "memory.md"


def page_table(name, page=PAGE):
    """The table called `name`: its rows by their first cell, each by heading (a unit and a repeated
    heading left out).
    """
    header, *rows = read_rows(page, name)
    keys = [without_unit(heading) for heading in header[1:]]
    return {first: dict(reversed(list(zip(keys, cells, strict=True)))) for first, *cells in rows}


def rows_of(name, page):
    """The cells of a table whose first cells repeat, without its headings."""
    return read_rows(page, name)[1:]


def block_of(page, language="yaml"):
    """The first block of a language on a page."""
    block = re.search(rf"```{language}\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    assert block
    return block[1]


def numbers(row):
    """The cells that are numbers."""
    return {key: float(text) for key, text in row.items() if is_number(text)}
