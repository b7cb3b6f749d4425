"""A row of docs/limits.md that shipped data give; `docs/limits_tables.py` makes all of them."""

import limits_tables
import pytest
from page_tables import DOCS, rows_of


def test_the_slope_jumps_where_a_held_curve_ends(tmp_path):
    name, way, *values = limits_tables.row("m1/peano-m1-static", "saturate", tmp_path)
    shown = {(row[0], row[1]): row[2:] for row in rows_of("ends", DOCS / "limits.md")}
    assert [*map(float, shown[name, way])] == pytest.approx(values, rel=0.02)
