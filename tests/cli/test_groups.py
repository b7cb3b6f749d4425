"""Specimens: each is scored by itself, and predicted as a run that holds it out predicts it."""

import numpy as np
import pytest
from cli_samples import write_recording

SPEC = """\
name: specimens
data:
  files: [{path: "a_*.csv", set: {specimen: 1}}, {path: "b_*.csv", set: {specimen: 2}},
      {path: "c_*.csv", set: {specimen: 3}}]
  columns: {pressure: {column: P, unit: kPa}, strain: {column: eps}, force: {column: F, unit: N}}
  levels: {of: pressure, at: [100, 200, 300]}
  groups: {of: specimen}
SPLIT
target: static
dictionary: [{polynomial: {of: [strain], order: 2}}]
fit: {max_terms: 3}
report: {formats: [csv]}
"""


@pytest.fixture
def campaign(tmp_path):
    """Three specimens at three pressures; the third pulls by a fifth more."""
    strain = np.linspace(0.0, 0.2, 40)
    for name, factor in (("a", 1.0), ("b", 1.03), ("c", 1.2)):
        rng = np.random.default_rng(ord(name))
        for level in (100, 200, 300):
            force = factor * level * (2 - 8 * strain) + rng.normal(0, 0.3, 40)
            write_recording(tmp_path, name, level, strain, force)
    return tmp_path


def rows(document, folder, split):
    spec = folder / "specimens.yaml"
    spec.write_text(SPEC.replace("SPLIT", split))
    scores = document("validate", spec, "--runs", folder / "runs", "-q")["scores"]
    return {(row["split"], row["curve"]): row for row in scores if row["model"] == "mapmore"}


def test_each_group_is_scored_and_predicted_as_by_a_run_without_it(campaign, document):
    left_out = rows(document, campaign, "  split: {leave_one_group_out: true}")
    for specimen in (2, 3):
        held_out = rows(document, campaign, f"  split: {{validate: {{specimen: [{specimen}]}}}}")
        assert held_out["validate", "all"]["rmse"] == pytest.approx(
            held_out["validate", f"specimen={specimen}"]["rmse"]
        )
        assert left_out["validate", f"specimen={specimen}"]["rmse"] == pytest.approx(
            held_out["validate", "all"]["rmse"], rel=1e-9
        )
    assert (
        left_out["validate", "specimen=3"]["rmse"] > 2 * left_out["validate", "specimen=2"]["rmse"]
    )
    assert left_out["validate", "all"]["n"] == 9 * 40
