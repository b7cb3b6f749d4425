"""The table of docs/search.md: its note follows from its rows; `docs/search_tables.py` makes them."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
from pages import read_rows

from mapmore_cli.spec.loader import load

PAGE = Path(__file__).parents[2] / "docs" / "search.md"


def test_the_note_of_the_table_follows_from_its_rows() -> None:
    table = PAGE.read_text(encoding="utf-8").partition("<!-- table search 0 -->")[2].partition("<!-- end -->")[0]
    headings, *lines = read_rows(PAGE, "search")
    rows = [dict(zip(headings, line, strict=True)) for line in lines]
    found, box = ([float(row[f"{name} [%]"]) for row in rows] for name in ("found", "best black box"))
    beside = [row for row in rows if row["shipped [%]"] != "–"]
    ratios = [float(row["found [%]"]) / float(row["shipped [%]"]) for row in beside]
    assert [float(row["found / shipped"]) for row in beside] == pytest.approx(ratios, abs=0.01)
    mean = math.exp(math.fsum(map(math.log, ratios)) / len(beside))
    told = float(table.partition("found / shipped: ")[2].partition(". Below")[0])
    assert told == pytest.approx(mean, abs=0.01)
    below = sum(one < other for one, other in zip(found, box, strict=True))
    assert f"Below the best black box in {below} of {len(rows)}." in table
    names = ("found [%]", "shipped [%]", "best black box [%]", "best formula [%]")
    best = [min(float(row[name]) for name in names if row[name] != "–") for row in rows]
    far = [bool(row["told on its page"]) for row in rows]
    assert far == [one > 1.5 * least for one, least in zip(found, best, strict=True)]
    assert f"times the best of all: {sum(far)}, of which" in table


def test_the_note_of_other_splits_follows_from_its_rows() -> None:
    table = PAGE.read_text(encoding="utf-8").partition("<!-- table others 0 -->")[2].partition("<!-- end -->")[0]
    headings, *lines = read_rows(PAGE, "others")
    found, box = ([float(dict(zip(headings, line, strict=True))[f"{name} [%]"]) for line in lines] for name in ("found", "best black box"))
    ratios = [one / other for one, other in zip(found, box, strict=True)]
    mean = math.exp(math.fsum(map(math.log, ratios)) / len(ratios))
    assert f"Below the best black box in {sum(ratio < 1 for ratio in ratios)} of {len(lines)}; " in table
    told = re.search(r"found / best black box: ([\d.]+) in the geometric mean, at most ([\d.]+)\.", table)
    assert told
    assert [float(text) for text in told.groups()] == pytest.approx([mean, max(ratios)], abs=0.015)


@pytest.mark.parametrize("path", sorted((PAGE.parent / "search").glob("*.yaml")), ids=lambda path: path.stem)
def test_a_minimal_spec_of_the_page_says_nothing_of_a_structure(path: Path) -> None:
    spec = load(path).spec
    assert spec.model.type == "auto"
    assert spec.name == path.stem
    assert not spec.dictionary
