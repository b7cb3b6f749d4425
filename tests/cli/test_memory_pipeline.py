"""Models with memory from end to end, and their tables: planted models are found, predicted as
validated, mishaps are told.
"""

import re
from dataclasses import replace

import numpy as np
import pytest
from cli_samples import csv_rows, hand_model, write_lines

from mapmore_cli.annexes.sums import Part, Sum
from mapmore_cli.cli.views import VIEWS
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import BY_RECORDING, LOWER_BOUND, MemoryModel, StateSet
from mapmore_cli.domain.models import Memory, Model
from mapmore_cli.domain.recording import CurveRange, Quantity, Signal
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.pipeline.predict import predicted_lines
from mapmore_cli.storage.artefacts import read_dataset, read_model, read_validation

STEP = 0.01
GAP = 150
"""The row of every recording before which half a second is missing."""

SPEC = """\
schema_version: 1
name: {name}
data:
  files: ["{name}_*.csv"]
  columns: {{time: {{column: t}}, pressure: {{column: p}}, load: {{column: w, unit: N}},
      displacement: {{column: x, unit: m}}}}
  gaps: {{longer_than: 100 ms, action: split}}
  split: {{validate: {{recordings: ["{name}_c*"]}}}}
target: {{column: displacement}}
{model}
validate: {{normaliser: range}}
report: {{figures: [], formats: [csv]}}
"""
NARX = """\
dictionary:
  - lags: {of: [displacement, pressure], steps: [1, 2], order: 2}
  - terms: [load, load^2]
fit: {max_terms: 4, tolerance: 0}
"""
PLAY = """\
dictionary:
  - terms: [pressure, load]
  - play: {of: [pressure], widths: [0.05, 0.1, 0.2, 0.3, 0.4]}
  - slow: {of: [pressure], tau: [50 ms, 0.5 s]}
fit: {max_terms: 3, tolerance: 0}
"""


def narx(pressure, load):
    """x[k] = 0.5 p[k-1] - 0.4 x[k-2] + 0.3 p[k-1] x[k-1] + 0.1 w."""
    x = np.zeros(len(pressure))
    for k in range(2, len(x)):
        x[k] = (
            0.5 * pressure[k - 1]
            - 0.4 * x[k - 2]
            + 0.3 * pressure[k - 1] * x[k - 1]
            + 0.1 * load[k]
        )
    return x


def hysteresis(pressure, load):
    """x = 2 p - 1.5 play(p; 0.2 of the range 2) + 0.5 w; the slack starts centred."""
    held, x = pressure[0], np.zeros(len(pressure))
    for k, now in enumerate(pressure):
        held = min(max(held, now - 0.4), now + 0.4)
        x[k] = 2 * now - 1.5 * held + 0.5 * load[k]
    return x


def write_study(folder, name, model, law):
    """Three recordings at loads of their own, each with a gap; the third validates. The pressure
    just reaches -1 and 1.
    """
    for number, letter in enumerate("abc"):
        rng = np.random.default_rng(number)
        k = np.arange(300)
        pressure = np.clip(
            1.2 * np.sin(k / (7 + number)) * np.cos(k / 31) + rng.normal(0, 0.2, 300), -1, 1
        )
        load = np.full(300, float(number))
        x = np.concatenate(
            [law(pressure[part], load[part]) for part in (slice(GAP), slice(GAP, 300))]
        )
        time = k * STEP + np.where(k >= GAP, 0.5, 0.0)
        rows = np.column_stack([time.round(9), pressure, load, x]).tolist()
        lines = (",".join(map(repr, row)) for row in rows)
        write_lines(folder / f"{name}_{letter}.csv", "t,p,w,x", *lines)
    spec = folder / f"{name}.yaml"
    spec.write_text(SPEC.format(name=name, model=model))
    return spec


@pytest.fixture(scope="module")
def finished(tmp_path_factory, mapmore):
    """Both studies, run: their specs and run folders; not to be changed."""
    folder = tmp_path_factory.mktemp("memory")
    found = {}
    for name, model, law in (("narx", NARX, narx), ("play", PLAY, hysteresis)):
        spec = write_study(folder, name, model, law)
        mapmore("run", spec, "--runs", folder / "runs", "-q", code=0)
        found[name] = (spec, folder / "runs" / name)
    return found


def scores(run_dir):
    rows = csv_rows((run_dir / "scores.csv").read_text())
    return {(row["split"], row["curve"]): row for row in rows if row["model"] == "mapmore"}


PLANTED = {
    "narx": {
        "pressure[k-1]": 0.5,
        "displacement[k-2]": -0.4,
        "displacement[k-1]*pressure[k-1]": 0.3,
        "load": 0.1,
    },
    "play": {"pressure": 2.0, "play(pressure, 0.2)": -1.5, "load": 0.5},
}


@pytest.mark.parametrize(
    ("name", "samples"), [("narx", 296), ("play", 300)]
)  # two pieces, each without the two samples of history
def test_a_planted_model_is_found_and_scored_on_the_recording_that_was_held_out(
    name, samples, finished
):
    model = read_model(finished[name][1] / "model.h5").body.model
    assert dict(zip(model.terms, model.theta, strict=True)) == pytest.approx(
        PLANTED[name], abs=1e-9
    )
    found = scores(finished[name][1])
    curves = {curve for split, curve in found if split == "validate"}
    assert curves == {"all", f"{name}_c#1", f"{name}_c#2"}
    row = found["validate", "all"]
    assert max(float(row["rrse"]), float(row["rrse_one_step"])) < 1e-9
    assert int(row["n"]) == samples


# predict
# --------------------------------------------------------------------------------------------------


def measured(run_dir):
    """The recordings of a study as one table with canonical names; the gaps are gaps of time
    here.
    """
    rows = []
    for curve in read_dataset(run_dir / "ingest.h5").curves:
        columns = {
            name: map(repr, curve.columns[name].tolist())
            for name in ("time", "pressure", "load", "displacement")
        }
        rows += [
            {"recording": curve.id.partition("#")[0], **dict(zip(columns, row, strict=True))}
            for row in zip(*columns.values(), strict=True)
        ]
    return rows


def predicted(mapmore, run_dir, rows):
    """Predictions of a table of rows (NaN for an empty one), and what the command said."""
    text = "\n".join([",".join(rows[0]), *(",".join(row.values()) for row in rows)]) + "\n"
    result = mapmore("predict", run_dir / "model.h5", "-", stdin=text)
    out = csv_rows(result.stdout) if result.exit_code == 0 else []
    return [float(row["displacement_predicted"] or "nan") for row in out], result


@pytest.mark.parametrize("name", sorted(PLANTED))
def test_a_table_predicts_what_was_validated(name, finished, mapmore):
    run_dir = finished[name][1]
    found, result = predicted(mapmore, run_dir, measured(run_dir))
    assert (result.exit_code, result.stderr) == (0, "")
    wanted = np.concatenate(read_validation(run_dir / "validate.h5").predictions["mapmore"])
    np.testing.assert_allclose(found, wanted, rtol=1e-11, atol=1e-300)
    assert np.isnan(wanted).sum() == {"narx": 12, "play": 0}[name]


# what goes wrong
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "family",
    [
        f"lags: {{of: [pressure], steps: {list(range(400))}, order: 3}}",
        "products: {of: [{play: {of: [pressure], count: 99}}, {slow: {of: [load], count: "
        "99}}], order: 12}",
    ],
    ids=["lags", "products"],
)
def test_a_dictionary_beyond_memory_is_refused_with_numbers(family, finished, tmp_path, mapmore):
    result = mapmore(
        "fit",
        finished["play"][0],
        "--runs",
        tmp_path,
        "-q",
        "--set",
        f"dictionary=[{{{family}}}]",
        code=4,
    )
    assert re.search("GB of memory; .* may be used", result.stderr)
    assert not (tmp_path / "play" / "fit.h5").exists()


# show
# --------------------------------------------------------------------------------------------------


STATES = StateSet(
    ("force[k-2]", "slow(pressure, 0.05)", "pressure[k-1]"),
    STEP,
    {},
    {},
    np.empty(0),
    np.empty(0),
    0.15,
)
MEMORY = MemoryModel(
    "force",
    STATES,
    ("force[k-2]", "slow(pressure, 0.05)", "pressure[k-1]"),
    np.array([0.5, 2.0, -1.0]),
    np.zeros(3),
    3.0,
    (-1e4, 1e4),
)
LIMITS = {"pressure": (100.0, 200.0)}
REMEMBERING = Model(
    name="remembering",
    output=Quantity("force", "N"),
    inputs=(Quantity("pressure", "kPa"),),
    body=Memory(MEMORY, (CurveRange("all", None, LIMITS),)),
)
STATIC = hand_model()
SUM = replace(
    REMEMBERING,
    name="sum",
    inputs=STATIC.inputs,
    body=Sum((Part(STATIC), Part(REMEMBERING))),
)


@pytest.mark.parametrize("chunk", [5, 20_000])
@pytest.mark.parametrize("model", [REMEMBERING, SUM])
def test_every_piece_is_predicted_as_by_itself(model, chunk):
    """After a gap, where the clock was set back, in another recording, and after an empty cell."""
    rng = np.random.default_rng(1)
    lines, wanted = ["recording,time,pressure,strain,force\n"], []
    for name, start in (("a", 0), ("a", 40), ("a", 0), ("b", 12), ("b", 25)):
        time = STEP * (start + np.arange(12))
        table = np.column_stack([time, rng.uniform([100, 0, 0], [200, 0.1, 0.1], (12, 3))])
        columns = zip(("time", "pressure", "strain", "force"), table.T, strict=True)
        wanted += predict(model, dict(columns)).tolist()
        lines += [",".join([name, *map(repr, row)]) + "\n" for row in table.tolist()]
        if start == 12:
            lines.append(f"b,{24 * STEP!r},,0.05,1.0\n")
            wanted.append(np.nan)
    found = [line.split(",")[-2] for line in predicted_lines(model, lines, "t", chunk)][1:]
    np.testing.assert_allclose([float(cell or "nan") for cell in found], wanted, rtol=1e-11)


@pytest.mark.parametrize("model", [REMEMBERING, SUM], ids=["alone", "in a sum"])
def test_the_past_is_asked_for_where_a_model_feeds_back(model):
    inputs = [quantity.name for quantity in model.inputs]
    with pytest.raises(DataError, match="no column 'force'"):
        list(predicted_lines(model, [",".join(["time", *inputs]) + "\n"], "t"))
    with pytest.raises(DataError, match="t: the table is empty") as caught:
        list(predicted_lines(model, [], "t"))
    assert "time [s], pressure [kPa]" in caught.value.remedy
    assert "force [N]" in caught.value.remedy


@pytest.mark.parametrize("note", [LOWER_BOUND, BY_RECORDING])
def test_show_says_what_the_standard_errors_of_a_model_are(note):
    body = replace(REMEMBERING.body, model=replace(MEMORY, errors_note=note))
    view = VIEWS["model"](replace(REMEMBERING, body=body))
    assert any(note in line for table in view.tables for line in table.notes)
    (rows,) = (table.rows for table in view.tables if table.name == "coefficients")
    assert (rows[0], len(rows)) == (("(constant)", 3.0, None), 4)
    assert note in str(view.document)


def test_rates_are_derived_before_memory_runs():
    states = StateSet(("slow(pressure_rate, 0.05)",), STEP, {}, {}, np.empty(0), np.empty(0), 0.15)
    memory = MemoryModel(
        "force", states, states.names, np.array([2.0]), np.zeros(1), 0.0, (-1e9, 1e9)
    )
    model = replace(
        REMEMBERING,
        inputs=(Quantity("pressure_rate", "kPa/s"),),
        body=Memory(memory, (CurveRange("all", None, {"pressure_rate": (0.0, 10.0)}),)),
        signals=(Signal("pressure_rate", "rate", "pressure", window=0.05, order=1),),
    )
    rows = [f"{k * STEP!r},{100 + 3 * k * STEP!r}\n" for k in range(50)]
    found = [
        line.split(",")[-2] for line in predicted_lines(model, ["time,pressure\n", *rows], "t")
    ][1:]
    np.testing.assert_allclose([float(cell) for cell in found], 6.0)  # 3 kPa/s all along
