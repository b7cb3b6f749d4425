"""docs/intervals.md: a row of the simulated table and the quick rows of the measured one are made
anew; the coverage is what is said.
"""

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


@pytest.mark.parametrize(
    ("table", "words"),
    [("coverage", "Depending on the cell, {} to {} %"), ("bent", "levels, {} to {} %")],
)
def test_the_least_and_greatest_coverage_are_those_of_the_table(table, words):
    shares = np.array([in_per_cent(row) for row in rows_of(table, PAGE)])
    assert words.format(np.nanmin(shares), np.nanmax(shares)) in PAGE.read_text()


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


@pytest.mark.long
def test_the_bands_of_a_muscle(tmp_path, measured_data):
    shown = {name: [*map(float, cells)] for name, *cells in rows_of("bands", PAGE)}
    for name, *values in interval_tables.band_rows(30, tmp_path):
        assert shown[name] == pytest.approx(values, rel=0.02)


def test_the_constants_of_the_program_stand_on_the_page():
    """They are those of all families, or a little larger."""
    shown, found = (
        numbers(page_table("constants", PAGE)[row]) for row in ("in the program", "none")
    )
    assert shown == {f"{count} levels": scale for count, scale in FEW.items()}
    assert all(found[count] <= scale <= 1.05 * found[count] for count, scale in shown.items())


@pytest.mark.long
def test_the_constants_are_calibrated_anew(tmp_path, measured_data):
    found = interval_tables.scales(tmp_path)["none"]
    shown = numbers(page_table("constants", PAGE)["none"])
    named = {f"{count} levels": scale for count, scale in found.items()}
    assert named == pytest.approx(shown, rel=0.02)
