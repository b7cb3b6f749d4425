"""Specimens and sessions: scored by themselves, and each predicted as a run that holds it out predicts it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

SPEC = """\
name: specimens
data:
  files: [{path: "a_*.csv", set: {specimen: 1}}, {path: "b_*.csv", set: {specimen: 2}}, {path: "c_*.csv", set: {specimen: 3}}]
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
def campaign(tmp_path: Path) -> Path:
    """Three specimens at three pressures; the third pulls by a fifth more."""
    rng = np.random.default_rng(0)
    for name, factor in (("a", 1.0), ("b", 1.03), ("c", 1.2)):
        for level in (100, 200, 300):
            strain = np.linspace(0, 0.2, 40)
            force = factor * level * (2 - 8 * strain) + rng.normal(0, 0.5, 40)
            rows = [f"{level},{e:.6f},{f:.5f}" for e, f in zip(strain, force, strict=True)]
            (tmp_path / f"{name}_{level}.csv").write_text("\n".join(["P,eps,F", *rows]) + "\n")
    return tmp_path


def rows(mapmore: Callable[..., Any], folder: Path, split: str) -> dict[tuple[str, str], dict[str, Any]]:
    spec = folder / "specimens.yaml"
    spec.write_text(SPEC.replace("SPLIT", split))
    result = mapmore("validate", spec, "--runs", folder / "runs", "--json", "-q")
    assert result.exit_code == 0, result.stderr
    return {(row["split"], row["curve"]): row for row in json.loads(result.stdout)["scores"] if row["model"] == "mapmore"}


def test_each_group_is_scored_and_predicted_as_by_a_run_without_it(campaign: Path, mapmore: Callable[..., Any]) -> None:
    left_out = rows(mapmore, campaign, "  split: {leave_one_group_out: true}")
    for specimen in (1, 2, 3):
        held_out = rows(mapmore, campaign, f"  split: {{validate: {{specimen: [{specimen}]}}}}")
        assert held_out["validate", "all"]["rmse"] == pytest.approx(held_out["validate", f"specimen={specimen}"]["rmse"])
        assert left_out["validate", f"specimen={specimen}"]["rmse"] == pytest.approx(held_out["validate", "all"]["rmse"], rel=1e-9)
    assert left_out["validate", "specimen=3"]["rmse"] > 2 * left_out["validate", "specimen=2"]["rmse"]
    assert left_out["validate", "all"]["n"] == 9 * 40


@pytest.mark.parametrize(
    ("split", "told"),
    [
        ("  split: {leave_one_group_out: true, leave_one_level_out: true}", "choose one"),
        ("  split: {leave_one_group_out: true, validate: {specimen: [1]}}", "choose one"),
    ],
)
def test_contradictions_are_refused(split: str, told: str, campaign: Path, mapmore: Callable[..., Any]) -> None:
    spec = campaign / "specimens.yaml"
    spec.write_text(SPEC.replace("SPLIT", split))
    refused = mapmore("check", spec)
    assert (refused.exit_code, told in refused.stderr) == (3, True)
    spec.write_text(SPEC.replace("SPLIT", "").replace("groups: {of: specimen}", "groups: {of: session}"))
    refused = mapmore("check", spec)
    assert (refused.exit_code, "no recording has the quantity `session`" in refused.stderr) == (3, True)
