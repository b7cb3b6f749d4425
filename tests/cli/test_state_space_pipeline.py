"""A state-space model from the spec to the page: every command knows the kind, and every slip is
told at its place.
"""

import json

import numpy as np
import pytest
from cli_samples import PROJECT, by_place
from common import rows_of

import mapmore_cli
from mapmore_cli.annexes.motion.simulation import simulate
from mapmore_cli.storage.artefacts import read_fit

DATASETS = PROJECT / "datasets"
LOGS = DATASETS / "waveforms"
SPEC = f"""\
name: moving
units: {{displacement: cm}}
data:
  files: ["{LOGS}/reference_full.csv", "{LOGS}/waveform_rapid.csv", "{LOGS}/waveform_weighted.csv"]
  columns: {{time: {{column: t, unit: s}}, input: {{column: U, unit: V}},
      displacement: {{column: x, unit: mm}}}}
  every: 5
  split: {{validate: {{files: ["{LOGS}/waveform_*.csv"]}}}}
target: {{column: displacement}}
model: {{type: state_space, input: input, sections: [2350 mV, 3.95], direction: true, start: rest}}
validate:
  against:
    - {{as: one, set: {{model: {{type: state_space, input: input, offset: true}}}}}}
    - {{as: joined, set: {{model: {{type: state_space, input: input, sections: 3,
        switching: bumpless}}}}}}
report:
  figures: [fit]
  formats: [html, csv, png]
  published: {{source: somewhere}}
"""


@pytest.fixture(scope="module")
def finished(tmp_path_factory, mapmore):
    """The study, run once."""
    folder = tmp_path_factory.mktemp("moving")
    (folder / "spec.yaml").write_text(SPEC)
    result = mapmore("run", folder / "spec.yaml", "--runs", folder / "runs", "--json", "-q", code=0)
    return folder / "runs" / "moving", json.loads(result.stdout)


def refused(mapmore, tmp_path, change, code, says):
    old, new = change
    assert old in SPEC
    (tmp_path / "spec.yaml").write_text(SPEC.replace(old, new))
    return mapmore(
        "run", tmp_path / "spec.yaml", "--runs", tmp_path / "runs", "-q", code=code, says=says
    ).stderr


def recording(name="waveform_rapid"):
    log = np.loadtxt(LOGS / f"{name}.csv", delimiter=",", skiprows=1)[::5]
    return {"time": log[:, 0], "input": log[:, 1], "displacement": log[:, 3] / 10}


def test_the_model_file_holds_sections_that_predict_what_was_scored(finished):
    folder, document = finished
    motion = read_fit(folder / "fit.h5").body.model
    assert motion.boundaries == pytest.approx((2.35, 3.95))
    log = recording()
    simulated = simulate(motion, log)
    row = by_place(document)["mapmore", "validate", "waveform_rapid"]
    error = np.sqrt(np.mean((simulated - log["displacement"]) ** 2))
    assert row["rmse"] == pytest.approx(error, rel=1e-9)
    loaded = mapmore_cli.load_model(folder / "model.h5")
    assert [quantity.name for quantity in loaded.inputs] == ["input"]
    np.testing.assert_allclose(loaded(time=log["time"], input=log["input"]), simulated, atol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        *rows_of("""
input: input, sections: [2350 mV           input: pressure, sections: [2350 mV  \
    there is no quantity `pressure`
input: input, sections: [2350 mV           input: displacement, sections: [23 mm  \
    `displacement` is the target
[2350 mV, 3.95]                            [3.95 V, 2.35 V]                       do not increase
[2350 mV, 3.95]                            [2350 kPa, 3.95]                       kPa
[2350 mV, 3.95]                            0                                      at least 1
start: rest                                dead_band: 0.1 V  \
    a dead band needs `direction: true` and `switching: bumpless`
start: rest                                begin: {p1: [0, 1]}  \
    no particles, so that `begin` has no effect
start: rest                                seed: 2                                no particles
start: rest                                solver: swarm, seed: -1                at least 0
start: rest                                solver: swarm, begin: {p1: [1, 0]}  \
    lower bound first
start: rest                                solver: swarm, offset: true  \
    finds P1, P2 and P3 only
start: rest                                backbone: sarosi                  cannot have `backbone`
start: rest                                colour: red                            colour
type: state_space, input: input, sections  type: state_space, sections  \
    needs the `input`
type: state_space, input: input            type: literature, name: sarosi  \
    cannot have `sections`
units: {displacement: cm}                  units: {displacement: cm, time: ms}  \
    needs the time in s
"""),
        ('{files: ["', '{fraction: 0.3, seed: 1}}  # {files: ["', "single samples at random"),
    ],
)
def test_slips_in_the_spec_are_told_at_their_place(old, new, words, mapmore, tmp_path):
    refused(mapmore, tmp_path, (old, new), 3, [words, "spec.yaml:"])
