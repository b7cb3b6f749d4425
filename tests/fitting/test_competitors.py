"""Competitors, fitted to the training samples of a study and asked for every sample."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from common import dataset_of
from surfaces import QUANTITIES

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.models import Formula, Model
from mapmore_cli.domain.recording import DAMPING, STATIC_FORCE, Curve, CurveRange, Dataset, Quantity
from mapmore_cli.domain.results import FitResult
from mapmore_cli.fitting import competitors
from mapmore_cli.fitting.competitors import Contest, Rival
from mapmore_cli.fitting.kinds.choices import metres_of
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.literature.backbone import fit_formula
from mapmore_cli.storage.artefacts import write_dataset, write_fit, write_model
from mapmore_cli.study.sections.results import Competitor


def curve(level, *, held):
    strain = np.linspace(0, 0.2, 40)
    pressure = np.full(40, level)
    force = 2 * level * (1 - 3 * strain) - 40 + 300 * strain**2
    return Curve(
        f"p={level:g}",
        level,
        {"pressure": pressure, "strain": strain, "force": force},
        np.full(40, held),
        (f"log {level:g}",),
    )


DATASET = Dataset(
    "force",
    "pressure",
    QUANTITIES,
    (),
    tuple(curve(level, held=level == 200) for level in (100.0, 200.0, 300.0, 400.0)),
)


def model_of(name, dataset=DATASET, **changes):
    fit = fit_formula(name, dataset.curves, "force")
    ranges = (CurveRange("all", None, {"pressure": (100.0, 400.0), "strain": (0.0, 0.2)}),)
    inputs = (QUANTITIES["pressure"], QUANTITIES["strain"])
    return replace(Model(name, QUANTITIES["force"], inputs, Formula(fit, None, ranges)), **changes)


def contest(**changes):
    lengths = {"length": None, "diameter": None}
    plain = Contest(
        dataset=DATASET,
        model=model_of("polynomial_2"),
        needed={},
        static_run=None,
        lengths=lengths,
        spec_dir=Path(),
    )
    return replace(plain, **changes)


def test_a_formula_is_fitted_to_the_training_samples_alone():
    rival = contest().rival("sarosi")
    training = replace(
        DATASET, curves=tuple(one for one in DATASET.curves if not one.held_out.any())
    )
    fit = fit_formula("sarosi", training.curves, "force")
    assert rival.formulas["sarosi"].parameters == fit.parameters
    for one, said in zip(DATASET.curves, rival.forecasts, strict=True):
        np.testing.assert_array_equal(
            said.values, literature.get("sarosi").predict(fit.parameters, one.columns)
        )
        assert said.ready.all()


def test_a_competitor_has_the_name_that_it_is_given():
    named = contest().rival(
        Competitor(model="sarosi", **{"as": "by_simplex"}, method="levenberg_marquardt")
    )
    assert named.name == "by_simplex"
    assert list(named.formulas) == ["by_simplex"]
    assert named.formulas["by_simplex"].method == "levenberg_marquardt"


def of_run(tmp_path, model):
    write_model(tmp_path / "model.h5", model)
    write_fit(tmp_path / "fit.h5", FitResult(model.body.fit))
    return contest(needed={"other.yaml": tmp_path})


def test_another_run_is_asked_as_it_is(tmp_path):
    other = model_of("polynomial_2")
    rival = of_run(tmp_path, other).rival(Competitor(run="other.yaml"))
    assert rival.name == "other"
    own = [
        literature.get("polynomial_2").predict(other.body.fit.parameters, one.columns)
        for one in DATASET.curves
    ]
    for said, wanted in zip(rival.forecasts, own, strict=True):
        np.testing.assert_allclose(said.values, wanted, rtol=1e-12)


def test_a_run_of_other_units_is_refused(tmp_path):
    other = model_of("polynomial_2", inputs=(Quantity("pressure", "bar"), QUANTITIES["strain"]))
    with pytest.raises(SpecError, match=r"other quantities or units \(pressure\)"):
        of_run(tmp_path, other).rival(Competitor(run="other.yaml"))


def test_a_frozen_model_and_the_backbone_are_asked_as_they_are(tmp_path):
    frozen = model_of("polynomial_2")
    write_model(tmp_path / "old.h5", frozen)
    asked = Competitor.model_validate({"model": "old.h5", "as": "before"})
    before = contest(spec_dir=tmp_path).rival(asked)
    backbone = contest(model=frozen).rival("backbone")
    assert (before.name, backbone.name, before.failed) == ("before", "backbone", False)
    for one, *said in zip(DATASET.curves, before.forecasts, backbone.forecasts, strict=True):
        for forecast in said:
            np.testing.assert_allclose(forecast.values, predict(frozen, one.columns), rtol=1e-12)


def test_in_a_fold_another_run_is_made_anew(tmp_path):
    asked = []

    def refit(folder, dataset):
        asked.append((folder, dataset))
        return model_of("sarosi", dataset)

    rival = replace(of_run(tmp_path, model_of("polynomial_2")), refit=refit).rival(
        Competitor(run="other.yaml")
    )
    assert asked == [(tmp_path, DATASET)]
    np.testing.assert_allclose(
        rival.forecasts[0].values, contest().rival("sarosi").forecasts[0].values
    )


def test_a_competitor_fails_with_any_of_its_formulas():
    fit = fit_formula("polynomial_2", DATASET.curves, "force")
    both = {"static": fit, "damping": replace(fit, status="failed")}
    assert Rival("a", (), both).failed
    assert not Rival("a", (), {"static": fit}).failed


def test_composites_need_a_static_run():
    with pytest.raises(SpecError, match="data of a static run"):
        contest().rival(Competitor(static="sarosi", damping="reynolds"))


def test_at_nominal_levels_a_formula_is_fitted_and_scored_there():
    """Measured pressures scatter; the two readings differ, and each fits its own inputs."""
    rng = np.random.default_rng(0)
    scattered = [
        replace(one, columns={**one.columns, "pressure": one.level + rng.normal(0, 2, 40)})
        for one in DATASET.curves
    ]
    data = replace(DATASET, curves=tuple(scattered))
    nominal = Competitor.model_validate(
        {"model": "polynomial_2", "levels": "nominal", "as": "at_levels"}
    )
    one = contest(dataset=data).rival(nominal)
    other = contest().rival("polynomial_2")  # of curves without scatter
    assert one.name == "at_levels"
    for said, exact in zip(one.forecasts, other.forecasts, strict=True):
        np.testing.assert_array_equal(said.values, exact.values)
    measured = contest(dataset=data).rival("polynomial_2")
    assert not np.allclose(measured.forecasts[0].values, one.forecasts[0].values, atol=0.1)


@pytest.mark.parametrize("name", ["sarosi", "plane", "quadratic", "cubic"])
def test_a_competitor_is_a_model_of_the_same_numbers(name):
    """What its page prints and computes is what was scored."""
    rival = contest().rival(name)
    assert rival.model.output == QUANTITIES["force"]
    for curve, output in zip(DATASET.curves, rival.forecasts, strict=True):
        np.testing.assert_allclose(predict(rival.model, curve.columns), output.values, rtol=1e-9)


def test_an_arx_is_scored_from_rest_and_its_page_says_so():
    """Its model begins with two measured outputs, and both runs agree once these are forgotten."""
    pressure, force = np.random.default_rng(3).normal(size=200), np.zeros(200)
    for k in range(2, 200):
        force[k] = 0.1 + 1.2 * force[k - 1] - 0.5 * force[k - 2] + 0.3 * pressure[k - 1]
    columns = {"time": 0.1 * np.arange(200), "pressure": pressure, "strain": 0 * force}
    made = dataset_of({**columns, "force": force}, output="force")
    rival = contest(dataset=made).rival("arx")
    (scored,), by_model = rival.forecasts, predict(rival.model, made.curves[0].columns)
    assert np.isfinite(scored.values).all()
    assert abs(scored.values[2] - force[2]) > 0.01  # at rest, not from what was measured
    np.testing.assert_allclose(by_model[80:], scored.values[80:], atol=1e-9)
    assert "begins at rest" in " ".join(rival.model.notes)


def test_a_black_box_is_no_model():
    pytest.importorskip("sklearn")
    assert contest().rival("gaussian_process").model is None


@pytest.mark.parametrize(
    ("unit", "metres"), [("mm", 1e-3), ("m", 1.0), ("kPa", 1.0), ("cm^2", 1.0)]
)
def test_the_size_of_a_specimen_is_in_metres_if_it_is_a_length(unit, metres):
    assert metres_of(unit) == metres


@pytest.mark.parametrize(("samples", "count"), [(3, 0), (4, 1), (6, 1), (7, 2), (10, 2), (11, 3)])
def test_simple_models_beside_have_fewer_parameters_than_samples(samples, count):
    one = replace(DATASET.curves[0], held_out=np.arange(40) >= samples)
    beside = contest(dataset=replace(DATASET, curves=(one,))).simple_beside(())
    assert beside == ("plane", "quadratic", "cubic")[:count]


def test_a_backbone_and_an_arx_stand_beside_models_that_have_them(monkeypatch):
    formula = model_of("sarosi").body.fit
    pieces = contest(model=model_of("sarosi", body=SimpleNamespace(backbone=formula)))
    for moves, more in ((False, ["backbone"]), (True, ["backbone", "arx"])):
        monkeypatch.setattr(competitors, "runs_over_time", lambda _, moves=moves: moves)
        assert pieces.simple_beside(["plane"]) == ("quadratic", "cubic", *more)
    assert pieces.simple_beside(["sarosi", "arx"]) == ("plane", "quadratic", "cubic")


@pytest.mark.parametrize("target", ["force", DAMPING])
def test_a_composite_adds_damping_without_what_is_left_at_rest(tmp_path, target):
    """The static part misses 30 N, which is no damping."""
    static, resting = model_of("polynomial_2"), np.arange(60) >= 40
    write_model(tmp_path / "model.h5", static)
    write_dataset(tmp_path / "ingest.h5", DATASET)
    rate = np.where(resting, 0.0, 1 + np.sin(np.arange(60)))
    columns = {"pressure": np.linspace(100, 300, 60), "strain": 0.1 + 0 * rate, "strain_rate": rate}
    held = predict(static, columns)
    columns |= {"force": held + 30 + 5 * rate, STATIC_FORCE: held + 30, DAMPING: 5 * rate}
    made = dataset_of(columns, output=target)
    curves = (replace(made.curves[0], at_rest=resting),)
    asked = Competitor(static="polynomial_2", damping="linear_viscous")
    rival = contest(dataset=replace(made, curves=curves), static_run=tmp_path).rival(asked)
    expected = 5 * rate + (held if target == "force" else 0)
    np.testing.assert_allclose(rival.forecasts[0].values, expected, rtol=1e-6, atol=1e-6)
