"""A study of two targets, from the spec to a page, a table of predictions and C; and what is
refused.
"""

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from cli_samples import CONFIGS, csv_rows, options, write_columns, write_lines

import mapmore_cli as mm
from mapmore_cli.domain.results import FitResult, OutputsFit
from mapmore_cli.storage.artefacts import read_fit, read_model, write_fit

LEVER = CONFIGS / "lever" / "lever-tip.yaml"
NAMES = ["tip_x", "tip_y"]
SLOW = """\
name: slow-tip
data:
  files: [log.csv]
  columns: {time: {column: t}, u: {column: u}, x: {column: x}, y: {column: y}}
  split: {validate: {last: 0.25}}
target: [x, y]
dictionary: [{terms: ["1", u, "slow(u, 0.3)", "u*slow(u, 0.3)", "u[k-1]"]}]
fit: {max_terms: 2}
report: {formats: [csv], figures: []}
"""


@pytest.fixture(scope="module")
def lever(tmp_path_factory, document):
    """The folder of the run, and what `mapmore run` says of it."""
    runs = tmp_path_factory.mktemp("runs")
    small = options(
        'data.files=["../../datasets/wrist/contraction_[123]00.csv"]',
        "data.levels.at=[100,200,300]",
        "data.split={validate: {pressure: [200]}}",
        "report.figures=[fit]",
        "fuse.extrapolation=saturate",
    )
    return runs / "lever-tip", document("run", LEVER, "-q", "--runs", runs, *small)


UNITS = """\
units: {x: mm, y: N}
validate: {require: {nrmse: {y: 5 %}, rmse: {x: 1 cm, y: 2 kN}}}
"""


@pytest.fixture
def slow(tmp_path):
    """A record of two outputs of one slow state, of an input that jumps."""
    t = np.arange(0, 8, 0.02)
    u = np.repeat(np.random.default_rng(4).uniform(0, 1, 20), 20)
    s, share = u.copy(), 1 - np.exp(-0.02 / 0.3)
    for k in range(1, 400):
        s[k] = s[k - 1] + share * (u[k] - s[k - 1])
    write_columns(tmp_path / "log.csv", "t,u,x,y", t, u, 2 * s + u, 0.1 * u - 5 * s)
    write_lines(tmp_path / "slow.yaml", SLOW)
    return tmp_path / "slow.yaml"


def test_outputs_are_scored_one_by_one_on_one_page(lever):
    run, told = lever
    own = [row for row in told["scores"] if row["model"] == "mapmore"]
    pooled = [row for row in own if (row["split"], row["curve"]) == ("validate", "all")]
    assert [row["target"] for row in pooled] == NAMES
    assert told["scores"] == json.loads((run / "scores.json").read_text())["scores"]
    page = (run / "report" / "index.html").read_text()
    for name in NAMES:
        assert f'<h2 id="{name}">' in page
        assert page.count(f'id="{name}.equations"') == 1
        assert (run / "report" / f"{name}.fit.svg").is_file()
        table = csv_rows((run / "report" / "tables" / f"{name}.scores.csv").read_text())
        assert {row["model"] for row in table} >= {"mapmore", "plane"}


def test_they_share_segments_and_terms(lever, document):
    run, _ = lever
    model = read_model(run / "model.h5")
    first, second = (one.pieces.segments for one in model.each)
    assert len(first) > 2
    for one, other in zip(first, second, strict=True):
        assert (one.id, one.cell, {*one.terms}) == (other.id, other.cell, {*other.terms})
    shown = document("show", run / "model.h5")
    assert [*shown["outputs"]] == NAMES
    assert [*document("show", run / "fit.h5")["outputs"]] == NAMES


def test_a_table_has_a_column_for_each_and_python_and_c_say_the_same(lever, tmp_path, mapmore):
    run, _ = lever
    rng, place = np.random.default_rng(1), run / "model.h5"
    given = {"force": rng.uniform(-50, 350, 200), "pressure": rng.uniform(60, 740, 200)}
    write_columns(tmp_path / "t.csv", "force,pressure", *given.values(), fmt="%.17g")
    table = csv_rows(mapmore("predict", place, tmp_path / "t.csv", code=0).stdout)
    assert [*table[0]] == [
        "force",
        "pressure",
        "tip_x_predicted",
        "tip_y_predicted",
        "outside_range",
    ]
    assert {row["outside_range"] for row in table} == {"true", "false"}
    model = mm.load_model(place)
    with pytest.warns(UserWarning, match="outside the training range"):
        said = model(**given)
    for name in NAMES:
        column = [float(row[f"{name}_predicted"]) for row in table]
        np.testing.assert_allclose(column, said[name], rtol=1e-11)
        with pytest.warns(UserWarning, match="outside the training range"):
            np.testing.assert_array_equal(model.of(name)(**given), said[name])
    assert repr(model) == "<model lever-tip: tip_x [mm], tip_y [mm] of force [N], pressure [kPa]>"
    if shutil.which("cc") is None:
        return
    mapmore("export", place, "--to", "c", "-o", tmp_path / "c", code=0)
    names = ["lever_tip.c", "lever_tip_main.c", "-o", "tip", "-lm"]
    subprocess.run(["cc", "-std=c99", "-Wall", "-Werror", *names], cwd=tmp_path / "c", check=True)
    rows = "".join(f"{f!r} {p!r}\n" for f, p in np.column_stack([*given.values()]).tolist())
    told = subprocess.run(
        [tmp_path / "c" / "tip"], input=rows, capture_output=True, text=True, check=True
    )
    values = np.array(told.stdout.split(), dtype=float).reshape(-1, 3).T
    for name, column in zip(NAMES, values, strict=False):
        np.testing.assert_allclose(column, said[name], rtol=1e-12, atol=1e-12)


def test_a_model_with_memory_has_the_terms_of_all_outputs(slow, mapmore, document):
    told = document("run", slow, "-q", "--runs", "runs")
    errors = {
        row["target"]: row["rmse"]
        for row in told["scores"]
        if (row["model"], row["split"], row["curve"]) == ("mapmore", "validate", "all")
    }
    assert errors == {"x": pytest.approx(0, abs=1e-9), "y": pytest.approx(0, abs=1e-9)}
    model = read_model(Path("runs/slow-tip/model.h5"))
    assert {frozenset(one.body.model.terms) for one in model.each} == {
        frozenset({"u", "slow(u, 0.3)"})
    }
    mapmore("export", "runs/slow-tip/model.h5", "--to", "c", code=0)
    write_columns("t.csv", "time,u", 0.02 * np.arange(50.0), np.linspace(0, 1, 50))
    table = csv_rows(mapmore("predict", "runs/slow-tip/model.h5", "t.csv", code=0).stdout)
    one, other = (float(table[-1][f"{name}_predicted"]) for name in "xy")
    assert 5 * (one - 1) + 2 * (other - 0.1) == pytest.approx(0, abs=1e-6)


def test_units_and_limits_are_of_each_output(slow, mapmore, document):
    slow.write_text(SLOW + UNITS)
    mapmore("validate", slow, "-q", "--runs", "runs", code=0)
    with h5py.File("runs/slow-tip/validate.h5") as file:
        places = ("predictions/mapmore/all", "others/000/predictions/mapmore/all")
        assert [file[place].attrs["unit"] for place in places] == ["mm", "N"]
    fits = {
        one: replace(fit, body=replace(fit.body, held_out=np.ones(2)))
        for one, fit in read_fit(Path("runs/slow-tip/fit.h5")).body.fits.items()
    }
    write_fit(Path("fit.h5"), FitResult(OutputsFit(fits)), {"x": "mm", "y": "N", "target": "mm"})
    with h5py.File("fit.h5") as file:
        found = [file[f"body/fits/{name}/body/held_out"].attrs["unit"] for name in "xy"]
    assert found == ["mm", "N"]
    words, settings = "n of mapmore (y) on the validate rows", options("validate.require.n.y=1e9")
    mapmore("validate", slow, "-q", "--runs", "runs", *settings, code=6, says=words)


def test_open_numbers_are_refused(slow, mapmore):
    terms = options("dictionary=[{slow: {of: [u]}}]")
    mapmore(
        "fit",
        slow,
        "-q",
        *terms,
        code=4,
        says="write the numbers, for example `slow(pressure, 0.3)`",
    )
