"""Direction of motion, and the plateau of a step response."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Signal
from mapmore_cli.modelling.signals.plateau import find_plateau, without_steady_state
from mapmore_cli.modelling.signals.rates import direction, needed_signals, with_signals

TIME = np.arange(0.0, 4.0, 0.001)


def step(rise: float = 0.15, at: float = 0.2, vent: float = 3.0, height: float = 250.0) -> np.ndarray:
    """A first-order rise from zero and a fall back."""
    up = height * (1 - np.exp(-np.clip(TIME - at, 0, None) / rise))
    return np.where(vent > TIME, up, up * np.exp(-np.clip(TIME - vent, 0, None) / rise))


rates = arrays(float, st.integers(1, 60), elements=st.floats(-20, 20))


@settings(deadline=None)
@given(rates, st.floats(0.1, 10))
def test_the_direction_is_latched_and_causal(rate: np.ndarray, dead_band: float) -> None:
    found = direction(rate, dead_band)
    last = 1.0
    for value, told in zip(rate, found, strict=True):  # the definition, sample by sample
        last = np.sign(value) if abs(value) > dead_band else last
        assert told == last
    assert np.array_equal(direction(rate[: len(rate) // 2 + 1], dead_band), found[: len(rate) // 2 + 1])


def test_a_noisy_staircase_changes_direction_only_where_it_turns() -> None:
    """Three steps up and three down, whose rate carries noise of a fifth of the dead band."""
    rate = np.concatenate([np.repeat([40.0, 0.0] * 3, 100), np.repeat([-40.0, 0.0] * 3, 100)])
    noisy = rate + np.random.default_rng(3).normal(0, 3.0, len(rate))
    found = direction(noisy, 15.0)
    assert np.flatnonzero(np.diff(found)).tolist() == [599]
    assert np.count_nonzero(np.diff(np.sign(noisy))) > 50  # a bare sign toggles on every tread


@settings(deadline=None, max_examples=30)
@given(st.floats(0.05, 0.3), st.floats(2.4, 3.4), st.floats(20, 600), st.integers(0, 5), st.floats(1e-3, 1e3))
def test_a_plateau_lies_between_rise_and_fall_in_any_unit(rise: float, vent: float, height: float, seed: int, scale: float) -> None:
    pressure = step(rise, 0.2, vent, height) + np.random.default_rng(seed).normal(0, 0.002 * height, len(TIME))
    strain = 0.1 * step(1.3 * rise, 0.3, vent, 1.0)
    start, end = find_plateau(TIME, pressure, {"strain": strain})
    assert 0.2 + 2.5 * rise < start < 0.3 + 6 * 1.3 * rise  # settled to 5 %: three time constants of the slower one
    assert vent - 0.05 < end < vent + 0.2 * rise
    assert find_plateau(TIME, scale * pressure, {"strain": scale * strain}) == pytest.approx((start, end), abs=0.002)


def test_the_slower_signal_settles_last() -> None:
    early, _ = find_plateau(TIME, step(), {})
    late, _ = find_plateau(TIME, step(), {"strain": step(0.4)})
    assert late > early + 0.3


@pytest.mark.parametrize(
    ("pressure", "words"),
    [
        (np.full(len(TIME), 250.0), "never rises"),
        (100 + np.random.default_rng(1).normal(0, 0.5, len(TIME)), "never rises"),
        (250 - np.abs(TIME - 2) * 125, "no plateau"),
    ],
    ids=["constant", "noise", "triangle"],
)
def test_what_has_no_plateau_is_refused(pressure: np.ndarray, words: str) -> None:
    with pytest.raises(DataError, match=words) as error:
        find_plateau(TIME, pressure, {})
    assert "plateau: [" in str(error.value.remedy)


def test_a_strain_that_never_rests_leaves_no_plateau() -> None:
    with pytest.raises(DataError, match="no plateau: pressure and strain rest"):
        find_plateau(TIME, step(), {"strain": np.sin(9 * TIME)})


def test_the_steady_state_is_the_mean_on_the_plateau() -> None:
    rest = np.array([5.0, 3.0, 4.0, -1.0])
    assert without_steady_state(rest, np.array([False, True, True, False])).tolist() == [1.5, -0.5, 0.5, -4.5]


def test_signals_follow_in_order_and_only_where_they_are_missing() -> None:
    signals = (Signal("strain_rate", "rate", "strain", 0.04, 3), Signal("way", "direction", "strain_rate", dead_band=0.01))
    columns = {"time": TIME, "strain": np.sin(2 * TIME)}
    found = with_signals(needed_signals(signals, ["way"]), columns)
    assert np.allclose(found["strain_rate"], 2 * np.cos(2 * TIME), atol=1e-4)
    moving = np.abs(found["strain_rate"]) > 0.01
    assert np.array_equal(found["way"][moving], np.sign(found["strain_rate"][moving]))
    assert with_signals(signals, {**columns, "strain_rate": -np.ones(len(TIME))})["way"][-1] == -1
    assert needed_signals(signals, ["strain"]) == ()
