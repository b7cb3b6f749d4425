"""Errors at left-out parts, each number by hand for a model that is the mean of its samples: a
factor of a column of ones.
"""

from dataclasses import replace

import numpy as np
import pytest
from common import curve_of, dataset_of

from mapmore_cli.fitting.kinds import refit
from mapmore_cli.fitting.kinds.choices import model_choices
from mapmore_cli.fitting.kinds.memory import _asked
from mapmore_cli.fitting.left_out import parts_of, residuals, share_beyond, trained_on
from mapmore_cli.modelling.expressions.operators.lags import spread_times
from mapmore_cli.storage.artefacts import write_dataset
from mapmore_cli.study.experiment import ExperimentSpec

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
    at_levels = tuple(
        replace(curve_of({"p": np.full(2, level), "y": np.zeros(2)}, name=str(level)), level=level)
        for level in (3.0, 1.0, 2.0)
    )
    levels = replace(recordings([0]), level="p", curves=at_levels)
    kind, count, parts = parts_of(levels, CHOICES)
    assert (kind, count, [*parts]) == ("levels", 3, ["p=2"])
    assert [mask.tolist() for mask in parts["p=2"]] == [[False] * 2, [False] * 2, [True] * 2]


@pytest.mark.parametrize(("shared", "is_trained_on"), [(2, False), (3, True), (20, True)])
def test_a_run_knows_held_out_samples_beyond_a_tenth(tmp_path, shared, is_trained_on):
    """Of twenty; rows that train in both do not count, and a further column is not looked at."""
    x, held = np.arange(40.0), np.arange(40) >= 20
    other = np.concatenate([x[:20], x[20 : 20 + shared]])
    seen = dataset_of({"x": other, "y": other, "z": 0 * other}, output="y")
    write_dataset(tmp_path / "ingest.h5", seen)
    assert trained_on(tmp_path, dataset_of({"x": x, "y": x}, held_out=held)) == is_trained_on


def test_time_constants_are_spread_over_the_longest_recording():
    """Of a hundred samples 0.1 s apart; held-out ones are not counted."""
    memory = {"dictionary": [{"slow": {"of": ["x"], "count": 3}}]}
    choices = model_choices(ExperimentSpec.model_validate({**SPEC, **memory}))
    x = np.sin(np.arange(120.0))
    columns = {"time": 0.1 * np.arange(120), "x": x, "y": x}
    _, recipe = _asked(choices, dataset_of(columns, held_out=np.arange(120) >= 100), None)
    taus = [float(term.split(", ")[1].rstrip(")")) for term in recipe.dictionary]
    assert taus == pytest.approx(spread_times(3, 0.1, 10.0), rel=0.01)


@pytest.mark.parametrize("wanted", [False, True])
def test_a_spec_says_whether_intervals_are_wanted(wanted):
    spec = ExperimentSpec.model_validate({**SPEC, "validate": {"intervals": wanted}})
    assert model_choices(spec).intervals is wanted
