"""Errors at left-out parts, each number by hand for a model that is the mean of its samples: a
factor of a column of ones.
"""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from common import curve_of, dataset_of

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Grouping
from mapmore_cli.domain.results import Forecast
from mapmore_cli.fitting import left_out as fitting
from mapmore_cli.fitting.competitors import Contest
from mapmore_cli.fitting.groups import regrouped
from mapmore_cli.fitting.kinds import Given, fit, refit
from mapmore_cli.fitting.kinds.choices import model_choices
from mapmore_cli.fitting.kinds.memory import _asked
from mapmore_cli.fitting.kinds.pieces import segmented
from mapmore_cli.fitting.left_out import (
    _scored,
    _summand_without,
    _training_residuals,
    choices_by_fold,
    left_out,
    parts_of,
    residuals,
    share_beyond,
    trained_on,
)
from mapmore_cli.fitting.refitting import left_out_of
from mapmore_cli.modelling.expressions.operators.lags import spread_times
from mapmore_cli.modelling.forecast import forecast
from mapmore_cli.modelling.literature.own import FamilySettings
from mapmore_cli.storage.artefacts import write_dataset
from mapmore_cli.storage.run_folder import DATASET, RunFiles
from mapmore_cli.study.experiment import ExperimentSpec
from mapmore_cli.study.yaml_dumper import dump

SPEC = {
    "name": "mean",
    "data": {"files": ["*.csv"], "columns": {"x": {"column": "x"}, "y": {"column": "y"}}},
    "target": {"column": "y"},
    "dictionary": [{"terms": ["x"]}],
    "fit": {"scaling": "none"},
}
CHOICES = model_choices(ExperimentSpec.model_validate(SPEC))


def recordings(*outputs):
    return dataset_of(*({"x": np.ones(len(y)), "y": np.array(y, dtype=float)} for y in outputs))


def test_every_recording_is_predicted_by_the_others():
    dataset = recordings([-8, -8], [1, 3], [4, 4], [0, 8])
    held = replace(dataset.curves[3], held_out=np.ones(2, dtype=bool))
    dataset = replace(dataset, curves=(*dataset.curves[:3], held))
    steps = []
    own = residuals(CHOICES, dataset, {}, lambda *step: steps.append(step), refit(CHOICES, dataset))
    assert (own.kind, own.curves, own.parts) == ("recordings", 3, ("a", "b", "c"))
    assert own.samples.tolist() == [2, 2, 2]
    # without a, the mean of b and c is 3; without b it is -2; without c it is -3
    assert own.offset == pytest.approx([-11, 4, 7])
    assert own.scatter == pytest.approx([0, 1, 0], abs=1e-12)
    assert (own.largest, own.astray) == (8, 0)
    assert own.residual == pytest.approx(np.std([-8, -8, 1, 3, 4, 4]) * np.sqrt(7 / 5))
    assert steps == [("recordings left out", number, 3) for number in (1, 2, 3)]


def test_blocks_of_two_recordings_are_predicted_by_the_others():
    dataset = recordings([1, 3, 5, 7, 9], [1, 3, 5, 7, 9])
    own = residuals(CHOICES, dataset, {}, lambda *_: None, refit(CHOICES, dataset))
    assert (own.kind, own.samples.tolist()) == ("blocks", [2, 2, 2])
    # without 3, the mean of the others is 5.5; without 5 it is 5; without 7 it is 4.5
    assert own.offset == pytest.approx([-2.5, 0, 2.5])


@pytest.mark.parametrize(
    ("predictions", "share"),
    [
        ([-2, 0, 3], 0),
        ([4.0, 0], 0.2),
        ([-3.5], 0.3),
        ([3.5, -3, 0], 0.2),
        ([5.0, -2.5], 0.4),
    ],
)
def test_how_far_predictions_lie_beyond_the_range_of_the_target(predictions, share):
    assert share_beyond(np.array(predictions), np.array([3.0, -2, 1])) == pytest.approx(share)
    assert share_beyond(np.array(predictions), np.ones(3)) == 0


def test_of_two_recordings_blocks_are_left_out_and_of_levels_those_within():
    kind, count, parts = parts_of(recordings(range(20), range(10)), CHOICES)
    assert (kind, count, [*parts]) == ("blocks", 5, [f"block {k} of 5" for k in (2, 3, 4)])
    assert [np.flatnonzero(mask).tolist() for mask in parts["block 2 of 5"]] == [
        [4, 5, 6, 7],
        [2, 3],
    ]
    times = {"time": np.arange(20.0), "x": np.zeros(20), "y": np.zeros(20)}
    _, count, parts = parts_of(dataset_of(times), CHOICES)
    assert (count, [*parts]) == (5, [f"block {k} of 5" for k in range(1, 6)])
    at_levels = tuple(
        replace(curve_of({"p": np.full(2, level), "y": np.zeros(2)}, name=str(level)), level=level)
        for level in (3.0, 1.0, 2.0)
    )
    levels = replace(recordings([0]), level="p", curves=at_levels)
    kind, count, parts = parts_of(levels, CHOICES)
    assert (kind, count, [*parts]) == ("levels", 3, ["p=2"])
    assert [mask.tolist() for mask in parts["p=2"]] == [[False] * 2, [False] * 2, [True] * 2]


def test_each_of_three_specimens_of_a_family_is_left_out():
    family = replace(CHOICES, model=replace(CHOICES.model, family=FamilySettings(of="g")))
    columns = [{"g": np.full(2, value), "y": np.zeros(2)} for value in (3.0, 1.0, 2.0)]
    kind, count, parts = parts_of(dataset_of(*columns), family)
    assert (kind, count, [*parts]) == ("specimens", 3, ["g=1", "g=2", "g=3"])
    assert [mask.tolist() for mask in parts["g=1"]] == [[False] * 2, [True] * 2, [False] * 2]
    with pytest.raises(DataError, match="the training data have 2"):
        parts_of(dataset_of(*columns[:2]), family)


def test_a_rival_is_compared_by_its_forecasts_of_left_out_groups_if_no_fit_fails():
    columns = {"x": np.ones(4), "y": np.array([1.0, 1.0, 2.0, 2.0]), "g": np.array([7, 7, 8, 8.0])}
    dataset, folds = dataset_of(columns), []

    def compare(fold):
        folds.append(fold.dataset.curves[0].held_out.tolist())
        forecasts = (Forecast.of(np.full(4, float(len(folds)))),)
        return {"rival": forecasts, **({"fails": forecasts} if len(folds) < 2 else {})}, ["slow"]

    contest = Contest(dataset, refit(CHOICES, dataset), {}, None, {}, Path())
    workspace = SimpleNamespace(run_dir=None, progress=lambda *_: None)
    _, said, warnings = left_out(CHOICES, contest, compare, workspace, "y", "g")
    assert folds == [[True, True, False, False], [False, False, True, True]]
    assert {*said} == {"mapmore", "rival"}
    assert said["mapmore"][0].values == pytest.approx([2, 2, 1, 1])
    assert said["rival"][0].values.tolist() == [1, 1, 2, 2]
    assert warnings == ["slow"] * 2


def test_more_than_twelve_folds_share_searches_without_their_samples(monkeypatch):
    dataset, searched = recordings(*([float(k)] * 2 for k in range(14))), []

    def again(rest):
        searched.append([k for k, curve in enumerate(rest.curves) if not curve.training.any()])
        return replace(CHOICES, name="found", intervals=True)

    monkeypatch.setattr(fitting, "_searching_again", lambda _run_dir: again)
    folds = [tuple(np.full(2, place == k) for place in range(14)) for k in range(14)]
    made_by = choices_by_fold(Path(), CHOICES, dataset, folds)
    made = [made_by(number) for number in range(14)]
    assert searched == [[0, 12], [1, 13], *([k] for k in range(2, 12))]
    assert {(each.name, each.intervals) for each in made} == {("mean", True)}
    assert choices_by_fold(None, CHOICES, dataset, folds)(0) is CHOICES


@pytest.mark.parametrize("grouping", [None, Grouping("y", "x", offset=True)])
def test_a_sample_is_scored_as_its_fold_corrects_it(grouping):
    dataset = replace(recordings([1, 2, 3]), grouping=grouping)
    folds = [(np.arange(3) < 2,), (np.arange(3) == 2,)]
    scored = _scored(dataset, [recordings([4, 5, 6]), recordings([7, 8, 9])], folds)
    (curve,) = scored.curves
    assert curve.columns["y"].tolist() == ([1, 2, 3] if grouping is None else [4, 5, 9])
    assert curve.held_out.all()


def test_residuals_are_those_of_training_curves_at_levels_that_train():
    dataset = recordings([1, 3], [4, 4], [9, 9])
    at_levels = [replace(c, level=float(k)) for k, c in enumerate(dataset.curves)]
    at_levels[2] = replace(at_levels[2], held_out=np.ones(2, dtype=bool))
    dataset = replace(dataset, curves=tuple(at_levels))
    model = refit(CHOICES, replace(dataset, curves=dataset.curves[:2]))
    found = _training_residuals(dataset, model, 1.0)
    assert {level: [log.tolist() for log in logs] for level, logs in found.items()} == {
        0: [pytest.approx([-2, 0])]
    }


def test_a_summand_is_fitted_without_the_recordings_that_are_left_out(tmp_path):
    of_summand = recordings([1, 1], [5, 5], [3, 3])
    write_dataset(tmp_path / DATASET, of_summand)
    (tmp_path / "experiment.yaml").write_text(dump(SPEC))
    fold = recordings([0, 0], [0, 0], [0, 0])
    out = replace(fold.curves[1], held_out=np.ones(2, dtype=bool))
    fold = replace(fold, curves=(fold.curves[0], out, fold.curves[2]))
    model = _summand_without(tmp_path, fold)
    assert forecast(model, of_summand.curves[1]).values == pytest.approx([2, 2])


def of_groups(*groups, turned=()):
    """Return a recording of y = 5 + 3 x for each group, of which the second and the third add 4;
    the outputs of some may be turned round. The effects of the groups are removed.
    """
    x, noise = np.linspace(0, 1, 12), np.random.default_rng(0).normal(0, 1e-3, (len(groups), 12))
    columns = []
    for number, group in enumerate(groups):
        y = 5 + 3 * x + 4 * (group > 1) + noise[number]
        y = 2 * y[::-1] + 1 if number in turned else y
        columns.append({"x": x, "g": np.full(12, float(group)), "y": y})
    return regrouped(replace(dataset_of(*columns), grouping=Grouping("y", "g", offset=True)))


def fold_of(dataset, number):
    """Return the samples that a model is fitted to without one recording, as bytes, and the output
    of this recording with which the model is compared.
    """
    trained = []

    def remade(rest):
        trained.extend(c.columns["y"][c.training].tobytes() for c in rest.curves)
        return refit(CHOICES, rest)

    masks = [np.full(12, curve == number) for curve in range(len(dataset.curves))]
    ((curve, _, _),) = left_out_of(dataset, masks, remade)
    return trained, curve.columns["y"]


@pytest.mark.parametrize("number", [0, 1, 2])
def test_a_fold_has_effects_of_groups_from_its_own_training_samples(number):
    """All recordings but the left-out one are as they would be if it had never been measured."""
    groups = (1, 2, 1, 2)
    trained, of_group = fold_of(of_groups(*groups), number)
    again, turned = fold_of(of_groups(*groups, turned=[number]), number)
    assert trained == again
    assert not np.array_equal(of_group, turned)
    x = np.linspace(0, 1, 12)
    assert of_group == pytest.approx(7 + 3 * x, abs=0.02)  # the mean of both groups


def test_a_left_out_group_without_training_samples_keeps_its_offset():
    _, alone = fold_of(of_groups(1, 2, 3), 2)
    assert alone == pytest.approx(9 + 3 * np.linspace(0, 1, 12), abs=0.02)


def test_another_run_has_seen_samples_although_it_removed_other_offsets(tmp_path):
    other, held = of_groups(1, 2, 1), of_groups(1, 2, 1, turned=[1])
    write_dataset(tmp_path / DATASET, other)
    assert RunFiles(tmp_path).dataset().grouping == Grouping("y", "g", offset=True)
    curves = [replace(c, held_out=np.full(12, k == 2)) for k, c in enumerate(held.curves)]
    assert trained_on(tmp_path, replace(held, curves=tuple(curves)))


@pytest.mark.parametrize(("shared", "is_trained_on"), [(2, False), (3, True), (20, True)])
def test_a_run_knows_held_out_samples_beyond_a_tenth(tmp_path, shared, is_trained_on):
    """Of twenty; rows that train in both do not count, and a further column is not looked at."""
    x, held = np.arange(40.0), np.arange(40) >= 20
    other = np.concatenate([x[:20], x[20 : 20 + shared]])
    seen = dataset_of({"x": other, "y": other, "z": 0 * other}, output="y")
    write_dataset(tmp_path / "ingest.h5", seen)
    assert trained_on(tmp_path, dataset_of({"x": x, "y": x}, held_out=held)) == is_trained_on


def test_time_constants_are_spread_over_the_longest_recording():
    """Of a hundred samples 0.1 s apart; held-out ones and shorter ones are not counted."""
    memory = {"dictionary": [{"slow": {"of": ["x"], "count": 3}}]}
    choices = model_choices(ExperimentSpec.model_validate({**SPEC, **memory}))
    x = np.sin(np.arange(120.0))
    columns = {"time": 0.1 * np.arange(120), "x": x, "y": x}
    short = {name: values[:60] for name, values in columns.items()}
    held = curve_of(columns, np.arange(120) >= 100, "a"), curve_of(short, name="b")
    _, recipe = _asked(choices, replace(dataset_of(columns), curves=held), None)
    taus = [float(term.split(", ")[1].rstrip(")")) for term in recipe.dictionary]
    assert taus == pytest.approx(spread_times(3, 0.1, 10.0), rel=0.01)


@pytest.mark.parametrize(
    ("terms", "first"), [(["x[k-2]"], 0), (["x", "y[k-1]"], 5), (["y[k-1]", "x*y[k-2]"], 7)]
)
def test_a_recording_begins_with_the_outputs_that_are_fed_back(terms, first):
    """Outputs that are held out are not known; they are the first five and the seventh."""
    choices = model_choices(
        ExperimentSpec.model_validate({**SPEC, "dictionary": [{"terms": terms}]})
    )
    held, x = np.isin(np.arange(60), [0, 1, 2, 3, 4, 6]), np.sin(np.arange(60.0))
    columns = {"time": np.arange(60.0), "x": x, "y": np.arange(60.0)}
    ((record,), _) = _asked(choices, dataset_of(columns, held_out=held), None)
    assert record.columns["time"].tolist() == [*range(first, 60)]
    assert np.isnan(record.columns["y"]).tolist() == held[first:].tolist()


def test_the_progress_of_a_fit_counts_its_segments():
    halves = {"segment": {"x": {"method": "even", "count": 2, "min_samples": 2}}}
    choices = model_choices(ExperimentSpec.model_validate({**SPEC, **halves}))
    dataset, steps = dataset_of({"x": np.arange(20.0), "y": np.arange(20.0)}), []
    cuts = segmented(dataset, choices)
    fit(choices, Given(dataset, cuts, progress=lambda *step: steps.append(step)))
    assert steps == [("segments", 1, 2), ("segments", 2, 2)]


@pytest.mark.parametrize("wanted", [False, True])
def test_a_spec_says_whether_intervals_are_wanted(wanted):
    spec = ExperimentSpec.model_validate({**SPEC, "validate": {"intervals": wanted}})
    assert model_choices(spec).intervals is wanted
