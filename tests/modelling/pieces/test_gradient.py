"""Boundaries at changes of slope, under noise and spikes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.modelling.pieces.recipe import Cuts
from mapmore_cli.modelling.pieces.segmentation import gradient_boundaries, slope_change
from mapmore_cli.modelling.signals.rates import running_median

SEEDS = 100


def bent(seed, corners, slopes, n=400, noise=0.01, spikes=4):
    """Straight pieces over [0, 1] with noise, and local spikes of a few neighbouring samples, many times as high as the noise."""
    rng = np.random.default_rng(seed)
    x = np.sort(rng.uniform(0, 1, n))
    knots = np.array([0, *corners, 1])
    y = np.interp(x, knots, np.concatenate([[0], np.cumsum(np.array(slopes) * np.diff(knots))]))
    y = y + rng.normal(0, noise, n)
    for start in rng.integers(0, n - 4, spikes):
        y[start : start + rng.integers(1, 5)] += rng.choice([-1, 1]) * rng.uniform(0.5, 1.5)
    return x, y


def found(count, corners, slopes, window=0.1, **how):
    """Number of seeds for which every corner has a boundary within one window."""
    hits = 0
    for seed in range(SEEDS):
        boundaries = gradient_boundaries(*bent(seed, corners, slopes, **how), Cuts("gradient", count, window=window))
        hits += all(len(boundaries) and np.abs(boundaries - corner).min() <= window for corner in corners)
    return hits


@pytest.mark.parametrize("corner", [0.25, 0.5, 0.8])
def test_a_planted_change_of_slope_is_found_under_noise_and_spikes(corner):
    assert found(2, [corner], [2.0, 0.2]) >= 95


def test_two_planted_changes_are_found():
    assert found(3, [0.3, 0.65], [1.5, -0.5, 1.0]) >= 95


def test_a_moving_average_alone_would_follow_the_spikes():
    """The counter-check: without the median the same data mislead."""

    def unprotected(x, y):
        grid = np.linspace(0, 1, 101)
        mean = np.array([y[np.abs(x - g) <= 0.05].mean() for g in grid])
        change = np.abs(mean[20:] - 2 * mean[10:-10] + mean[:-20])
        return grid[10:-10][np.argmax(change)]

    assert sum(abs(unprotected(*bent(seed, [0.5], [2.0, 0.2])) - 0.5) <= 0.1 for seed in range(SEEDS)) < 80


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 1000), st.integers(1, 8), st.floats(0.03, 0.3), st.floats(0.05, 0.4))
def test_boundaries_keep_their_distance(seed, count, window, separation):
    boundaries = gradient_boundaries(*bent(seed, [0.5], [2.0, 0.2]), Cuts("gradient", count, window=window, separation=separation))
    assert len(boundaries) <= count - 1
    assert (np.diff([0.0, *boundaries, 1.0]) >= separation - 0.02).all()  # the samples end a little inside of [0, 1]
    assert (np.diff(boundaries) >= separation).all()


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 1000), st.floats(1e-3, 1e3), st.floats(1e-3, 1e3), st.floats(-1e3, 1e3))
def test_units_and_the_order_of_rows_do_not_matter(seed, a, b, offset):
    x, y = bent(seed, [0.4], [2.0, 0.2])
    plain = gradient_boundaries(x, y, Cuts("gradient", 3))
    order = np.random.default_rng(seed).permutation(len(x))
    np.testing.assert_array_equal(gradient_boundaries(x[order], y[order], Cuts("gradient", 3)), plain)
    np.testing.assert_allclose(gradient_boundaries(a * x, b * y + offset, Cuts("gradient", 3)), a * plain, rtol=1e-6)


def test_a_straight_line_changes_its_slope_nowhere():
    x = np.linspace(-3, 5, 300)
    _, change = slope_change(x, 7 * x - 2, 1.0)
    np.testing.assert_allclose(change, 0, atol=1e-9)


def test_the_change_at_a_corner_is_that_of_the_slopes():
    x = np.linspace(0, 1, 2001)
    grid, change = slope_change(x, np.where(x < 0.5, 3 * x, 1.5 - (x - 0.5)), 0.1)
    assert grid[np.argmax(np.abs(change))] == pytest.approx(0.5, abs=0.02)
    assert change[np.argmax(np.abs(change))] == pytest.approx(-4, rel=0.3)  # the corner is rounded over a window


def test_no_segment_of_its_own_for_a_gap():
    """Both rims of a gap look like corners; a boundary at each would leave a segment without samples."""
    x = np.concatenate([np.linspace(0, 0.3, 100), np.linspace(0.7, 1, 100)])
    boundaries = gradient_boundaries(x, np.sin(6 * x), Cuts("gradient", 5))
    assert np.histogram(x, [0, *boundaries, 1])[0].min() >= 5


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 1000), st.integers(1, 4))
def test_the_running_median_does_not_see_a_narrow_spike(seed, width):
    x = np.linspace(0, 1, 401)
    start = np.random.default_rng(seed).integers(0, 401 - width)
    y = 3 * x
    y[start : start + width] += 100
    at, smooth = running_median(x, y, 0.1)
    np.testing.assert_allclose(smooth, 3 * at, atol=0.1)
