"""Folds with which structures are compared, sample by sample."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from common import curve_of, dataset_of

from mapmore_cli.annexes.search import bench, parts, stretches
from mapmore_cli.annexes.search.choosing import choose_structure
from mapmore_cli.annexes.search.samples import pooled_samples
from mapmore_cli.annexes.search.situation import Situation
from mapmore_cli.domain.errors import FitError
from mapmore_cli.domain.results import Tried
from mapmore_cli.study.sections.split import Between


def rows(folds):
    return [np.flatnonzero(fold).tolist() for fold in folds]


def held(pattern):
    """Samples, `-` of which train and `x` of which are held out."""
    return np.array([sign == "x" for sign in pattern])


def test_windows_are_as_long_as_the_held_out_run():
    short = rows(stretches._windows([np.arange(20)], 22, 2))
    assert short == [[k, k + 1, k + 10, k + 11] for k in range(0, 10, 2)]
    once = rows(stretches._windows([np.arange(10)], 10, 1))
    assert once == [[k, k + 5] for k in range(5)]  # each two times
    long = rows(stretches._windows([np.arange(30)], 30, 50))  # a third of the recording
    assert [(fold[0], len(fold)) for fold in long] == [(k * 5, 10) for k in range(5)]
    both = rows(stretches._windows([np.arange(5), np.arange(5, 10)], 10, 0))
    assert both == [[k, k + 5] for k in range(5)]


@pytest.mark.parametrize(
    ("patterns", "run"),
    [
        (["--"], 0),
        (["xxx--x--xx"], 2),  # of six samples, three are in runs of up to two
        (["xxx----x--"], 3),
        (["xx", "xxxx"], 4),
        (["xx--", "xx--"], 2),
    ],
)
def test_the_typical_run_of_held_out_samples(patterns, run):
    curves = tuple(
        curve_of({"y": np.zeros(len(one))}, held(one), f"{number}")
        for number, one in enumerate(patterns)
    )
    study = replace(dataset_of({"y": np.zeros(2)}), curves=curves)
    assert bench.held_run(pooled_samples(study)) == run


def test_bands_are_around_quantiles_and_as_wide_as_those_held_out():
    x = np.arange(12.0)
    samples = curve_of({"x": x, "y": x})
    holdout = {"x": Between(between=[(2.0, 4.0), (5, 5.5)])}
    # quantiles of 0 to 11 at sixths, and half of the median width of 1.25
    middles = 11 * np.arange(1, 6) / 6
    expected = [np.flatnonzero(np.abs(x - m) <= 0.625).tolist() for m in middles]
    assert rows(stretches._bands(samples, holdout, ["x"])) == expected
    assert stretches._bands(samples, holdout, ["y"]) == stretches._bands(samples, {}, ["x"]) == []
    ends = {"x": Between(between=[(0.0, 4.0)])}
    assert stretches._bands(samples, ends, ["x"]) == []


def test_inner_stretches_along_each_input():
    """A seventh at either end is never left out."""
    x = np.arange(13.0)
    data = pooled_samples(dataset_of({"x": x[::-1], "still": np.zeros(13), "y": x}))
    situation = Situation("y", ("x", "still"), None, 13, 1)
    words, folds = stretches.stretches(data, situation, None, 0)
    assert "5 inner stretches" in words
    found = [fold for fold in rows(folds) if fold]
    assert found == [[9, 10], [7, 8], [5, 6], [3, 4], [2]]  # two of thirteen at either end
    timed = Situation("y", ("x",), None, 13, 1, 0.01, 100)
    x = np.arange(14.0)
    recording = pooled_samples(dataset_of({"x": x, "y": x}, held_out=x == 13))
    words, folds = stretches.stretches(recording, timed, None, 4)
    assert "stretches of the training samples of every recording" in words
    assert rows(folds) == rows(stretches._windows([np.arange(13)], 14, 4))


def test_ends_of_recordings_are_counted_from_the_last_training_sample():
    samples = curve_of({"y": np.zeros(12)}, held("-------x--xx"))
    remaining = np.array([9, 8, 7, 6, 5, 4, 3, 2, 2, 1, 0, 0]) / 9
    np.testing.assert_array_equal(parts._remaining(samples), remaining)
    np.testing.assert_array_equal(parts._remaining(curve_of({"y": np.zeros(3)}, held("xxx"))), 1)


@pytest.mark.parametrize(
    ("sizes", "left_out"),
    [
        ((10, 10), [0, 1]),
        ((10, 2, 10), [0, 1, 2]),  # the mean size in which a sample lies is 9.3
        ((10, 1, 10), [0, 2]),
        ((12, 9, 9), [0, 1, 2]),
        ((13, 9, 9), [1, 2]),  # 13 is more than 1.2 times 10.7
        ((30, 2), []),
    ],
)
def test_recordings_of_a_fair_size_are_left_out(sizes, left_out):
    origin = np.repeat(np.arange(len(sizes)), sizes)
    curve = curve_of({"y": np.zeros(len(origin))})
    samples = SimpleNamespace(origin=origin, training=curve.training)
    folds = parts._fair(samples)
    assert [int(origin[fold][0]) for fold in folds] == left_out
    assert all(fold.sum() == sizes[number] for fold, number in zip(folds, left_out, strict=True))


@pytest.mark.parametrize(
    ("first", "second", "shares"),
    [
        ("--------", "--------", [0, 0, 1]),  # nothing is held out
        ("xxxx----", "----xxxx", [0.5, 0.5, 0]),
        ("xxxx----", "xx--xx--", [2 / 3, 1 / 3, 0]),  # of two kinds, the first one counts
        ("xxxx----", "----x---", [1, 0, 0]),  # a kind below a quarter does not count
        ("xx------", "--xx----", [0.5, 0.5, 0]),
    ],
)
def test_shares_of_the_kinds_of_held_out_samples(first, second, shares):
    kinds = [held(first), held(second)]
    assert parts._shares(kinds, np.logical_or(*kinds)) == pytest.approx(shares)
    others = parts._shares([kinds[0] & False, kinds[1] & False], np.logical_or(*kinds))
    assert others == [0, 0, 1]  # stretches


def outcome(family, parameters, *errors, failure=""):
    tried = Tried(family, family, {}, parameters, failure=failure)
    return tried, [np.full(3, error) for error in errors]


def chosen_of(*outcomes, most=np.inf):
    """What is chosen where the last fold does not decide, and the target has a range of ten."""
    found = SimpleNamespace(
        dataset=dataset_of({"x": np.zeros(3), "y": np.array([0.0, 10, 5])}, output="y"),
        situation=SimpleNamespace(timed=most == np.inf),
        weights=np.array([0.5, 0.5, 0.0]),
        **{"blocks": 2, "left_out": "stretch", "parts_left_out": "level"},
    )
    return choose_structure(outcomes, found, most)


LONG = outcome("longer", 20, 1.0, 1.0, 5.0)
BOX, FAILED = outcome("black box", 0, 0.5, 0.5, 0.5), outcome("tables", 1, failure="singular")


@pytest.mark.parametrize(
    ("family", "parameters", "error", "chosen"),
    [
        ("simple", 18, 1.015, 1),  # plain, and within 2 % of the best
        ("formula", 18, 1.015, 1),
        ("tables", 18, 1.015, 0),
        ("simple", 18, 1.03, 0),
        ("simple", 21, 1.001, 0),  # longer than what is as good
    ],
)
def test_a_plain_structure_is_preferred_if_it_is_as_good(family, parameters, error, chosen):
    search = chosen_of(LONG, outcome(family, parameters, error, error, 9.0), BOX, FAILED)
    assert (search.best, search.chosen, search.scale) == (0, chosen, 10.0)
    assert (search.left_out, search.parts, search.target) == ("stretch", "level", "y")
    first, second, _, failed = search.tried
    assert first.errors == pytest.approx((0.1, 0.1, 0.5))
    assert (first.error, first.parts, first.excess) == pytest.approx((0.1, 0.5, 0))
    assert second.excess == pytest.approx(np.log(error))
    assert failed.failure == "singular"
    assert "smallest median error" in search.rule


def test_the_fewest_parameters_decide_where_they_are_limited():
    long, short = outcome("longer", 20, 1.0, 1.1, 1.0), outcome("tables", 4, 1.05, 1.05, 1.0)
    search = chosen_of(long, short, most=20)
    assert (search.best, search.chosen) == (0, 1)
    assert "fewest parameters" in search.rule
    assert chosen_of(long, short, most=19).best == 1
    with pytest.raises(FitError, match=r"no structure could be fitted .*: singular"):
        chosen_of(BOX, FAILED, long, most=19)
    with pytest.raises(FitError, match="there was no time for any"):
        chosen_of(BOX)


def test_no_plain_structure_is_taken_if_another_one_dominates_it():
    plain, better = outcome("simple", 18, 1.015, 1.015, 1.0), outcome("tables", 18, 1.01, 1.01, 1.0)
    assert chosen_of(LONG, plain).found.words == "simple"
    assert chosen_of(LONG, plain, better).found.words == "longer"
