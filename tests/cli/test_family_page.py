"""docs/families.md: its tables are those of the command, and its sentences follow from them."""

import family_tables
import pytest
from page_tables import DOCS, numbers, page_table

PAGE = DOCS / "families.md"


@pytest.mark.long
@pytest.mark.parametrize("name", ["lengths", "adapt"])
def test_a_table_made_anew(name, tmp_path_factory, measured_data):
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
