"""Studies with uncertainties and gross outliers, as a user runs them."""

import numpy as np
import pytest
from cli_samples import OWN, by_place, edit, write_columns

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
LEVELS = (100, 150, 200, 250, 300, 350, 400)


@pytest.fixture
def study(tmp_path):
    """Seven pressures; a standard deviation of 1 N, on day 2 of 4 N; one sample in ten of three
    recordings is 60 N off, to one side.
    """
    rng, strain = np.random.default_rng(8), np.linspace(0, 0.2, 50)
    for number, level in enumerate(LEVELS):
        sd = np.full(50, 4.0 if number % 2 else 1.0)
        force = level * (1 - 4 * strain) + sd * rng.normal(size=50)
        force[5::10] += 60.0 * (number in (0, 2, 6))
        day = np.full(50, 1 + number % 2)
        columns = (np.full(50, level), strain, force, sd, day)
        write_columns(tmp_path / f"r{level}.csv", "P,eps,F,sd,day", *columns)
    spec = tmp_path / "weighed.yaml"
    spec.write_text(SPEC)
    return spec


@pytest.fixture
def scores(study, document):
    """The score rows by place, with other settings."""

    def run(*settings):
        arguments = [one for setting in settings for one in ("--set", setting)]
        return by_place(document("run", study, "-q", "--runs", study.parent / "runs", *arguments))

    return run


def test_outliers_are_listed_by_file_and_row_and_stay(scores, study, document, mapmore):
    plain, robust = scores(), scores("fit.loss=bisquare")
    assert robust[OWN]["rmse"] < 0.5 * plain[OWN]["rmse"]
    assert robust["mapmore", "train", "all"]["n"] == plain["mapmore", "train", "all"]["n"]
    run = study.parent / "runs" / "weighed"
    found = document("show", run / "validate.h5")["outliers"]
    places = {(one["file"], one["place"]) for one in found if abs(one["off"]) > 40}
    gross = {(f"r{p}.csv", f"row {2 + i}") for p in (100, 200, 400) for i in range(5, 50, 10)}
    assert places == gross
    listed = (run / "report" / "tables" / "outliers.csv").read_text()
    assert listed.count("\n") == 1 + len(found)
    shown = mapmore("show", run / "fit.h5", code=0).stdout
    assert "standard error" in shown
    assert "Standard errors by curve" in shown


def test_uncertainties_weigh_samples_and_make_chi_square(scores):
    """A column, or values by group, weigh days by how well they were measured."""
    same = scores("data.uncertainty={force: 4 N}")
    assert same[OWN]["rmse"] == pytest.approx(scores()[OWN]["rmse"], rel=1e-9)
    assert same[OWN]["chi2_dof"] == pytest.approx(same[OWN]["rmse"] ** 2 / 16, rel=1e-9)
    train = same["mapmore", "train", "all"]
    assert train["chi2_dof"] == pytest.approx(
        train["rmse"] ** 2 / 16 * train["n"] / (train["n"] - 4), rel=1e-9
    )
    column = scores("data.uncertainty={force: sd}")
    groups = scores("data.uncertainty={force: {'1': 1 N, '2': 4 N}}")
    assert groups == column
    assert column["mapmore", "train", "all"]["rmse"] > train["rmse"]  # of samples alike
    first = column["mapmore", "train", "pressure=100"]
    assert first["rmse_weighted"] == pytest.approx(first["rmse"], rel=1e-9)


def test_a_share_of_nothing_is_refused_and_one_with_a_floor_is_not(study, mapmore, scores):
    asked = "data.uncertainty={force: 2 %}"

    edit(study.parent / "r100.csv", "100,0,", "100,0,0.0001,1,1\n100,0,")
    told = mapmore("ingest", study, "--set", asked, code=4).stderr
    assert "data.uncertainty.force" in told
    assert "sample 1 of pressure=100" in told
    assert "sqrt(0.25 + (0.02*force)^2)" in told
    floor = "data.derive={own: 'sqrt(0.25 + (0.02*force)^2)'}"
    assert scores(floor, "data.uncertainty={force: own}")[OWN]["chi2_dof"] > 0


def test_what_an_input_explains_is_told(study, mapmore):
    """The slope is about 4 times the pressure, so 1 % of strain is about 10 N."""
    asked = "data.uncertainty={strain: 1 %, force: 4 N}"
    told = mapmore("run", study, "--set", asked, code=0).stderr
    assert "strain: its uncertainty times the slope of the model is" in told


def test_a_model_with_memory_is_robust_one_step_ahead(tmp_path, document, mapmore):
    """`y[k] = 0.9 y[k-1] + 0.2 u`: gross errors of the sensor pull its pole down by squares."""
    rng, n = np.random.default_rng(2), 800
    u, y = np.repeat(rng.uniform(0, 5, 40), 20), np.zeros(n)
    for k in range(1, n):
        y[k] = 0.9 * y[k - 1] + 0.2 * u[k] + 0.01 * rng.normal()
    y[rng.choice(n, 24, replace=False)] += 8.0
    write_columns(tmp_path / "log.csv", "t,u,y", 0.1 * np.arange(n), u, y)
    spec = tmp_path / "lagged.yaml"
    spec.write_text(
        "name: lagged\ndata:\n  files: [log.csv]\n"
        "  columns: {time: {column: t}, u: {column: u}, y: {column: y}}\ntarget: y\n"
        "dictionary: [{terms: ['y[k-1]', u]}]\nfit: {max_terms: 2, loss: LOSS}\n"
        "validate: {simple: false}\nreport: {formats: [csv], figures: []}\n"
    )
    poles = {}
    for loss in ("squares", "bisquare"):
        edit(spec, "LOSS" if loss == "squares" else "squares", loss)
        mapmore("run", spec, "-q", "--runs", tmp_path / "runs", code=0)
        fit = document("show", tmp_path / "runs" / "lagged" / "fit.h5")["segments"][0]
        place = fit["terms"].index("y[k-1]")
        poles[loss] = abs(fit["theta"][place] - 0.9) / fit["theta_error"][place]
        if loss == "bisquare":
            assert fit["theta"][place] == pytest.approx(0.9, abs=1e-3)
    assert poles["bisquare"] < 3
