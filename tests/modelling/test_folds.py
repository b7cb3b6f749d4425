"""What `tune` and `plan` leave out of training, and by how much a model errs there."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from common import curve_of
from surfaces import QUANTITIES, built, curves

from mapmore_cli.annexes.planning.folds import (
    _block_masks,
    errors_of,
    folds_of,
    geometric_mean,
    training_only,
)
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.pieces.cross_validation import BLOCKS

LEVELS = SimpleNamespace(of="pressure")


def folds(levels, by_level=False, n=40, **segment):
    dataset = Dataset("force", "pressure", QUANTITIES, (), tuple(curves(levels, (), n=n)))
    choices = SimpleNamespace(over_time=False, levels=LEVELS, segment=segment)
    return folds_of(dataset, choices, "max", by_level)


@pytest.mark.parametrize(
    ("count", "by_level", "left_out"),
    [
        (5, False, "each of the 3 inner training levels of pressure"),
        (5, True, "each of the 3 inner training levels of pressure"),
        (4, True, "each of the 4 training levels of pressure"),
        (4, False, f"each of {BLOCKS} contiguous blocks of the training samples of every curve"),
        (2, True, f"each of {BLOCKS} contiguous blocks of the training samples of every curve"),
    ],
)
def test_inner_levels_are_left_out_where_there_are_three(count, by_level, left_out):
    levels = [100.0 * (1 + number) for number in range(count)]
    made = folds(levels, by_level, strain=None)
    assert made.left_out == left_out
    out = np.array([[mask.mean() for mask in masks] for masks in made.masks])
    if "levels" in left_out:
        skipped = (count - len(out)) // 2
        np.testing.assert_array_equal(out, np.eye(count)[skipped : count - skipped])
    else:
        assert (out.sum(axis=0), (out > 0).all()) == (pytest.approx(np.ones(count)), True)


def test_a_fold_errs_by_what_a_model_without_its_level_misses():
    levels = (100.0, 150.0, 200.0, 250.0, 300.0)
    made = folds(levels, by_level=True, strain=None)
    errors = errors_of(made, lambda dataset: built([c for c in dataset.curves if c.training.any()]))
    every = made.dataset.curves
    scale = max(np.abs(curve.columns["force"]).max() for curve in every)
    for number, error in enumerate(errors, 1):
        model = built([curve for curve in every if curve is not every[number]])
        missed = predict(model, every[number].columns) - every[number].columns["force"]
        assert error == pytest.approx(np.sqrt(np.mean(missed**2)) / scale, rel=1e-9)
    assert geometric_mean([0.1, 0.4]) == pytest.approx(0.2)


def test_held_out_samples_are_in_no_fold_and_too_few_make_none():
    dataset = Dataset("force", "pressure", QUANTITIES, (), tuple(curves(held_out=(150.0,), n=9)))
    part = dataset.curves[0]
    half = replace(dataset, curves=(replace(part, held_out=np.arange(9) < 4), *dataset.curves[1:]))
    assert [curve.size for curve in training_only(half).curves] == [5, 9, 9]
    with pytest.raises(DataError, match=f"every curve has fewer than {BLOCKS} training samples"):
        folds([100.0], n=BLOCKS - 1, strain=None)
    long, short = curves([100.0], (), n=40)[0], curves([200.0], (), n=BLOCKS - 1)[0]
    both = replace(dataset, curves=(long, short))
    choices = SimpleNamespace(over_time=False, levels=LEVELS, segment={"strain": None})
    found = folds_of(both, choices, "max", by_level=False)
    assert len(found.masks) == BLOCKS, "one curve with enough samples is enough"


def test_blocks_follow_the_quantity_or_the_time_of_each_recording():
    x = np.array([3.0, 1.0, 2.0, 0.0, 9.0, 8.0, 7.0, 6.0, 5.0, 4.0])
    both = replace(curve_of({"x": x}), recordings=("a", "b"), origin=np.array([0, 1] * 5))
    along = [np.flatnonzero(mask).tolist() for mask in _block_masks(both, "x")]
    assert along == [[1, 3], [0, 2], [8, 9], [6, 7], [4, 5]]
    in_time = [np.flatnonzero(mask).tolist() for mask in _block_masks(both, None)]
    assert in_time == [[0, 1], [2, 3], [4, 5], [6, 7], [8, 9]]
    held = replace(both, held_out=np.arange(10) == 3)
    assert not any(mask[3] for mask in _block_masks(held, "x"))
