"""Rows of docs/limits.md; `docs/limits_tables.py` makes all of them."""

import limits_tables
import pytest
from page_tables import DOCS, rows_of


def test_the_slope_jumps_where_a_held_curve_ends(tmp_path):
    name, way, *values = limits_tables.row("m1/peano-m1-static", "saturate", tmp_path)
    shown = {(row[0], row[1]): row[2:] for row in rows_of("ends", DOCS / "limits.md")}
    assert [*map(float, shown[name, way])] == pytest.approx(values, rel=0.02)


def test_the_tested_range_of_a_measured_actuator(tmp_path, measured_data):
    actuator, *values = limits_tables.ranges("festo/festo_datasheet", tmp_path)
    shown = {row[0]: row[1:] for row in rows_of("tested", DOCS / "limits.md")}[actuator]
    assert [shown[place] for place in (0, 1, 2)] == [
        f"{values[0]:.4g}",
        f"{values[1]:.4g}",
        "strain",
    ]
    assert [*map(float, shown[3:])] == pytest.approx(values[3:], rel=0.01)
