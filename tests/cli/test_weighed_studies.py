"""Studies with uncertainties and gross outliers, as a user runs them."""

import numpy as np
import pytest
from cli_samples import OWN, by_place, edit, options, write_columns, write_lines

SPEC = """\
name: weighed
data:
  files: ["r*.csv"]
  columns: {pressure: {column: P}, strain: {column: eps}, force: {column: F}, sd: {column: sd},
      day: {column: day}}
  levels: {of: pressure}
  groups: {of: day}
  split: {validate: {pressure: [300]}}
target: static
segment: {pressure: none}
dictionary: [{polynomial: {of: [pressure, strain], order: 2}}]
fit: {max_terms: 4}
validate: {simple: false}
report: {formats: [csv], figures: []}
"""
LAGGED = """\
name: lagged
data:
  files: [log.csv]
  columns: {time: {column: t}, u: {column: u}, y: {column: y}}
target: y
dictionary: [{terms: ["y[k-1]", u]}]
fit: {max_terms: 2, loss: bisquare}
validate: {simple: false}
"""
TRAIN = ("mapmore", "train", "all")


@pytest.fixture
def study(tmp_path):
    """Seven pressures; a standard deviation of 1 N, on day 2 of 4 N; one sample in ten of three
    recordings is 60 N off, to one side.
    """
    rng, strain = np.random.default_rng(8), np.linspace(0, 0.2, 50)
    for number, level in enumerate((100, 150, 200, 250, 300, 350, 400)):
        sd = 4.0 if number % 2 else 1.0
        force = level * (1 - 4 * strain) + sd * rng.normal(size=50)
        force[5::10] += 60.0 * (number in (0, 2, 6))
        table = np.broadcast_arrays(level, strain, force, sd, 1 + number % 2)
        write_columns(tmp_path / f"r{level}.csv", "P,eps,F,sd,day", *table)
    write_lines(tmp_path / "weighed.yaml", SPEC)
    return tmp_path / "weighed.yaml"


@pytest.fixture
def scores(study, document):
    """The score rows by place, with other settings."""
    return lambda *settings: by_place(
        document("validate", study, "-q", "--runs", study.parent / "runs", *options(*settings))
    )


def test_outliers_are_listed_by_file_and_row_and_stay(scores, study, document, mapmore):
    plain, robust = scores(), scores("fit.loss=bisquare")
    assert robust[OWN]["rmse"] < 0.5 * plain[OWN]["rmse"]
    assert robust[TRAIN]["n"] == plain[TRAIN]["n"]
    run = study.parent / "runs" / "weighed"
    found = document("show", run / "validate.h5")["outliers"]
    places = {(one["file"], one["place"]) for one in found if abs(one["off"]) > 40}
    gross = {(f"r{p}.csv", f"row {2 + i}") for p in (100, 200, 400) for i in range(5, 50, 10)}
    assert places == gross
    shown = mapmore("show", run / "fit.h5", code=0).stdout
    assert "standard error" in shown
    assert "Standard errors by curve" in shown


def test_uncertainties_weigh_samples_and_make_chi_square(scores):
    """A column, or values by group, weigh days by how well they were measured."""
    same = scores("data.uncertainty={force: 4 N}")
    assert same[OWN]["rmse"] == scores()[OWN]["rmse"]
    square = {place: (row["rmse"] / 4) ** 2 for place, row in same.items()}
    assert same[OWN]["chi2_dof"] == pytest.approx(square[OWN])
    assert same[TRAIN]["chi2_dof"] == pytest.approx(square[TRAIN] * 300 / 296)
    column = scores("data.uncertainty={force: sd}")
    assert scores("data.uncertainty={force: {'1': 1 N, '2': 4 N}}") == column
    assert column[TRAIN]["rmse"] > same[TRAIN]["rmse"]  # which samples alike make least


def test_a_share_of_nothing_is_refused_and_what_an_input_explains_is_told(study, mapmore):
    edit(study.parent / "r100.csv", "100,0,", "100,0,0.0001,1,1\n100,0,")
    asked = ("ingest", study, "--set", "data.uncertainty={force: 2 %}")
    mapmore(*asked, code=4, says=("sample 1 of pressure=100", "sqrt(0.25 + (0.02*force)^2)"))
    asked = ("fuse", study, "--set", "data.uncertainty={strain: 1 %}")
    mapmore(*asked, code=0, says=("strain: its uncertainty times the slope of the model is",))


def test_a_model_with_memory_is_robust_one_step_ahead(tmp_path, document):
    """`y[k] = 0.9 y[k-1] + 0.2 u`: gross errors of the sensor pull its pole down by squares."""
    rng, y = np.random.default_rng(2), np.zeros(800)
    u = np.repeat(rng.uniform(0, 5, 40), 20)
    for k in range(1, 800):
        y[k] = 0.9 * y[k - 1] + 0.2 * u[k] + 0.01 * rng.normal()
    y[rng.choice(800, 24, replace=False)] += 8.0
    write_columns(tmp_path / "log.csv", "t,u,y", 0.1 * np.arange(800), u, y)
    write_lines(tmp_path / "lagged.yaml", LAGGED)
    fit = document("fit", tmp_path / "lagged.yaml", "-q", "--runs", tmp_path)["segments"][0]
    place = fit["terms"].index("y[k-1]")
    assert fit["theta"][place] == pytest.approx(0.9, abs=3 * fit["theta_error"][place])
    assert fit["theta_error"][place] < 1e-3
