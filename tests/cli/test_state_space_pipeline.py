"""A state-space model from the spec to its file; slips of its keys are in `study/slips.txt`."""

import json

import numpy as np
import pytest
from cli_samples import PROJECT, by_place

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


def test_the_model_file_holds_sections_that_predict_what_was_scored(finished):
    folder, document = finished
    motion = read_fit(folder / "fit.h5").body.model
    assert motion.boundaries == pytest.approx((2.35, 3.95))
    rows = np.loadtxt(LOGS / "waveform_rapid.csv", delimiter=",", skiprows=1)[::5]
    log = {"time": rows[:, 0], "input": rows[:, 1], "displacement": rows[:, 3] / 10}
    simulated = simulate(motion, log)
    row = by_place(document)["mapmore", "validate", "waveform_rapid"]
    error = np.sqrt(np.mean((simulated - log["displacement"]) ** 2))
    assert row["rmse"] == pytest.approx(error, rel=1e-9)
    loaded = mapmore_cli.load_model(folder / "model.h5")
    assert [quantity.name for quantity in loaded.inputs] == ["input"]
    np.testing.assert_allclose(loaded(time=log["time"], input=log["input"]), simulated, atol=1e-12)
