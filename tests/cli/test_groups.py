"""Specimens and sessions: scored by themselves, and each predicted as a run that holds it out
predicts it.
"""

import numpy as np
import pytest
from cli_samples import write_lines, write_recording
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Curve, Grouping
from mapmore_cli.fitting.groups import (
    GroupEffects,
    _GroupFit,
    _polynomial,
    _require_apart,
    group_effects,
)
from mapmore_cli.pipeline.example import write_example
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


GROUP = np.repeat([1.0, 2.0, 5.0], 100)
GAINS = {1.0: 1.25, 2.0: 1.0, 5.0: 0.8}


def effects(y, out=None, group=GROUP, x=None, **asked):
    x = np.random.default_rng(2).uniform(-1, 1, len(y)) if x is None else x
    out = np.zeros(len(y), dtype=bool) if out is None else out
    curve = Curve("all", None, {"x": x, "g": group, "y": y}, out, ("a",))
    return group_effects([curve], Grouping("y", "g", **asked))


def of_groups(noise=0.0, offsets=(1.0, -2.0, 1.0)):
    """A curve of x in three groups, with their gains and offsets."""
    x, rng = np.random.default_rng(2).uniform(-1, 1, 300), np.random.default_rng(3)
    gain = np.repeat([*GAINS.values()], 100)
    return gain * (2 + np.exp(x)) + np.repeat(offsets, 100) + rng.normal(0, noise, 300)


@given(st.floats(1e-3, 1e3), st.floats(-50, 50), st.sampled_from([0.0, 0.01, 0.1]))
@settings(max_examples=20)
def test_gains_are_found_and_do_not_depend_on_the_unit(unit, zero, noise):
    y = of_groups(noise)
    of = effects(y, gain=True, offset=True)
    assert of.gains == pytest.approx(GAINS, rel=0.005 + noise)
    assert effects(unit * (y + zero), gain=True, offset=True).gains == pytest.approx(
        of.gains, rel=1e-4
    )
    alone = effects(of_groups(noise, (0, 0, 0)), gain=True)
    assert (alone.gains, alone.offsets) == (pytest.approx(GAINS, rel=0.005 + noise), {})


def test_effects_are_taken_off_and_told():
    columns = {"g": np.array([1.0, 2.0, 5.0]), "y": np.array([5.0, 7.0, 9.0])}
    curve = Curve("all", None, columns, np.zeros(3, dtype=bool), ("a",))
    of = GroupEffects("g", {1.0: 2.0}, {1.0: 3.0, 2.0: -3.0}, (5.0,))
    assert of.removed_from(curve, "y").columns["y"].tolist() == [1.0, 10.0, 9.0]
    assert curve.columns["y"].tolist() == [5.0, 7.0, 9.0]
    assert list(of.describe("y", "N")) == [
        "gains of g, by which y is divided: 1: 2; 5 is held out completely and gets a gain of 1",
        "offsets of g [N], which are subtracted from y: 1: +3, 2: -3; "
        "for 5, which is held out completely, the offset is not known",
    ]


def test_a_group_without_training_samples_has_no_effects():
    of = effects(of_groups(), GROUP == 5, offset=True, gain=True)
    assert (of.unknown, [*of.gains], [*of.offsets]) == ((5.0,), [1.0, 2.0], [1.0, 2.0])


def test_gains_that_nothing_tells_are_near_one():
    """Noise of ten times the signal, and one sample of a group."""
    some = np.append(np.arange(200), 299)
    x = np.random.default_rng(2).uniform(-1, 1, 300)[some]
    gains = effects(of_groups(30.0)[some], group=GROUP[some], x=x, gain=True).gains
    assert all(0.7 < gain < 1.4 for gain in gains.values()), gains


def test_effects_do_not_depend_on_held_out_outputs_and_move_with_the_target():
    rng = np.random.default_rng(2)
    out, y = rng.random(300) < 0.3, of_groups()
    for asked in ({"offset": True}, {"offset": True, "gain": True}):
        of = effects(y, out, **asked)
        assert effects(np.where(out, rng.normal(size=300), y), out, **asked) == of
        moved = effects(3 * y + 7, out, offset=True).offsets
        assert moved == pytest.approx(
            {value: 3 * offset for value, offset in effects(y, out, offset=True).offsets.items()}
        )
    equal = effects(of_groups() / np.repeat([*GAINS.values()], 100), out, offset=True).offsets
    assert sum(equal.values()) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(
    ("target", "factor", "derived"),
    [
        ("static", 1.0, {}),
        ("hysteresis", 1.02, {}),
        ("static", 1.02, {"half": "0.5*force", "part": "half + 30*sin(20*strain)"}),
    ],
)
def test_groups_are_not_compared_at_equal_outputs(tmp_path, mapmore, target, factor, derived):
    """The hysteresis of a cycle is computed from the force, so it has the gain of its group. Both
    campaigns of the example measured one simulated muscle; the forces of the second are scaled.
    """
    spec, *_ = write_example(tmp_path / "muscle")
    for log in sorted((tmp_path / "muscle" / "autumn").iterdir()):
        title, *lines = log.read_text().splitlines()
        samples = np.loadtxt(lines, delimiter=",")
        samples[:, 3] *= factor
        np.savetxt(log, samples, "%.6f", ",", header=title, comments="")
    both = spec.with_name("both.yaml")
    write_lines(
        both,
        "extends: study.yaml",
        f"target: {target}",
        f"units: {dict.fromkeys(derived, 'N')}",
        "data:",
        f"  derive: {derived}",
        "  files:",
        "    - {path: load_cycle_*.csv, set: {session: 1}}",
        "    - {path: autumn/load_cycle_*.csv, set: {session: 2}}",
        "  groups: {of: session, gain: true}",
        "validate: null",
        "report: null",
    )
    mapmore("ingest", both, "--runs", tmp_path / "runs", "-q", code=0)
    notes = RunFiles(tmp_path / "runs" / "muscle").dataset().notes
    (note,) = (each for each in notes if each.startswith("gains"))
    first, second = (float(part.rpartition(": ")[2]) for part in note.split(", ")[-2:])
    assert second / first == pytest.approx(factor, abs=0.003 if target == "static" else 0.01)


def test_another_output_is_not_an_input_of_the_groups():
    y, x = of_groups(0.1), np.random.default_rng(2).uniform(-1, 1, 300)
    columns = {"x": x, "g": GROUP, "y": y}
    out = np.zeros(300, dtype=bool)
    curves = [Curve("all", None, each, out, ("a",)) for each in (columns, columns | {"z": 2 * y})]
    alone = group_effects(curves[:1], Grouping("y", "g", gain=True))
    assert group_effects(curves[1:], Grouping("y", "g", gain=True, outputs=("y", "z"))) == alone


def test_groups_share_a_polynomial_of_order_three():
    x, y = np.array([0.0, 1.0, 4.0]), np.array([5.0, 5.0, 9.0])
    a, b = np.array([-1, -0.5, 1]), np.array([-1.0, -1, 1])
    one = np.ones(3)
    quadratic, cubic = [a * a, a * b, b * b], [a**3, a * a * b, a * b * b, b**3]
    expected = np.stack([one, a, b, *quadratic, *cubic], axis=1)
    np.testing.assert_allclose(_polynomial([x, y], 3), expected)


def test_residuals_are_as_large_as_those_of_a_line_for_each_group():
    rng, squares, tables = np.random.default_rng(0), 0.0, []
    for size in (5, 9):
        x, y = rng.normal(size=(2, size))
        line = np.column_stack([x, np.ones(size)])
        squares += float(np.linalg.lstsq(line, y, rcond=None)[1][0])
        tables.append(np.column_stack([line, y]))
    found = _GroupFit([*tables, tables[0][:2]], np.eye(3), offset=False)  # a group of two samples
    assert found.scatter == pytest.approx(np.sqrt(squares / (5 - 2 + 9 - 2)))


def test_what_goes_with_the_group_is_no_offset():
    group = np.repeat([1.0, 2.0], 50)
    # varies within a group, and tells nothing
    x = np.where(group == 1, 0.0, 1.0) + np.tile(np.linspace(0, 1e-9, 50), 2)
    with pytest.raises(DataError, match="cannot be separated"):
        effects(x, group=group, x=x, offset=True)


@pytest.mark.parametrize(("left", "told_apart"), [(3e-6, True), (3e-7, False)])
def test_an_offset_needs_a_millionth_of_its_own(left, told_apart):
    """Of the indicator of a group, what the polynomial of the inputs leaves."""
    common, coded = np.array([[1.0], [0.0]]), np.array([[np.sqrt(1 - left**2)], [left]])
    if told_apart:
        _require_apart(common, coded, "muscle", ["pressure"])
    else:
        with pytest.raises(DataError, match="cannot be separated from the effects of pressure"):
            _require_apart(common, coded, "muscle", ["pressure"])
