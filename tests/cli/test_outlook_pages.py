"""What the papers leave to others is on their pages as the commands find it."""

import warnings

import outlook_tables
import pytest
from page_tables import DOCS, numbers, page_table
from test_fmu_export import needs_compiler
from test_muscle_pages import assert_shown

H, EXPORT, W = DOCS / "muscle-like.md", DOCS / "export.md", DOCS / "wrist.md"


def page(name, path):
    return {row: numbers(cells) for row, cells in page_table(name, path).items()}


@pytest.mark.long
def test_valves_tendon_and_random_pressures(tmp_path, monkeypatch):
    monkeypatch.setattr("mapmore_cli.reporting.figures.drawing.drawings", lambda _name, _inputs: [])
    assert_shown(outlook_tables.outlook(tmp_path), H)


@needs_compiler
def test_two_units_turn_a_joint(tmp_path):
    """They are both models one after the other; a short part of the record is enough for that."""
    for row in outlook_tables.actuators(tmp_path, 400).rows[:2]:
        assert isinstance(row[1], float)
        assert row[1] < 1e-9
    shown = page("actuators", EXPORT)
    assert min(row["R²"] for row in shown.values()) > 0.95
    assert max(row.get("relative difference from `predict`", 0.0) for row in shown.values()) < 1e-9


@needs_compiler
@pytest.mark.long
def test_the_joint_moves_as_the_page_says(tmp_path):
    assert_shown(outlook_tables.actuators(tmp_path), EXPORT)


def test_a_measured_regulator(tmp_path, measured_data):
    # held-out samples beyond the training range
    with warnings.catch_warnings(action="ignore", category=UserWarning):
        assert_shown(outlook_tables.regulators(tmp_path), EXPORT)


def test_what_a_model_foretells_of_the_loop(tmp_path):
    """The simulation by Sárosi's formula alone; at twice the gains it swings where the rig does
    not.
    """
    row = page("wrist-loop", W)["sarosi"]
    for gains, column in ((1.0, "foretold: RMSE"), (2.0, "foretold at twice the gains: RMSE")):
        assert outlook_tables.foretold("sarosi", tmp_path, gains=gains) == pytest.approx(
            row[column], rel=0.05
        )


@pytest.mark.long
def test_the_rig_in_the_loop(tmp_path):
    row = page("wrist-loop", W)["sarosi"]
    assert outlook_tables.loops("sarosi", tmp_path)[0] == pytest.approx(row["rig: RMSE"], rel=0.02)
