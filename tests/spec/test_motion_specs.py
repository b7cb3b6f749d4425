"""Specs of damping and dynamic studies: the contract's example, its defaults, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest
from spec_examples import load_text, refusal

from mapmore_cli.fitting.kinds.dictionary import signals_of, units_of
from mapmore_cli.fitting.kinds.pieces import recipe_of
from mapmore_cli.modelling.pieces.recipe import CutByDirection

DAMPING = """\
schema_version: 1
name: dmsp-20-88-damping
needs: {static: dmsp-20-88-static.yaml}
data:
  files: ["../datasets/mckibben/step_response_*.csv"]
  reader: csv
  columns: {time: {column: t, unit: s}, pressure: {column: P, unit: kPa}, strain: {column: eps}, force: {column: F, unit: N}}
  derive: {strain_rate: {rate_of: strain, window: 40 ms, order: 3}, pressure_rate: {rate_of: pressure, window: 40 ms, order: 3}}
  plateau: auto
  levels: {of: step_pressure, at: [80, 150, 250, 350]}    # the pressure on the plateau of each recording
  split: {validate: {step_pressure: [250]}}
target: damping
segment: {direction: {of: pressure_rate, dead_band: 5 kPa/s}, step_pressure: none}    # none | levels
dictionary:
  - polynomial: {of: [strain, strain_rate, pressure, pressure_rate], order: 2, constant: false}
fit: {max_terms: 1, train_level: highest}
validate: {against: [none, linear_viscous, reynolds, peternel, {static: sarosi, damping: reynolds}]}
"""
DYNAMIC = DAMPING.replace("target: damping", "target: dynamic").replace(
    "needs: {static: dmsp-20-88-static.yaml}", "needs: {static: s.yaml, damping: d.yaml}"
)
DYNAMIC = DYNAMIC[: DYNAMIC.index("dictionary")] + DYNAMIC[DYNAMIC.index("validate: {against") :]


def test_the_damping_example_loads_and_resolves_to_itself(tmp_path: Path) -> None:
    loaded = load_text(tmp_path, DAMPING)
    assert loaded.spec.fit.scaling == "max_abs"
    assert loaded.spec.segment["direction"] == CutByDirection(of="pressure_rate", dead_band=5.0)
    assert loaded.spec.validation.against[-1].label == "sarosi+reynolds"  # type: ignore[union-attr]
    assert load_text(tmp_path, loaded.resolved).spec == loaded.spec
    assert units_of(loaded.spec)["step_pressure"] == "kPa"
    assert [signal.name for signal in signals_of(loaded.spec)] == ["strain_rate", "pressure_rate", "direction"]


def test_numbers_of_motion_carry_units(tmp_path: Path) -> None:
    text = DAMPING.replace("5 kPa/s", "0.05 bar/s").replace("plateau: auto", "plateau: [900 ms, 2 s]").replace("highest", "3.5 bar")
    spec = load_text(tmp_path, text.replace("[80, 150, 250, 350]", "[0.8 bar, 150, 250, 350]")).spec
    assert spec.segment["direction"] == CutByDirection(of="pressure_rate", dead_band=5.0)
    assert spec.data.plateau == (0.9, 2.0)
    assert spec.fit.train_level == 350
    assert spec.data.levels is not None
    assert spec.data.levels.at == [80, 150, 250, 350]


def test_a_sum_is_the_default_of_a_dynamic_target_without_a_dictionary(tmp_path: Path) -> None:
    assert load_text(tmp_path, DYNAMIC).spec.model.type == "sum"
    direct = DAMPING.replace("target: damping", "target: dynamic")
    assert load_text(tmp_path, direct).spec.model.type == "mapmore"


def test_weights_between_step_pressures_go_by_the_pressure(tmp_path: Path) -> None:
    spec = load_text(tmp_path, DAMPING.replace("step_pressure: none}", "step_pressure: levels}")).spec
    assert recipe_of("damping", spec.data.levels, spec.segment, spec.dictionary, spec.fit, spec.fuse).level == "pressure"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("needs: {static: dmsp-20-88-static.yaml}\n", "", "target `damping` needs a static model"),
        ("  plateau: auto\n", "", "target `damping` needs the plateau of each step response"),
        ("plateau: auto", "plateau: [3 s, 2 s]", "the plateau runs from 3 s to 2 s"),
        ("plateau: auto", "plateau: automatic", "did you mean `auto`"),
        ("dead_band: 5 kPa/s", "dead_band: 5 kPa", "cannot be converted to 'kPa/s'"),
        ("dead_band: 5 kPa/s", "dead_band: 0", "greater than 0"),
        ("direction: {of", "way: {of", "call it `direction`"),
        ("pressure_rate, dead_band: 5 kPa/s", "pressure_rat, dead_band: 5", "did you mean `pressure_rate`"),
        ("train_level: highest", "train_level: 300", "300 is no level of `step_pressure`"),
        ("train_level: highest", "train_level: lowest", "`fit.train_level` cannot be the text 'lowest'"),
        ("{static: sarosi, damping: reynolds}", "{static: sarosi}", "a composite needs `static` and `damping`"),
        ("{static: sarosi, damping: reynolds}", "{static: sarosy, damping: reynolds}", "did you mean `sarosi`"),
        ("{static: sarosi, damping: reynolds}", "{static: sarosi, damping: reynolds, model: sarosi}", "a competitor is a `model`"),
        ("peternel,", "sarosi_hysteresis_loss,", "needs the length of the muscle"),
        ("peternel,", "sarosi_hysteresis_loss,", "needs the quantity `load`"),
        ("peternel,", "cao, peternels,", "did you mean `peternel`"),
        ("time: {column: t, unit: s}, ", "", "`plateau` needs the quantity `time`"),
        ("target: damping", "target: damping\nmodel: {type: sum}", "the sum of two models needs `needs.damping`"),
        ("of: [strain, ", "of: [force, ", "`force` is the target"),
    ],
)
def test_what_a_damping_study_lacks_is_said(old: str, new: str, words: str, tmp_path: Path) -> None:
    assert old in DAMPING
    message = refusal(tmp_path, DAMPING.replace(old, new))
    assert words in message
    assert "spec.yaml:" in message


def test_composites_belong_to_motion(tmp_path: Path) -> None:
    text = DAMPING.replace("target: damping", "target: static")
    assert "target `static` has no static and damping parts" in refusal(tmp_path, text)


def test_a_load_cycle_formula_is_no_model_of_its_own(tmp_path: Path) -> None:
    text = DAMPING.replace("target: damping", "target: damping\nmodel: {type: literature, name: sarosi_hysteresis_loss}")
    assert "is fitted to load cycles, not to a target" in refusal(tmp_path, text)
    nothing = DAMPING.replace("target: damping", "target: damping\nmodel: {type: literature, name: none}")
    assert "`none` is no function of anything" in refusal(tmp_path, nothing)
