"""The tables of docs/measured-static.md and docs/memory.md, as texts by row and column."""

from __future__ import annotations

import re
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"
PAGE, MEMORY = DOCS / "measured-static.md", DOCS / "memory.md"


def page_table(name: str, page: Path = PAGE) -> dict[str, dict[str, str]]:
    """The table called `name`: its rows by their first cell, each by heading (a unit and a repeated heading left out)."""
    block = re.search(rf"<!-- table {re.escape(name)} -->\n(.*?)<!-- end -->", page.read_text(encoding="utf-8"), re.DOTALL)
    assert block, name
    header, _rule, *rows = (_cells(line) for line in block[1].splitlines() if line.startswith("|"))
    keys = [re.sub(r" \[.*\]$", "", heading) for heading in header[1:]]
    return {first: dict(reversed(list(zip(keys, cells, strict=True)))) for first, *cells in rows}


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip("|").split("|")]


def numbers(row: dict[str, str]) -> dict[str, float]:
    """The cells that are numbers."""
    return {key: float(text) for key, text in row.items() if re.fullmatch(r"-?[\d.]+(e[+-]?\d+)?", text)}
