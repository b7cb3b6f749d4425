"""docs/intervals.md: a row of the simulated table and the quick rows of the measured one are made
anew; the coverage is what is said.
"""

from pathlib import Path

import interval_coverage
import interval_tables
import numpy as np
import pytest
from page_tables import DOCS, numbers, page_table, rows_of

from mapmore_cli.modelling.validation.intervals import FEW

PAGE = DOCS / "intervals.md"


def in_per_cent(row):
    """The coverage in the cells of a row of the tables `coverage` and `bent`; NaN where there are
    no intervals.
    """
    return np.array([np.nan if cell in (None, "", "–") else float(cell) for cell in row[2:]])


def test_a_row_of_the_coverage():
    ((*_, at),) = [interval_coverage.covered(interval_coverage.Process(2.0), 5, 2, 100)[None]]
    assert 0.93 <= at[0] <= 0.98
    assert 0.93 <= at[1] <= 0.98


@pytest.mark.long
def test_new_curves_are_covered_wherever_there_are_intervals():
    """Every row, 1 000 new curves a cell; the page has what is found here."""
    found = interval_coverage.rows()
    shares = np.array([in_per_cent(row) for row in found])
    refused = {row[:2] for row, own in zip(found, shares, strict=True) if np.isnan(own).all()}
    assert refused == {(2, 1), (3, 1)}
    assert np.nanmin(shares) >= 93
    assert np.nanmax(shares) <= 97.5
    for own, said in zip(shares, rows_of("coverage", PAGE), strict=True):
        np.testing.assert_allclose(own, in_per_cent(said), atol=0.11)


def test_the_page_says_what_the_cells_of_the_coverage_are():
    """The range of all cells, in words and in the table `spread`."""
    text, rows = PAGE.read_text(encoding="utf-8"), rows_of("coverage", PAGE)
    assert {tuple(map(int, row[:2])) for row in rows} == {
        (count, repeats)
        for count in interval_coverage.LEVELS
        for repeats in interval_coverage.RECORDINGS
    }
    for name, words in (
        ("coverage", "Of all cells, {:.1f} to {:.1f} % lie inside"),
        ("bent", "Where the surface bends between the levels, {:.1f} to {:.1f} % lie inside"),
    ):
        cells = [in_per_cent(row) for row in rows_of(name, PAGE)]
        assert words.format(np.nanmin(cells), np.nanmax(cells)) in text
    every = np.array([in_per_cent(row) for row in rows])
    above, told = np.sum(every > 97), np.isfinite(every).sum()
    assert f"{above} of the {told} shares are above 97 %" in text
    spread = {row[0]: row[1:] for row in rows_of("spread", PAGE)}
    for row in rows:
        cells = in_per_cent(row)
        told = "none"
        if np.isfinite(cells).any():
            told = f"{np.nanmin(cells):.1f} to {np.nanmax(cells):.1f}"
        assert spread[row[0]][int(row[1]) - 1] == told


def test_a_simulated_row():
    name, *values = interval_tables.simulated_row("mckibben", "sarosi", 4)
    row = numbers(page_table("simulated", PAGE)[name])
    assert [row[key] for key in ("inside", "±", "RMSE", "± over RMSE")] == pytest.approx(
        values, rel=0.02
    )


@pytest.mark.parametrize(
    "config",
    [pytest.param("coiled/coiled_loops", marks=pytest.mark.long), "muscle-like/antagonist-pam"],
)
def test_a_measured_row(config, tmp_path, measured_data):
    name, _, *values, _ = interval_tables.measured_row(config, tmp_path)
    row = numbers(page_table("measured", PAGE)[name])
    assert [
        row[key] for key in ("held out", "inside", "±", "RMSE", "± over RMSE")
    ] == pytest.approx(values, rel=0.02)


def test_constants_that_do_not_know_a_family_cover_it():
    rows = rows_of("families", PAGE)
    assert len({row[0] for row in rows}) == 11
    assert {row[1] for row in rows} == {"3", "4", "5", "7"}
    inside, width = np.array([[float(row[4]), float(row[5])] for row in rows]).T
    assert 92 < inside.mean() < 98
    assert inside.min() > 86
    assert np.median(width) < 4.5


def test_the_constants_are_those_of_all_families():
    assert numbers(page_table("constants", PAGE)["none"]) == {
        f"{count} levels": scale for count, scale in FEW.items()
    }


@pytest.mark.long
def test_the_constants_are_calibrated_anew(tmp_path, measured_data):
    assert interval_tables.scales(tmp_path)["none"] == pytest.approx(FEW, rel=0.02)


def test_every_study_of_the_table_is_there():
    assert list(page_table("measured", PAGE)) == [
        Path(config).name for config in interval_tables.MEASURED
    ]
