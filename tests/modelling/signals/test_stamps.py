"""Stamps of a clock: repeated ones, gaps and resets, and values brought to other stamps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.modelling.signals.sampling import align, average_repeated, find_gaps, find_resets, pieces, spread_repeated, typical_step

stamps = st.lists(st.integers(0, 3), min_size=1, max_size=40).map(lambda steps: np.cumsum(steps) * 0.001)


@settings(deadline=None)
@given(time=stamps, seed=st.integers(0, 2**31))
def test_averaging_leaves_each_stamp_once_with_the_mean_of_its_samples(time: np.ndarray, seed: int) -> None:
    force = np.random.default_rng(seed).normal(size=len(time))
    once, averaged = average_repeated(time, {"force": force, "time": time})
    assert (np.diff(once) > 0).all()
    assert set(once) == set(time)
    np.testing.assert_allclose(averaged["force"], [force[time == t].mean() for t in once], rtol=1e-12, atol=1e-15)


@settings(deadline=None)
@given(time=stamps)
def test_spreading_makes_stamps_unique_without_reaching_the_next(time: np.ndarray) -> None:
    spread = spread_repeated(time)
    first = np.concatenate([[True], np.diff(time) > 0])
    np.testing.assert_array_equal(spread[first], time[first])
    if len(np.unique(time)) > 1:
        assert (np.diff(spread) > 0).all()
    else:
        np.testing.assert_array_equal(spread, time)


def test_spreading_is_even() -> None:
    np.testing.assert_allclose(spread_repeated(np.array([0.0, 1.0, 1.0, 3.0, 3.0, 3.0])), [0, 1, 2, 3, 3 + 2 / 3, 3 + 4 / 3])


@settings(deadline=None)
@given(
    sizes=st.lists(st.integers(2, 30), min_size=1, max_size=6),
    missing=st.lists(st.integers(5, 500), min_size=5, max_size=5),
    step=st.sampled_from([0.001, 0.02, 0.1, 7.0]),
)
def test_planted_gaps_are_found_and_their_samples_counted(sizes: list[int], missing: list[int], step: float) -> None:
    counts = np.concatenate([np.arange(size) + sum(sizes[:i]) + sum(missing[:i]) for i, size in enumerate(sizes)])
    gaps = find_gaps(counts * step, 3 * step)
    np.testing.assert_array_equal(gaps.after, np.cumsum(sizes)[:-1] - 1)
    np.testing.assert_allclose(gaps.lengths, (np.array(missing[: len(sizes) - 1]) + 1) * step)
    assert gaps.samples_missing == sum(missing[: len(sizes) - 1])
    assert [part.stop - part.start for part in pieces(len(counts), gaps.after)] == sizes


@pytest.mark.parametrize("start", [0.0, 1e4, 1.6e9])
def test_step_of_exactly_the_limit_is_no_gap(start: float) -> None:
    assert len(find_gaps(start + np.arange(1000) * 0.01, 0.01)) == 0


def test_repeated_stamps_do_not_hide_the_usual_step() -> None:
    time = np.repeat(np.arange(10.0), 3)
    assert typical_step(time) == 1.0
    assert typical_step(np.zeros(4)) == 0.0
    assert find_gaps(np.append(time, 19.0), 2.0).samples_missing == 9


def test_resets() -> None:
    np.testing.assert_array_equal(find_resets(np.array([0, 1, 1, 0.5, 2, 0])), [2, 4])
    assert pieces(6, find_resets(np.array([0, 1, 1, 0.5, 2, 0]))) == [slice(0, 3), slice(3, 5), slice(5, 6)]


times = st.lists(st.integers(-50, 50), min_size=1, max_size=30, unique=True).map(lambda stamps: np.array(sorted(stamps), dtype=float))


@settings(deadline=None)
@given(time=times, stamps=st.lists(st.floats(-60, 60), min_size=1, max_size=40), max_gap=st.one_of(st.none(), st.floats(0.5, 20)))
def test_every_value_lies_between_two_near_samples_or_is_missing(time: np.ndarray, stamps: list[float], max_gap: float | None) -> None:
    values = 2 * time - 1
    aligned = align(np.array(stamps), time, values, max_gap)
    for stamp, value in zip(stamps, aligned, strict=True):
        before, after = time[time <= stamp], time[time >= stamp]
        near = len(before) and len(after) and (max_gap is None or after[0] - before[-1] <= max_gap * (1 + 1e-9))
        if near:
            np.testing.assert_allclose(value, 2 * stamp - 1, atol=1e-9)
        else:
            assert np.isnan(value)


def test_own_stamps_keep_their_values_on_both_sides_of_a_gap() -> None:
    time, values = np.array([0.0, 1.0, 9.0, 10.0]), np.array([5.0, 6.0, 7.0, 8.0])
    np.testing.assert_array_equal(align(time, time, values, 2.0), values)
    np.testing.assert_array_equal(align(np.array([1.5, np.nan, -0.1, 10.1]), time, values, 2.0), [np.nan] * 4)
