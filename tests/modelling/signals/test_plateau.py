"""Levels at which a quantity was held, the plateau of a step response, directions and signals."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Signal
from mapmore_cli.modelling.signals.plateau import (
    default_within,
    find_levels,
    find_plateau,
    match_levels,
)
from mapmore_cli.modelling.signals.rates import FALL, RISE, direction, needed_signals, with_signals


def in_bins(**extra):
    """Four samples in each of 128 bins from 0 to 128, and more in some of them."""
    middles = np.arange(128) + 0.5
    middles[[0, -1]] = 0, 128
    return np.repeat(middles, [4 + extra.get(f"bin_{number}", 0) for number in range(128)])


@pytest.mark.parametrize(
    ("values", "levels"),
    [
        (in_bins(bin_20=4), []),  # 8 are less than twice the mean of 516/128
        (in_bins(bin_20=5), [20.5]),
        (in_bins(bin_20=5, bin_100=59), [100.5]),  # 9 are exactly twice the mean
        (np.append(np.tile(in_bins(bin_20=5), 4), [1e6, -1e6]), [20.5]),  # glitches
        (in_bins(bin_60=6, bin_62=6), [61.5]),
        (in_bins(bin_60=6, bin_63=6), [60.5, 63.5]),
        (np.linspace(-105.2, -100, 1000), [-103]),  # less than 5 % of its size
        (np.linspace(100, 105.4, 1000), []),
        (np.linspace(190, 200, 101), [195]),  # exactly 5 % of its size
        (np.append(np.zeros(5), np.linspace(100, 110, 995)), [105]),  # 0.5 % are no glitches
        (np.repeat([0, 60.5, 63.5, 128], [1, 50, 50, 1]), [60.5, 63.5]),  # nothing between them
        (np.repeat([0.0, 60.0, 128.0], [1, 50, 1]), [60]),  # at the lower edge of its bin
        (np.repeat([0.0, 128.0], [1, 50]), [128]),
        (np.arange(10.0), []),  # a single sample is not held
        *((np.full(3, value), [value]) for value in (0.0, -2.5)),
        *((149.73 + np.array([-a, 0, a]), [level]) for a, level in ((1.9, 150), (0.9, 149.7))),
        *(
            (2.0 / 3 + np.array([-a, 0, a]), [level])
            for a, level in ((1e-13, 2 / 3), (2e-12, 0.666666666667))
        ),
    ],
)
def test_bins_of_more_than_twice_the_mean_are_levels_and_written_as_finely_as_they_scatter(
    values, levels
):
    assert find_levels(values).tolist() == levels


def test_half_way_belongs_to_the_lower_level_and_a_single_one_takes_everything():
    levels = np.array([250.0, 150.0])
    assert default_within(levels) == 50.0
    np.testing.assert_array_equal(
        match_levels(np.array([200.0, 200.001, 100.0, 99.9, 300.0]), levels, 50.0), [1, 0, 1, -1, 0]
    )
    assert default_within(np.array([3.0])) == math.inf
    assert match_levels(np.array([0.0]), np.array([0.0]), 0.0) == 0
    np.testing.assert_array_equal(
        match_levels(np.array([-1e9, 1e9]), np.array([3.0]), math.inf), [0, 0]
    )


@pytest.mark.parametrize("at", [0.1, 1 / 3, 250.0])
def test_value_exactly_within_matches_however_it_was_rounded(at):
    assert match_levels(np.array([at + 0.1]), np.array([at]), 0.1) == 0
    beyond = np.array([999 - 1.9e-9, 999 - 2.1e-9])  # a relative 1e-9 and 1e-12 of the value
    assert match_levels(beyond, np.array([1000.0]), 1.0).tolist() == [0, -1]


TIME = np.arange(0.0, 4.0, 0.001)


rates = arrays(float, st.integers(1, 60), elements=st.floats(-20, 20))


@given(rates, st.floats(0.1, 10))
@example(np.array([-2.0]), 2.0)
def test_the_direction_is_latched_and_causal(rate, dead_band):
    found = direction(rate, dead_band)
    last = RISE
    for value, told in zip(rate, found, strict=True):  # the definition, sample by sample
        moves = RISE if value > 0 else FALL
        last = moves if abs(value) > dead_band else last
        assert told == last
    assert np.array_equal(
        direction(rate[: len(rate) // 2 + 1], dead_band), found[: len(rate) // 2 + 1]
    )


def ramped(held, after=20):
    """Rest for a second, a rise to 100 in steps of 10, each .1 s long, a hold, and rest again."""
    return np.concatenate(
        [np.zeros(10), np.arange(0, 100, 10.0), np.full(held, 100.0), np.zeros(after)]
    )


def test_a_plateau_is_a_band_around_the_final_value_in_any_unit():
    """It begins when the last signal is within 5 % of its span for good, ends when the first one
    leaves, and lasts half as long as the rise from a tenth to nine tenths.
    """
    time, first = np.arange(100) / 10 + 7, 20
    for held, after in ((30, 20), (30, 0), (6, 20)):
        pressure = ramped(held, after)
        found = find_plateau(time[: len(pressure)], pressure, {})
        assert found == pytest.approx((time[first], time[first + held - 1]))
    with pytest.raises(DataError, match=r"constant for 0\.4 s after a rise that takes 0\.9 s"):
        find_plateau(time[:45], ramped(5), {})
    pressure, strain = ramped(30), 4 * (np.arange(70) > 5)
    with pytest.raises(DataError, match="pressure and strain must stay constant"):
        find_plateau(time[:70], pressure, {"strain": np.sin(np.arange(70.0))})
    settled = find_plateau(time[:70], pressure, {"strain": 3.0 * strain})
    assert settled == pytest.approx((time[20], time[49]))
    moves = np.where(np.arange(70) < 26, 0.0, 1.0)
    moves[[30, 44]] = 0.96, 0.94
    for unit in (1e-3, 1.0, 1e3):
        found = find_plateau(time[:70], unit * pressure, {"strain": unit * moves})
        assert found == pytest.approx((time[26], time[43]))
    moves[32] = 1.06  # the band is left for a moment
    found = find_plateau(time[:70], pressure, {"strain": np.where(moves > 1, 0.9, moves)})
    assert found == pytest.approx((time[33], time[43]))
    even = np.arange(70) % 2 == 0
    assert find_plateau(time[:70], pressure + np.where(even, 2.2, -2.2), {})[0] == time[20]
    with pytest.raises(
        DataError, match=r"the pressure never rises; it stays between -2\.6 and 102\.6"
    ):
        find_plateau(time[:70], pressure + np.where(np.arange(70) % 2, 2.6, -2.6), {})


@pytest.mark.parametrize(
    ("pressure", "ends"),
    [
        ([0] * 10 + [25, 50, 75] + [100] * 3 + [0] * 9, (13, 15)),  # half as long as the rise
        ([0] * 10 + [25, 50, 75] + [100] * 2 + [0] * 9, None),
        ([0] * 10 + [50, 95] + [100] * 9 + [0] * 9, (11, 20)),  # 95 is exactly within 5 %
        ([100, 100, 0, 0, 0], (0, 1)),  # the record begins on the plateau
        ([100, 0, 0, 0], None),
    ],
)
def test_a_plateau_has_several_samples_and_at_least_half_the_length_of_the_rise(pressure, ends):
    values = np.array(pressure, dtype=float)
    time = np.arange(len(values)) * 1.0
    if ends is not None:
        assert find_plateau(time, values, {}) == ends
        return
    with pytest.raises(DataError, match="no plateau was found"):
        find_plateau(time, values, {})


@pytest.mark.parametrize("count", [1, 9])
def test_a_pressure_that_never_changes_never_rises(count):
    with pytest.raises(DataError, match="the pressure never rises; it stays between 3 and 3"):
        find_plateau(np.arange(count) * 1.0, np.full(count, 3.0), {})
    with pytest.raises(DataError, match="the pressure never rises"):  # two samples may be noise
        find_plateau(np.arange(2.0), np.array([0.0, 100.0]), {})


def test_signals_follow_in_order_and_only_where_they_are_missing():
    signals = (
        Signal("strain_rate", "rate", "strain", 0.04, 3),
        Signal("way", "direction", "strain_rate", dead_band=0.01),
    )
    columns = {"time": TIME, "strain": np.sin(2 * TIME)}
    found = with_signals(needed_signals(signals, ["way"]), columns)
    assert np.allclose(found["strain_rate"], 2 * np.cos(2 * TIME), atol=1e-4)
    moving = np.abs(found["strain_rate"]) > 0.01
    assert np.array_equal(found["way"][moving], np.sign(found["strain_rate"][moving]))
    assert with_signals(signals, {**columns, "strain_rate": -np.ones(len(TIME))})["way"][-1] == -1
    percent = replace(signals[0], factor=100.0, seconds=1e-3)  # a log whose clock counts ms
    told = with_signals([percent], columns | {"time": 1000 * TIME})["strain_rate"]
    np.testing.assert_allclose(told, 100 * found["strain_rate"], rtol=1e-6)
    assert needed_signals(signals, ["strain"]) == ()
