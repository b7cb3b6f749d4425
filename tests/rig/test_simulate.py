"""`simulate`: the committed recordings regenerate, files are whole, bad specs are refused."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
import pytest
import yaml
from pydantic import ValidationError

from mapmore_cli.domain.errors import WriteError
from mapmore_cli.spec.loader import load_as
from mapmore_cli.spec.simulated_experiments import pressure_label
from mapmore_cli.spec.simulation import SimulationSpec
from mapmore_cli.study.simulate import csv_text, decimals, recording, sensors, simulate

DATASETS = Path(__file__).parents[2] / "datasets"
DOCUMENTS = {kind: yaml.safe_load((DATASETS / kind / "load_cycles.yaml").read_text("utf-8")) for kind in ("mckibben", "peano")}
SPECS = {kind: SimulationSpec.model_validate(document) for kind, document in DOCUMENTS.items()}
WET = {
    (kind, experiment): SimulationSpec.model_validate(yaml.safe_load((DATASETS / kind / f"{experiment}.yaml").read_text("utf-8")))
    for kind in SPECS
    for experiment in ("step_responses", "perturbations")
}
INNER = {
    (kind, use): load_as(DATASETS / kind / f"inner_loops_{use}.yaml", SimulationSpec).spec
    for kind in SPECS
    for use in ("training", "validation")
}
shipped = pytest.mark.parametrize("kind", list(SPECS))


def silent(what, done, total):
    pass


def changed(kind="peano", **experiment):
    document = copy.deepcopy(DOCUMENTS[kind])
    document["experiment"].update(experiment)
    return SimulationSpec.model_validate(document)


def assert_regenerated(made, committed, spec, most_flips):
    """Another machine's libm may round a value to the neighbouring step: a few may differ, each by one step."""
    if made == committed:
        return
    ours, theirs = (np.loadtxt(text.decode().splitlines()[1:], delimiter=",") for text in (made, committed))
    steps = [spec.experiment.sample_time, *(sensor.resolution for sensor in sensors(spec).values())]
    flips = np.abs(np.round((ours - theirs) / steps))
    assert flips.max() <= 1
    assert flips.mean() < most_flips


@shipped
def test_the_committed_recordings_regenerate(kind, tmp_path):
    for path in simulate(SPECS[kind], tmp_path, silent):
        assert_regenerated(path.read_bytes(), (DATASETS / kind / path.name).read_bytes(), SPECS[kind], 1e-3)


@pytest.mark.parametrize(("kind", "experiment", "pressure"), [("mckibben", "step_responses", 150.0), ("peano", "perturbations", 80.0)])
def test_committed_wet_recordings_regenerate(kind, experiment, pressure):
    spec = WET[kind, experiment]
    made = csv_text(recording(spec, pressure), decimals(spec)).encode()
    committed = (DATASETS / kind / f"{spec.output}_{pressure_label(pressure)}.csv").read_bytes()
    assert made.startswith(b"t,P,eps,F,Q,Pm\n0.000,")
    assert_regenerated(made, committed, spec, 1e-2)


@pytest.mark.parametrize(("kind", "use"), list(INNER))
def test_committed_inner_loops_regenerate(kind, use, tmp_path):
    paths = simulate(INNER[kind, use], tmp_path, silent)
    assert {path.name for path in paths} == {path.name for path in (DATASETS / kind).glob(f"inner_loops_{use}_*.csv")}
    for path in paths:
        assert_regenerated(path.read_bytes(), (DATASETS / kind / path.name).read_bytes(), INNER[kind, use], 1e-3)


def test_the_steps_are_those_of_the_paper():
    """M2 table 3."""
    weights = [42, 66, 115, 213]
    for kind, pressures in (("mckibben", [80, 150, 250, 350]), ("peano", [80, 200, 350, 500])):
        steps = WET[kind, "step_responses"].experiment.steps
        assert [(step.pressure, step.weight) for step in steps] == list(zip(pressures, weights, strict=True))


def test_another_pressure_leaves_the_others_as_they_were(tmp_path):
    few, more = changed(pressures=[80.0, 200.0]), changed(pressures=[120.0, 200.0, 80.0])
    simulate(few, tmp_path / "few", silent)
    simulate(more, tmp_path / "more", silent)
    for name in ("load_cycle_080.csv", "load_cycle_200.csv"):
        assert (tmp_path / "few" / name).read_bytes() == (tmp_path / "more" / name).read_bytes()


def test_another_seed_changes_the_noise_only():
    spec = changed()
    one, two = (recording(spec.model_copy(update={"seed": seed}), 200.0) for seed in (1, 2))
    assert not np.array_equal(one["force"], two["force"])
    assert np.abs(one["force"] - two["force"]).max() < 0.05 * one["force"].max()
    np.testing.assert_allclose(one["strain"], two["strain"], atol=3e-4)


def test_columns_have_the_digits_of_their_steps():
    assert decimals(SPECS["mckibben"]) == {"time": 2, "pressure": 1, "strain": 5, "force": 1}
    columns = {"time": np.array([0.02]), "pressure": np.array([80.1]), "strain": np.array([0.00011]), "force": np.array([0.0])}
    assert csv_text(columns, decimals(SPECS["mckibben"])) == "t,P,eps,F\n0.02,80.1,0.00011,0.0\n"


def test_progress_is_reported_for_each_recording(tmp_path):
    seen = []
    simulate(changed(pressures=[80.0, 82.5], duration=10.0, sample_time=0.1), tmp_path, lambda *step: seen.append(step))
    assert seen == [("simulate", 1, 2), ("simulate", 2, 2)]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["load_cycle_080.csv", "load_cycle_82.5.csv"]


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    spec = changed(pressures=[80.0], duration=10.0, sample_time=0.1)
    (tmp_path / "load_cycle_080.csv").write_text("old")

    def full(self, target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(WriteError, match=r"cannot be written.*No space left"):
        simulate(spec, tmp_path, silent, force=True)
    assert [path.name for path in tmp_path.iterdir()] == ["load_cycle_080.csv"]
    assert (tmp_path / "load_cycle_080.csv").read_text() == "old"


def test_a_file_in_place_of_the_folder_is_refused(tmp_path):
    (tmp_path / "taken").write_text("")
    with pytest.raises(WriteError, match="taken"):
        simulate(changed(duration=10.0, sample_time=0.1), tmp_path / "taken", silent)


@pytest.mark.parametrize(
    ("where", "value", "message"),
    [
        (("experiment", "pressures"), [80, 80], "name it once"),
        (("experiment", "pressures"), [], "at least 1"),
        (("experiment", "pressures"), [-5], "greater than or equal to 0"),
        (("experiment", "pressures"), ["80 kPa"], "valid number"),
        (("experiment", "dwell"), 20, "no time to move"),
        (("experiment", "turns"), [1, 0.5, 0.5], "must move from each of `turns`"),
        (("experiment", "turns"), [1, 0], "must move from each of `turns`"),
        (("experiment", "turns"), [1.1], "less than or equal to 1"),
        (("experiment", "turns"), [], "at least 1"),
        (("experiment", "sample_time"), 5, "fewer than 100 samples"),
        (("experiment", "colour"), "red", "not permitted"),
        (("hysteresis", "stops"), [{"yield_strain": 0.01, "share": 0.9}], "add up to 1"),
        (("sensors", "force", "resolution"), 0, "greater than 0"),
        (("muscle", "kind"), "bellows", "kind"),
        (("output",), "../elsewhere", "pattern"),
        (("seed",), 1.5, "integer"),
    ],
)
def test_a_bad_spec_is_refused(where, value, message):
    document = copy.deepcopy(DOCUMENTS["peano"])
    part = document
    for key in where[:-1]:
        part = part[key]
    part[where[-1]] = value
    with pytest.raises(ValidationError, match=message):
        SimulationSpec.model_validate(document)


@pytest.mark.parametrize(
    ("experiment", "where", "value", "message"),
    [
        ("step_responses", ("experiment", "steps", 1, "pressure"), 80, "name it once"),
        ("step_responses", ("experiment", "steps", 1, "pressure"), 0, "greater than 0"),
        ("step_responses", ("experiment", "steps", 1, "weight"), 0.5, "exceed the `pretension`"),
        ("step_responses", ("experiment", "rest"), 0.005, "ten samples"),
        ("step_responses", ("experiment", "rig", "tube", "diameter"), -1, "greater than 0"),
        ("step_responses", ("experiment", "reservoir", "critical_ratio"), 1.0, "less than 0.99"),
        ("step_responses", ("sensors", "flow"), None, r"sensors\.flow"),
        ("perturbations", ("experiment", "between"), [0.8, 0.2], "stretched end first"),
        ("perturbations", ("experiment", "between"), [0.8], "Field required"),
        ("perturbations", ("experiment", "moves"), [], "at least 1"),
        ("perturbations", ("experiment", "moves"), [0.5, 0.001], "ten samples"),
        ("perturbations", ("experiment", "pressures"), [80, 80.0], "name it once"),
        ("perturbations", ("experiment", "type"), "vibration", "type"),
    ],
)
def test_a_bad_wet_spec_is_refused(experiment, where, value, message):
    document = yaml.safe_load((DATASETS / "peano" / f"{experiment}.yaml").read_text("utf-8"))
    part = document
    for key in where[:-1]:
        part = part[key]
    part[where[-1]] = value
    with pytest.raises(ValidationError, match=message):
        SimulationSpec.model_validate(document)


def test_a_dry_experiment_has_no_water_sensors():
    document = copy.deepcopy(DOCUMENTS["peano"])
    document["sensors"]["flow"] = {"noise": 0.02, "resolution": 0.01}
    with pytest.raises(ValidationError, match="with these only"):
        SimulationSpec.model_validate(document)
