"""docs/intervals.md: a row of the simulated table and the quick rows of the measured one are made anew; the coverage is what is said."""

from __future__ import annotations

from pathlib import Path

import interval_tables
import numpy as np
import pytest
from page_tables import DOCS, numbers, page_table

PAGE = DOCS / "intervals.md"


def test_a_simulated_row() -> None:
    name, *values = interval_tables.simulated_row("mckibben", "sarosi", 4)
    row = numbers(page_table("simulated", PAGE)[name])
    assert [row[key] for key in ("inside", "±", "RMSE", "± over RMSE")] == pytest.approx(values, rel=0.02)


@pytest.mark.parametrize("config", [pytest.param("coiled/coiled_loops", marks=pytest.mark.long), "muscle-like/antagonist-pam"])
def test_a_measured_row(config: str, tmp_path: Path, measured_data: Path) -> None:
    name, _, *values, _ = interval_tables.measured_row(config, tmp_path)
    row = numbers(page_table("measured", PAGE)[name])
    assert [row[key] for key in ("held out", "inside", "±", "RMSE", "± over RMSE")] == pytest.approx(values, rel=0.02)


def test_new_curves_are_covered_as_often_as_is_said() -> None:
    rows = {name: numbers(row)["inside"] for name, row in page_table("simulated", PAGE).items()}
    assert len(rows) == 16
    assert min(rows.values()) > 85
    assert 92 < np.mean(list(rows.values())) < 98


def test_intervals_are_no_wider_than_they_need_to_be() -> None:
    rows = [numbers(row) for table in ("simulated", "measured") for row in page_table(table, PAGE).values()]
    assert np.median([row["± over RMSE"] for row in rows]) <= 4.5


def test_every_study_of_the_table_is_there() -> None:
    assert list(page_table("measured", PAGE)) == [Path(config).name for config in interval_tables.MEASURED]
