"""docs/families.md: its tables are those of the command, and its sentences follow from them."""

from __future__ import annotations

from pathlib import Path

import family_tables
import pytest
from page_tables import DOCS, numbers, page_table

PAGE = DOCS / "families.md"


def test_the_sentences_follow_from_the_tables() -> None:
    mean = numbers(page_table("lengths", PAGE)["geometric mean"])
    assert mean["family"] < mean["pooled sarosi_hinged"] < mean["pooled sarosi"]
    assert 3.5 < mean["family"] / mean["own fit of sarosi_hinged"] < 4.5
    rows = {name: numbers(row) for name, row in page_table("adapt", PAGE).items()}
    apart, near = rows["rest and third"], rows["rest and second"]
    assert 0.9 < apart["adapted"] / apart["family as it is"] < 1.0
    assert near["adapted"] > near["family as it is"]
    assert all(
        row["adapted"] < row["fit to these levels alone"]
        for row in rows.values()
        if row["count"] == 2
    )


def test_the_numbers_of_the_sentences_are_those_of_the_table() -> None:
    rows = page_table("adapt", PAGE)
    text = PAGE.read_text(encoding="utf-8")
    for name in ("rest and third", "rest and second"):
        assert f"({rows[name]['family as it is']} to {rows[name]['adapted']} %)" in text
    alone = [
        rows[name]["fit to these levels alone"] for name in ("rest and third", "rest and second")
    ]
    assert "alone ({} and {} %)".format(*alone) in text


@pytest.mark.long
@pytest.mark.parametrize("name", ["lengths", "adapt"])
def test_a_table_made_anew(
    name: str, tmp_path_factory: pytest.TempPathFactory, measured_data: Path
) -> None:
    table = family_tables.TABLES[name](tmp_path_factory.getbasetemp() / "family-runs")
    shown = page_table(name, PAGE)
    for first, *cells in table.rows:
        key = f"{first:.0f}" if isinstance(first, float) else first
        found = {
            column.name: cell
            for column, cell in zip(table.columns[1:], cells, strict=True)
            if cell is not None
        }
        assert numbers(shown[key]) == pytest.approx(found, rel=0.02)
