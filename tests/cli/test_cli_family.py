"""A family from YAML: run, `predict --set`, `adapt`."""

import json

import numpy as np
import pytest
from cli_samples import by_place, csv_rows, write_lines

SPEC = """\
schema_version: 1
name: muscles
data:
  files:
    - {path: "100_*.csv", set: {rest: 100 mm}}
    - {path: "200_*.csv", set: {rest: 200 mm}}
    - {path: "300_*.csv", set: {rest: 300 mm}}
  columns: {pressure: {column: P, unit: kPa}, strain: {column: eps}, force: {column: F, unit: N}}
  groups: {of: rest}
target: static
units: {rest: mm}
model: {family: {of: rest}}
validate: {simple: false, intervals: true}
report: {figures: [], formats: [csv]}
"""


def force(pressure, strain, length):
    return (
        300
        * np.arctan(19 * (length - 7.5) / 1000)
        * np.maximum(pressure / 600 * (1 - strain / 0.25) ** 2 - 0.1, 0)
        - 5
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory, mapmore):
    """Three muscles that have run as a family."""
    path = tmp_path_factory.mktemp("family")
    pressure = np.linspace(0, 600, 15)
    for length in (100, 200, 300):
        for strain in (0.0, 0.08, 0.16):
            rows = [
                f"{p:.3f},{strain},{f:.4f}"
                for p, f in zip(pressure, force(pressure, strain, length), strict=True)
            ]
            write_lines(path / f"{length}_{strain}.csv", "P,eps,F", *rows)
    (path / "muscles.yaml").write_text(SPEC)
    result = mapmore("run", path / "muscles.yaml", "--runs", path / "runs", "-q", "--json", code=0)
    rows = by_place(json.loads(result.stdout))
    assert rows["mapmore", "train", "all"]["nrmse"] < 0.05
    return path


def predicted(mapmore, model, table, *arguments):
    result = mapmore("predict", model, table, "-q", *arguments, code=0)
    return csv_rows(result.stdout)


def test_a_new_length_is_given_on_the_line(folder, mapmore):
    model, table = folder / "runs" / "muscles" / "model.h5", folder / "table.csv"
    table.write_text("pressure,strain\n600,0\n400,0.08\n")
    short, unit = (
        predicted(mapmore, model, table, "--set", text, "--interval", 0.95)
        for text in ("rest=250", "rest=25 cm")
    )
    assert short == unit
    assert [float(row["force_predicted"]) for row in short] == pytest.approx(
        [force(np.array([p]), e, 250.0)[0] for p, e in ((600, 0.0), (400, 0.08))], abs=15
    )
    assert all(
        float(row["force_low"]) < float(row["force_predicted"]) < float(row["force_high"])
        for row in short
    )
    grid = mapmore("predict", model, "--grid", "pressure=600,strain=0", "--set", "rest=250", "-q")
    assert grid.stdout.splitlines()[1].split(",")[3] == short[0]["force_predicted"]


def test_a_specimen_is_adapted_to_a_model_of_its_own(folder, tmp_path, mapmore, document):
    model, few, out = (
        folder / "runs" / "muscles" / "model.h5",
        tmp_path / "few.csv",
        tmp_path / "own.h5",
    )
    pressure = np.linspace(100, 600, 11)
    lines = (f"{p},0,{1.2 * force(p, 0, 250)}" for p in pressure)
    write_lines(few, "pressure,strain,force", *lines)
    found = document("adapt", model, few, "--set", "rest=250", "-o", out, "-q")
    assert 1.1 < found["parameters"]["q_force"] < 1.2  # drawn towards the prior
    assert found["samples"] == 11
    comma = (f"{p / 100};0;{1.2 * force(p, 0, 250)}".replace(".", ",") for p in pressure)
    write_lines(tmp_path / "foreign.csv", "P [bar];strain;force", *comma)
    read_by = ["--delimiter", ";", "--decimal", ",", "--columns", "pressure=P [bar]"]
    read_by += ["--units", "pressure=bar"]
    foreign = tmp_path / "foreign.csv", *read_by
    for kept in (model, few):
        line = ("adapt", model, few, "--set", "rest=250", "-o", kept, "-q")
        mapmore(*line, code=7, says=(f"{kept}: ", "replace"))
    again = document("adapt", model, *foreign, "--set", "rest=250", "-o", out, "-q")
    assert again["parameters"] == pytest.approx(found["parameters"], rel=1e-6)
    assert "learnt from 3 specimens" in found["notes"][0]
    assert "those of the family, which come from 3 specimens" in found["notes"][-1]
    mapmore(
        "adapt",
        out,
        few,
        "--set",
        "rest=250",
        "-o",
        tmp_path / "again.h5",
        code=2,
        says="adapt needs a family model",
    )
    rows = predicted(mapmore, out, few, "--interval", 0.95)
    assert [float(row["force_predicted"]) for row in rows] == pytest.approx(
        [float(row["force"]) for row in rows], abs=30
    )
    mapmore("show", out, code=0)
    mapmore("export", out, "--to", "py", "-o", tmp_path / "own.py", code=0)


def test_a_family_is_adapted_to_a_length_that_is_given(folder, tmp_path, mapmore):
    model, words = folder / "runs" / "muscles" / "model.h5", "`--set rest=200`, in mm; the family"
    mapmore("adapt", model, "-o", tmp_path / "own.h5", code=2, says=f"{words} covers 100 to 300")
