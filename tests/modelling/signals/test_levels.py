from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mapmore_cli.modelling.signals.plateau import default_within, find_levels, match_levels


def held(levels: list[float], ripple: float, seed: int, samples: int = 2500) -> np.ndarray:
    """Pressures of load cycles: the regulator's ripple and noise about each level."""
    rng = np.random.default_rng(seed)
    phase = np.linspace(0, 60, samples)
    return np.concatenate([level + ripple * np.sin(phase) + rng.normal(0, ripple / 3, samples) for level in levels])


@settings(deadline=None, max_examples=40)
@given(ripple=st.floats(0.05, 4.0), seed=st.integers(0, 2**31), order=st.permutations([80.0, 150.0, 250.0, 350.0]))
def test_levels_of_rippling_pressure(ripple: float, seed: int, order: list[float]) -> None:
    np.testing.assert_allclose(find_levels(held(order, ripple, seed)), [80, 150, 250, 350], atol=ripple)


@settings(deadline=None)
@given(levels=st.lists(st.integers(-20, 20).map(lambda k: k * 0.0137), min_size=1, max_size=12, unique=True), count=st.integers(2, 30))
def test_constant_levels_are_found_exactly(levels: list[float], count: int) -> None:
    assume(len(levels) == 1 or np.ptp(levels) > 0.05 * np.abs(levels).max())  # closer ones are one level with ripple, by the rule
    np.testing.assert_array_equal(find_levels(np.repeat(levels, count)), np.sort(levels))


def test_holds_between_ramps_are_found_and_ramps_are_not() -> None:
    holds = np.linspace(-0.167, 0.668, 11)
    ramps = [np.linspace(a, b, 900) for a, b in pairwise(holds)]
    pieces = [np.full(2300, holds[0])] + [piece for ramp in ramps for piece in (ramp, np.full(2300, ramp[-1]))]
    noise = np.random.default_rng(3).normal(0, 1e-4, sum(map(len, pieces)))
    np.testing.assert_allclose(find_levels(np.concatenate(pieces) + noise), holds, atol=1e-3)


def test_steady_sweep_has_no_level() -> None:
    assert find_levels(np.linspace(0, 600, 15_000)).size == 0


def test_small_ripple_about_one_pressure_is_one_level() -> None:
    np.testing.assert_array_equal(find_levels(held([150.0], 1.5, seed=1)), [150.0])


def test_single_glitch_does_not_hide_the_levels() -> None:
    values = held([80.0, 150.0, 250.0], 1.0, seed=2)
    values[[7, 900]] = [1e6, -1e6]
    np.testing.assert_allclose(find_levels(values), [80, 150, 250], atol=1)


def test_level_is_written_no_finer_than_its_noise() -> None:
    found = find_levels(held([149.734, 351.2], 1.0, seed=5))
    np.testing.assert_array_equal(found, np.round(found, 1))


@settings(deadline=None)
@given(
    levels=st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=8, unique=True).map(np.array),
    values=st.lists(st.floats(-2e3, 2e3), min_size=1, max_size=50).map(np.array),
    within=st.floats(1e-3, 500),
)
def test_every_value_goes_to_its_nearest_level_or_to_none(levels: np.ndarray, values: np.ndarray, within: float) -> None:
    index = match_levels(values, levels, within)
    distance = np.abs(values[:, None] - levels)
    matched = index >= 0
    rounding = 1e-9 * within + 1e-11 * np.abs(values)
    assert (distance.min(axis=1)[matched] <= (within + rounding)[matched]).all()
    assert (distance.min(axis=1)[~matched] > within).all()
    nearest = distance[np.arange(len(values)), index]
    np.testing.assert_allclose(nearest[matched], distance.min(axis=1)[matched], atol=1e-9)


def test_half_way_belongs_to_the_lower_level() -> None:
    levels = np.array([250.0, 150.0])
    assert default_within(levels) == 50.0
    np.testing.assert_array_equal(match_levels(np.array([200.0, 200.001, 100.0, 99.9, 300.0]), levels, 50.0), [1, 0, 1, -1, 0])


def test_single_level_takes_everything() -> None:
    assert default_within(np.array([3.0])) == math.inf
    np.testing.assert_array_equal(match_levels(np.array([-1e9, 1e9]), np.array([3.0]), math.inf), [0, 0])


@pytest.mark.parametrize("at", [0.1, 1 / 3, 250.0])
def test_value_exactly_within_matches_however_it_was_rounded(at: float) -> None:
    assert match_levels(np.array([at + 0.1]), np.array([at]), 0.1) == 0
