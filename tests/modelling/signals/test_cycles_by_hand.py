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
        ([0, 0, 1, 1, 0, 0, 1], [0, 2, 4, 6]),  # the first of equal values
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
    assert cycle_starts(np.array([0, 0.5, 10, 0])).tolist() == [1]  # a twentieth is still at rest
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


@pytest.mark.parametrize(
    ("over", "places", "squares"),
    [  # a rise from 0 to 10 and a fall to 4: 9 and 10 have one bin
        ([*range(11), *range(9, 3, -1)], [4, 5, 6, 7, 8, 9.5], [16, 25, 36, 49, 64, 90.5]),
        # a fall from 6 to 0 and a rise to 10: 5 and 6 have one bin
        ([*range(6, -1, -1), *range(1, 11)], [0, 1, 2, 3, 4, 5.5], [0, 1, 4, 9, 16, 30.5]),
    ],
)
def test_branches_are_averaged_in_bins_over_their_common_range(over, places, squares):
    over = np.array(over, dtype=float)
    found = split_cycles(over, {"y": over**2}, 6)
    assert found.over == pytest.approx(np.linspace(places[0], places[-1], 6))
    for branch in (found.contraction, found.extension):
        assert branch["y"] == pytest.approx(np.interp(found.over, places, squares))


@pytest.mark.parametrize("sign", [1, -1])
def test_the_grid_lies_within_the_means_of_both_branches(sign):
    """A straight line stays straight up to both ends, although the means differ there."""
    rise = np.array([0, 0.1, 0.2, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9.9, 10])
    over = np.concatenate([rise, np.arange(9.7, 0, -0.7)])
    over = over if sign == 1 else (10 - over)
    found = split_cycles(over, {"y": over}, 8)
    for branch in (found.contraction, found.extension):
        assert branch["y"] == pytest.approx(found.over)


def test_a_branch_needs_five_places():
    few = np.array([0, 1, 2, 3, 4, 3, 2, 1, 0.0])
    assert len(split_cycles(few, {"y": few}, 5).over) == 5
    for samples in (4, 3):
        with pytest.raises(DataError, match=f"contraction branch was measured at {samples}"):
            split_cycles(few, {"y": few}, samples)
