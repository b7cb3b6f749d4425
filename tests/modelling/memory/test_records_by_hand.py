"""Pieces of recordings within which memory lasts, against loops over their steps."""

from dataclasses import replace

import numpy as np
import pytest
from common import curve_of
from hypothesis import given
from hypothesis import strategies as st
from reading import refused

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.memory.records import (
    AtSample,
    begun,
    complete,
    numbered,
    records_of,
    sampled,
    time_step,
    uninterrupted,
)

STEPS = {"even": 1.0, "late": 1 + 0.9 * 1e-3, "early": 1 - 0.9 * 1e-3, "gap": 1 + 1.1 * 1e-3}
STEPS |= {"back": -1e-9, "far back": -7.0}


@given(st.lists(st.sampled_from([*STEPS]), max_size=30), st.floats(1e-3, 1e3), st.booleans())
def test_a_recording_is_cut_at_gaps_and_at_steps_backwards(steps, step, ordered):
    """If only the order counts, a longer step is no gap."""
    time = step * np.cumsum([0.0, *(STEPS[name] for name in steps)])
    pieces, begin = [], 0
    for k, name in enumerate(steps, start=1):
        if "back" in name or (name == "gap" and not ordered):
            pieces.append((begin, k))
            begin = k
    pieces.append((begin, len(time)))
    found = uninterrupted(time, np.inf if ordered else step)
    assert [(part.start, part.stop) for part in found] == pieces


@pytest.mark.parametrize("short", [0.0, 1 - 1.1 * 1e-3])
def test_a_step_that_is_too_short_is_an_error_at_its_sample(short):
    """It is none if only the order counts, nor if it is as short as numbers of this size allow."""
    time = 0.5 * np.cumsum([0.0, 1.0, 1.0, short, 1.0])
    with pytest.raises(AtSample, match=r"sample 3: only .* even steps of 0.5 s") as caught:
        uninterrupted(time, 0.5)
    assert caught.value.sample == 3
    assert len(uninterrupted(time, np.inf)) == 1
    with pytest.raises(AtSample, match="sample 13: only") as caught, numbered(np.arange(10, 20)):
        uninterrupted(time, 0.5)
    assert caught.value.sample == 13
    far = np.array([0.0, 2.0**52, 2.0**52 + 1, 2.0**52 + 2])
    assert uninterrupted(far, 1.4) == [slice(0, 1), slice(1, 4)]
    assert uninterrupted(far[[1, 1, 2]], 1.4) == [slice(0, 3)]  # a step shorter than the rounding
    for sign in (-1, 1):  # a step is even up to the tolerance of a thousandth and of rounding
        last = 1.0
        for _ in range(9):
            last = 1.0 + sign * (1e-3 + 4 * np.finfo(float).eps * last)
        assert uninterrupted(np.array([0.0, last]), 1.0) == [slice(0, 2)]
    late = 1.7e9 + 0.01 * np.arange(100)  # stamps that a day of the year 2023 leaves 2e-7 s of
    assert uninterrupted(late, 0.01) == [slice(0, 100)]
    assert uninterrupted(np.empty(0), 0.01) == [slice(0, 0)]


def curve_at(time, held_out=None, name="a"):
    return curve_of({"time": time, "y": np.arange(len(time)) * 1.0}, held_out, name)


def test_recordings_have_one_step_or_only_an_order():
    """A curve of one sample has none; the step is the median of the curves'."""
    even = [curve_at(0.1 * np.arange(9), name=name) for name in "abc"]
    near = curve_at(0.1 * (1 + 0.9 * 1e-3) * np.arange(5), name="near")
    other = curve_at(0.1 * (1 + 1.1 * 1e-3) * np.arange(5), name="other")
    single = curve_at(np.array([3.0]), name="single")
    assert time_step([*even, near, single]) == 0.1
    late = np.array([100.0, 100.1, 100.2])  # the differences contain rounding errors of 1e-14 s
    assert np.median(np.diff(late)) != time_step([curve_at(late)]) == 0.1
    step, uneven, records = sampled([*even, near, single])
    assert (step, uneven, [one.size for one in records]) == (
        pytest.approx(0.1),
        False,
        [9] * 3 + [5, 1],
    )
    pair = curve_at(np.array([0.0, 0.05]), name="pair")
    for odd in (other, pair):
        apart = r"0\.[01]\d* s apart, but those of other recordings are 0\.1 s"
        with pytest.raises(DataError, match=f"{odd.id}: its samples are {apart}"):
            time_step([*even, odd])
    with pytest.raises(DataError, match="other: its samples are"):
        sampled([*even, other])
    jumps = curve_at(np.array([0.0, 0.1, 0.7, 0.8, 0.2]), name="jumps")
    step, uneven, records = sampled([*even, other, jumps], ordered=True)
    assert (step, uneven) == (pytest.approx(0.1), True)
    assert [one.size for one in records] == [9, 9, 9, 5, 4, 1]
    assert sampled([single, pair, jumps], ordered=True)[0] == pytest.approx(0.075)
    for curves in ([single], [curve_at(np.zeros(5))], []):
        with pytest.raises(DataError, match="the time step is unknown"):
            sampled(curves, ordered=True)


def test_records_are_pieces_of_every_recording_with_their_training_samples():
    time = np.array([0.0, 0.0, 1.0, 1.0, 5.0, 2.0, 6.0])
    origin = np.array([0, 1, 0, 1, 0, 1, 0])
    held, rest = np.arange(7) == 2, np.arange(7) == 5
    curve = replace(curve_at(time, held), recordings=("p", "q"), origin=origin, at_rest=rest)
    found = records_of([curve], 1.0)
    assert [one.columns["y"].tolist() for one in found] == [[0, 2], [4, 6], [1, 3, 5]]
    trains = curve.training
    expected = [trains[[0, 2]].tolist(), trains[[4, 6]].tolist(), trains[[1, 3, 5]].tolist()]
    assert [one.training.tolist() for one in found] == expected
    assert not trains[2]
    with refused("p: sample 1 (at 1 s): only 1 s after", "add `resample: 5 s`"):
        records_of([curve], 5.0)


@given(st.lists(st.booleans(), min_size=3, max_size=14), st.integers(1, 3), st.integers(1, 12))
def test_a_free_run_begins_after_the_first_samples_that_are_known(held_out, lag, cut):
    """Every piece begins at the first `lag` samples in a row that are not held out, and at its
    first sample if there are none; a piece without training samples is left out.
    """
    held, n = np.array(held_out), len(held_out)
    time = np.arange(n) + 5.0 * (np.arange(n) >= cut)
    kept = []
    for piece in (range(min(cut, n)), range(cut, n)):
        starts = [k for k in piece if k + lag <= piece.stop and not held[k : k + lag].any()]
        if not held[piece.start : piece.stop].all():
            kept += range(starts[0] if starts else piece.start, piece.stop)
    assert begun(curve_at(time, held), lag, 1.0).columns["y"].tolist() == kept


def test_rows_are_complete_if_every_column_has_a_value():
    a, b = np.array([1.0, np.nan, 3.0]), np.array([np.inf, 2.0, 0.0])
    assert complete([a, b], 3).tolist() == [False, False, True]
    assert complete([], 2).tolist() == [True, True]
