"""Turning points, branches and beginnings of load cycles, by hand."""

import numpy as np
import pytest

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.signals.cycles import (
    _trimmed_runs,
    bin_means,
    cycle_starts,
    last_cycles,
    split_cycles,
    turning_points,
)


def test_bins_include_both_ends():
    over = np.array([0.0, 1.0, 2.0, 3.0, 3.5, 4.0, 4.1, -0.1])
    places, means = bin_means(over, {"y": 10 * over}, np.array([0.0, 1.0, 2.0, 4.0]))
    assert places.tolist() == [0, 1, pytest.approx((2 + 3 + 3.5 + 4) / 4)]
    assert means["y"].tolist() == pytest.approx([0, 10, 31.25])
    places, _ = bin_means(over[[0, 5]], {}, np.array([0.0, 1.0, 2.0, 4.0]))
    assert places.tolist() == [0, 4]


@pytest.mark.parametrize(
    ("values", "turns"),
    [
        ([0, 1, 2, 1, 0], [0, 2, 4]),
        ([0, 2, 1.5, 3, 0], [0, 3, 4]),  # a reversal by half the swing is none
        ([0, 2, 1, 3, 0], [0, 1, 2, 3, 4]),
        ([0, 0.9], []),
        ([0, 1], [0, 1]),
        ([1, 0], [0, 1]),
        ([1, 1.5, 0], [1, 2]),
        ([5, 5], []),
        ([], []),
    ],
)
def test_turns_count_from_a_swing_of_one(values, turns):
    assert turning_points(np.array(values, dtype=float), 1.0).tolist() == turns


def test_cycles_begin_at_the_last_rest_before_a_rise():
    one = [0, 0.4, 0.6, 10, 0]
    x = np.array([*one, 0, *one, *one], dtype=float)
    assert cycle_starts(x).tolist() == [1, 7, 12]
    assert cycle_starts(np.array([0, 10, 6.5, 10, 0.0])).tolist() == [0]
    assert cycle_starts(np.array([0, 10, 5.9, 10, 0.0])).tolist() == [0, 2]
    assert np.flatnonzero(last_cycles(x, 0.4))[0] == 12
    assert np.flatnonzero(last_cycles(x, 2 / 3))[0] == 7
    for share in (0.3, 1.0):
        with pytest.raises(DataError, match=r"3 cycle"):
            last_cycles(x, share)


def test_a_reversal_of_a_tenth_of_the_range_ends_a_branch():
    """The second cycle, of a tenth of the range, adds samples to both branches."""
    for low, samples in ((0.901, 1), (0.899, 2)):
        over = np.concatenate([np.linspace(0, 1, 50), [low, 1], np.linspace(1, 0, 50)])
        assert [len(runs) for runs in _trimmed_runs(over).values()] == [samples, samples]


def test_a_branch_needs_five_places():
    few = np.array([0, 1, 2, 3, 4, 3, 2, 1, 0.0])
    assert len(split_cycles(few, {"y": few}, 5).over) == 5
    for samples in (4, 3):
        with pytest.raises(DataError, match=f"contraction branch was measured at {samples}"):
            split_cycles(few, {"y": few}, samples)
