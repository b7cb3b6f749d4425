from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.modelling.signals.sampling import find_gaps, find_resets, pieces, typical_step


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
