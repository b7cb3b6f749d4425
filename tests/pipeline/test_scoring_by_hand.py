"""What `validate` says beside its numbers, for two recordings of six samples."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from common import curve_of, dataset_of, score_of

from mapmore_cli.domain import arrays
from mapmore_cli.domain.compared import Normaliser
from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.results import Forecast
from mapmore_cli.fitting.stage import Need
from mapmore_cli.modelling import forecast as model_forecast
from mapmore_cli.pipeline import scoring
from mapmore_cli.pipeline.validate import needs, required_limits
from mapmore_cli.study.experiment import ExperimentSpec

TIMED = {"time": 0.5 * np.arange(6), "y": np.zeros(6)}
PIECES = replace(
    curve_of(TIMED, np.arange(6) >= 3), recordings=("a", "b"), origin=np.array([0, 0, 0, 1, 1, 1])
)


def test_where_a_free_run_diverges():
    dataset = dataset_of(TIMED)
    said = scoring._diverged("arx", PIECES, 4, dataset)
    assert said.startswith("arx: its free run diverges on b at sample 1 (2 1), so that")
    untimed = replace(PIECES, columns={"y": np.zeros(6)})
    assert "diverges on a at sample 2, so" in scoring._diverged("arx", untimed, 2, dataset)
    warnings = []
    rival = SimpleNamespace(diverged=[1, 5])
    fine = SimpleNamespace(diverged=[])
    study = replace(dataset, curves=(PIECES, PIECES))
    scoring._warn_of_fits(warnings.append, {}, {"arx": (fine, rival), "own": (fine, fine)}, study)
    first, second = warnings
    assert "arx: its free run diverges on a at sample 1 (0.5 1), so" in first
    assert "arx: its free run diverges on b at sample 2 (2.5 1), so" in second


def test_only_the_own_model_has_parameters_fitted_to_these_samples(monkeypatch):
    asked = {}
    monkeypatch.setattr(scoring, "parameters", lambda _model: 5)
    monkeypatch.setattr(
        scoring, "score_rows", lambda name, *_, **said: asked.update({name: said}) or ()
    )
    forecasts = {name: (Forecast.of(np.zeros(6)),) for name in ("mapmore", "cubic")}
    part = SimpleNamespace(target="y", groups="session")
    assert [*scoring._rows(part, None, dataset_of(TIMED), forecasts, None)] == []
    assert {name: said["free"] for name, said in asked.items()} == {"mapmore": 5, "cubic": 0}
    assert {said["group"] for said in asked.values()} == {"session"}


def test_rows_of_models_that_saw_held_out_samples_are_marked(monkeypatch):
    saw = {Path("old")}
    monkeypatch.setattr(scoring, "trained_on", lambda run, _dataset: run in saw)
    rivals = [
        SimpleNamespace(name=name, run=run)
        for name, run in (("old", Path("old")), ("new", Path("new")), ("cubic", None))
    ]
    rows = [
        score_of(split=split, model=name)
        for name in ("old", "new", "cubic", "mapmore")
        for split in ("validate", "train")
    ]
    marked = scoring._with_seen(rows, rivals, dataset_of(TIMED))
    assert [row.split for row in marked] == ["seen", "train", *["validate", "train"] * 3]


def test_intervals_are_those_of_held_out_samples_within_the_range(monkeypatch):
    monkeypatch.setattr(scoring, "half_widths_of", lambda _model, columns, **_: 1 + columns["time"])
    monkeypatch.setattr(scoring, "outside", lambda _model, curve: curve.columns["time"] > 2)
    output = Forecast.of(np.zeros(6))
    monkeypatch.setattr(scoring, "forecast_each", lambda *_: (output,))
    model, part = SimpleNamespace(left_out=1), SimpleNamespace(seen_as=None)
    dataset = replace(dataset_of(TIMED), curves=(PIECES,))
    (found,) = scoring._own_forecasts(part, model, dataset)
    np.testing.assert_array_equal(found.half, [np.nan] * 3 + [2.5, 3, np.nan])
    for other, of in (
        (model, SimpleNamespace(seen_as="x")),
        (SimpleNamespace(left_out=None), part),
    ):
        assert scoring._own_forecasts(of, other, dataset) == (output,)


@pytest.mark.parametrize(
    ("over_time", "beyond"), [(True, [0, 0, 1, 0, 0, 1]), (False, [0, 0, 0, 0, 0, 0])]
)
def test_what_depends_on_earlier_samples_is_tested_recording_by_recording(
    monkeypatch, over_time, beyond
):
    """The force behind a tendon, which says how long the muscle is, depends on its rate."""
    monkeypatch.setattr(arrays, "WIDE", 2)
    monkeypatch.setattr(model_forecast, "runs_over_time", lambda _: over_time)
    monkeypatch.setattr(
        model_forecast, "outside_range", lambda _, columns: np.arange(len(columns["y"])) > 1
    )
    assert model_forecast.outside(SimpleNamespace(), PIECES).tolist() == [*map(bool, beyond)]


def test_an_input_can_be_scored_instead_of_the_output():
    model = SimpleNamespace(input_names=("p", "x"), output=SimpleNamespace(name="y"))
    assert scoring.scored_as("x", dataset_of(TIMED), model).target == "x"
    with pytest.raises(SpecError, match="the model of y cannot be inverted for `z`"):
        scoring.scored_as("z", dataset_of(TIMED), model)


def test_competitors_are_those_of_the_spec_and_the_simple_ones():
    named, steps, warnings = [], [], []
    formula = SimpleNamespace(notes=("overflow",))
    rivals = {
        "sarosi": SimpleNamespace(
            name="sarosi", failed=True, formulas={"a": formula, "b": formula}
        ),
        "cubic": SimpleNamespace(name="cubic", failed=False, formulas={}),
    }
    labelled = SimpleNamespace(label="cubic")
    contest = SimpleNamespace(
        simple_beside=lambda known: named.append(known) or ["cubic"],
        rival=lambda asked: rivals[getattr(asked, "label", asked)],
    )
    for simple, against, found in (
        (True, ["sarosi"], ["sarosi", "cubic"]),
        (False, ["sarosi", labelled], ["sarosi", "cubic"]),
        (False, [], []),
    ):
        part = SimpleNamespace(against=against, simple=simple)
        fitted = scoring._fit_rivals(
            contest, part, lambda *step: steps.append(step), warnings.append
        )
        assert [rival.name for rival in fitted] == found
    assert named == [{"sarosi"}]
    assert steps == [("competitors", 1, 2), ("competitors", 2, 2)] * 2
    reason = "sarosi: the fit failed, so that its rows are left out: overflow; overflow"
    assert warnings == [reason] * 2


def test_limits_are_compared_with_the_held_out_rows_of_the_models_own_outputs():
    rows = [
        score_of(rmse=5.0),
        score_of(curve="p=1", rmse=6.0),
        score_of(split="train"),
        score_of(model="cubic"),
    ]
    other = score_of("z", rmse=7.0)

    def found(require, *rows):
        limits = required_limits(require, rows)
        return [(each.metric, each.model, each.value, each.limit) for each in limits]

    assert found({"rmse": 4.0}, *rows) == [("rmse", "mapmore", 5.0, 4.0)]
    assert found({"rmse": {"z": 3.0}}, *rows) == []
    assert found({"max_abs_error": 9.0, "rmse": {"z": 3.0}}, *rows, other) == [
        ("max_abs_error", "mapmore (y)", 3.0, 9.0),
        ("max_abs_error", "mapmore (z)", 3.0, 9.0),
        ("rmse", "mapmore (z)", 7.0, 3.0),
    ]
    assert found({"rmse": 4.0}, rows[2], rows[3]) == [("rmse", "mapmore", 1.0, 4.0)]


def test_rows_that_were_measured_once_do_not_count(monkeypatch):
    """A repeatability of two curves: three of five samples have a repetition."""
    asked = []
    others = (np.array([1.0, 14.0, np.nan]), np.array([np.nan, 10.0]))
    for name in ("repeats", "repeated_cycles"):
        monkeypatch.setattr(
            scoring, name, lambda *said, of=name: asked.append((of, *said)) or others
        )
    columns = {"x": np.arange(3.0), "p": np.ones(3), "y": np.array([0.0, 10, 20])}
    first = curve_of(columns)
    dataset = replace(
        dataset_of(columns, output="y"), curves=(first, first.at(range(2))), level="p"
    )
    inputs = tuple(dataset.quantities[name] for name in ("p", "x"))
    model = SimpleNamespace(output=dataset.quantities["y"], inputs=inputs)
    for cycles in (None, "x"):
        part = SimpleNamespace(cycles_of=cycles, target="y")
        found = scoring._repeatability_scores(part, model, dataset, Normaliser("range", 4.0))
        (row,) = (row for row in found if row.curve == "all")
        assert (row.model, row.target, row.n) == ("repeatability", "y", 3)
        assert row.rmse == pytest.approx(np.sqrt((1 + 16 + 0) / 3))
        spread = np.sum((np.array([0, 10, 10]) - 20 / 3) ** 2)
        assert row.rrse == pytest.approx(np.sqrt(17 / spread))
    (name, _, target, along, _), (other, *_, driven, _) = asked
    assert (name, target, along) == ("repeats", "y", ["x"])
    assert (other, driven) == ("repeated_cycles", "x")


def test_a_study_needs_the_runs_that_it_compares_itself_with():
    """A compared run may be out of date; the static run and variations may not."""
    others = [{"run": "b.yaml"}, {"run": "s.yaml"}, {"run": "b.yaml", "as": "again"}]
    variation = {"set": {"fit.max_terms": 2}, "as": "two"}
    spec = {
        "name": "x",
        "data": {"files": ["a.csv"], "columns": {"y": {"column": 0}, "x": {"column": 1}}},
        "target": "dynamic",
        "needs": {"static": "s.yaml"},
        "validate": {"against": ["reynolds", *others, variation]},
    }
    found = needs(ExperimentSpec.model_validate(spec))
    assert found == [
        Need("s.yaml"),
        Need("b.yaml", compared=True),
        Need("two", ("fit.max_terms=2",)),
    ]
    assert not found[0].compared
