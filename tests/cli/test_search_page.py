"""The table of docs/search.md: its note follows from its rows; `docs/search_tables.py` makes them."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "search.md"


def test_the_note_of_the_table_follows_from_its_rows() -> None:
    table = PAGE.read_text(encoding="utf-8").partition("<!-- table search -->")[2].partition("<!-- end -->")[0]
    lines = [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in table.splitlines() if line.startswith("|")]
    rows = [dict(zip(lines[0], line, strict=True)) for line in lines[2:]]
    found, shipped, box = ([float(row[f"{name} [%]"]) for row in rows] for name in ("found", "shipped", "best black box"))
    ratios = [one / other for one, other in zip(found, shipped, strict=True)]
    assert [float(row["found / shipped"]) for row in rows] == pytest.approx(ratios, abs=0.01)
    mean = math.exp(math.fsum(map(math.log, ratios)) / len(rows))
    told = float(table.partition("found / shipped: ")[2].partition(". Below")[0])
    assert told == pytest.approx(mean, abs=0.01)
    below = sum(one < other for one, other in zip(found, box, strict=True))
    assert f"Below the best black box in {below} of {len(rows)}." in table
