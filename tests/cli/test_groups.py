"""Specimens and sessions: scored by themselves, and each predicted as a run that holds it out
predicts it.
"""

import re

import numpy as np
import pytest
from cli_samples import scored_run, write_lines, write_recording

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Curve
from mapmore_cli.ingestion.curves import offsets_of
from mapmore_cli.storage.run_folder import RunFiles

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
    for name, factor in (("a", 1.0), ("b", 1.03), ("c", 1.2)):
        write(tmp_path, name, (0.0, 0.2), factor=factor)
    return tmp_path


@pytest.fixture
def sessions(tmp_path):
    """Two sessions whose load cells were zeroed apart: 8 N; each measured other strains, which
    overlap.
    """
    write(tmp_path, "a", (0.0, 0.15), offset=5.0)
    write(tmp_path, "b", (0.05, 0.2), offset=-3.0)
    return tmp_path


def write(folder, name, ends, factor=1.0, offset=0.0):
    rng, strain = np.random.default_rng(ord(name)), np.linspace(*ends, 40)
    for level in (100, 200, 300):
        force = factor * level * (2 - 8 * strain) + offset + rng.normal(0, 0.3, 40)
        write_recording(folder, name, level, strain, force)


def rows(document, folder, split):
    spec = folder / "specimens.yaml"
    spec.write_text(SPEC.replace("SPLIT", split))
    scores = document("validate", spec, "--runs", folder / "runs", "-q")["scores"]
    return {(row["split"], row["curve"]): row for row in scores if row["model"] == "mapmore"}


def test_each_group_is_scored_and_predicted_as_by_a_run_without_it(campaign, document):
    left_out = rows(document, campaign, "  split: {leave_one_group_out: true}")
    for specimen in (1, 2, 3):
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


def test_contradictions_are_refused(campaign, mapmore):
    spec = campaign / "specimens.yaml"
    for other in ("leave_one_level_out: true", "validate: {specimen: [1]}"):
        spec.write_text(SPEC.replace("SPLIT", f"  split: {{leave_one_group_out: true, {other}}}"))
        mapmore("check", spec, code=3, says="choose one")
    spec.write_text(
        SPEC.replace("SPLIT", "").replace("groups: {of: specimen}", "groups: {of: session}")
    )
    mapmore("check", spec, code=3, says="no recording has the quantity `session`")


def of_sessions(folder, split, groups):
    spec = folder / "sessions.yaml"
    files = '[{path: "a_*.csv", set: {specimen: 1}}, {path: "b_*.csv", set: {specimen: 2}}]'
    lines = SPEC.replace("SPLIT", split).replace("groups: {of: specimen}", groups).splitlines()
    write_lines(spec, *lines[:2], f"  files: {files}", *lines[4:])
    return spec


def test_offsets_of_sessions_are_taken_off_and_told(sessions, mapmore):
    errors = {}
    for groups in ("groups: {of: specimen}", "groups: {of: specimen, offset: true}"):
        spec = of_sessions(sessions, "  split: {validate: {pressure: [200]}}", groups)
        errors[groups] = scored_run(mapmore, spec)[0]["mapmore"]
    assert max(errors.values()) > 2 > 0.5 > min(errors.values())
    (note,) = (
        note
        for note in RunFiles(sessions / "runs" / "specimens").dataset().notes
        if note.startswith("offsets")
    )
    told = [float(text) for text in re.findall(r": ([+-][\d.]+)", note)]
    assert told == pytest.approx([4.0, -4.0], abs=0.2)
    assert "[N] taken off force" in note


def test_a_group_without_training_samples_has_no_offset(sessions, mapmore):
    groups, runs = "groups: {of: specimen, offset: true}", sessions / "runs"
    spec = of_sessions(sessions, "  split: {leave_one_group_out: true}", groups)
    mapmore("validate", spec, "--runs", runs, "-q", code=3, says="left out is not known")
    of_sessions(sessions, "  split: {validate: {specimen: [2]}}", groups)
    mapmore("validate", spec, "--runs", runs, "-q", code=0)
    assert any(
        "none is known of 2" in note for note in RunFiles(runs / "specimens").dataset().notes
    )


def test_offsets_do_not_depend_on_held_out_outputs_and_move_with_the_target():
    rng = np.random.default_rng(2)
    x, group, out = rng.uniform(-1, 1, 300), np.repeat([1.0, 2.0, 5.0], 100), rng.random(300) < 0.3
    y = np.exp(x) + np.select([group == 1, group == 2], [1.0, -2.0], 0.0)

    def found(target):
        return offsets_of(
            [Curve("all", None, {"x": x, "g": group, "y": target}, out, ("a",))], "g", "y"
        ).by_group

    of = found(y)
    assert [of[1.0] - of[5.0], of[2.0] - of[5.0], sum(of.values())] == pytest.approx(
        [1.0, -2.0, 0.0], abs=0.02
    )
    assert found(np.where(out, rng.normal(size=300), y)) == of
    assert found(3 * y + 7) == pytest.approx({value: 3 * offset for value, offset in of.items()})


def test_what_goes_with_the_group_is_no_offset():
    group = np.repeat([1.0, 2.0], 50)
    # varies within a group, and tells nothing
    x = np.where(group == 1, 0.0, 1.0) + np.tile(np.linspace(0, 1e-9, 50), 2)
    with pytest.raises(DataError, match="cannot be told"):
        offsets_of(
            [Curve("all", None, {"x": x, "g": group, "y": x}, np.zeros(100, dtype=bool), ("a",))],
            "g",
            "y",
        )
