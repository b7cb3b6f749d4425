"""Between levels: shape-preserving interpolation and the share of a residual that is carried."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from mapmore_cli.domain.models import Fusion
from mapmore_cli.modelling.pieces.bands import bands

levels = (
    st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=7, unique=True).map(sorted).filter(lambda b: min(np.diff(b)) > 1e-2).map(np.array)
)
seeds = st.integers(0, 2**32 - 1)
sides = st.sampled_from(["continue", "continue_linear", "saturate"])


def between(seed, at, n=100):
    rng = np.random.default_rng(seed)
    return np.sort(rng.uniform(at[0], at[-1], n)), rng.normal(0, 10, len(at))


def constant(values, n):
    return np.repeat(values[None, :], n, axis=0)


def shape_preserving(x, at, values, below="continue", above="continue", shrink=1.0):
    """Each row of values, (n, L), interpolated at its own level value, (n,)."""
    edges, every = bands(at, (below, above), Fusion(extrapolation={}, levels="pchip", shrink=shrink))
    numbers = np.searchsorted(edges, x, side="right")
    y = np.empty(len(x))
    for number in np.unique(numbers):
        rows, band = np.flatnonzero(numbers == number), every[number]
        y[rows] = band.mix(x[rows], [values[rows, curve] for curve in band.curves])
    return y


def carried_share(x, at, shrink):
    return shape_preserving(x, at, np.ones((len(x), len(at))), shrink=shrink)


@settings(deadline=None)
@given(levels, seeds)
def test_agrees_with_scipys_pchip(at, seed):
    x, values = between(seed, at)
    np.testing.assert_allclose(shape_preserving(x, at, constant(values, len(x))), PchipInterpolator(at, values)(x), atol=1e-8)


@settings(deadline=None)
@given(levels, seeds)
def test_rows_are_independent_of_each_other(at, seed):
    """Every row has values of its own."""
    rng = np.random.default_rng(seed)
    values = rng.normal(0, 10, (20, len(at)))
    x = rng.uniform(at[0], at[-1], 20)
    expected = [PchipInterpolator(at, row)(place) for row, place in zip(values, x, strict=True)]
    np.testing.assert_allclose(shape_preserving(x, at, values), expected, atol=1e-8)


@settings(deadline=None)
@given(levels, seeds, sides, sides, st.floats(-1e3, 1e3), st.floats(-10, 10))
def test_weights_sum_to_one(at, seed, below, above, offset, factor):
    """A constant added to all curves is added to the result, also beyond the levels; the weights scale with nothing."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(2 * at[0] - at[-1], 2 * at[-1] - at[0], 100)
    values = constant(rng.normal(0, 10, len(at)), 100)
    plain = shape_preserving(x, at, values, below, above)
    moved = shape_preserving(x, at, factor * values + offset, below, above)
    np.testing.assert_allclose(moved, factor * plain + offset, atol=1e-6 * (1 + np.abs(plain).max()))


@settings(deadline=None)
@given(levels, seeds)
def test_levels_are_reproduced_exactly(at, seed):
    _, values = between(seed, at)
    np.testing.assert_array_equal(shape_preserving(at, at, constant(values, len(at))), values)


@settings(deadline=None)
@given(levels, seeds, st.floats(-5, 5), st.floats(-100, 100))
def test_lines_across_levels_stay_lines(at, seed, slope, offset):
    x, _ = between(seed, at)
    np.testing.assert_allclose(shape_preserving(x, at, constant(slope * at + offset, len(x))), slope * x + offset, atol=1e-6)


@settings(deadline=None)
@given(levels, seeds)
def test_monotone_values_stay_monotone_and_nothing_overshoots(at, seed):
    x, values = between(seed, at, n=400)
    rising = shape_preserving(x, at, constant(np.sort(values), len(x)))
    assert (np.diff(rising) >= -1e-9).all()
    y = shape_preserving(x, at, constant(values, len(x)))
    left = np.clip(np.searchsorted(at, x, side="right") - 1, 0, len(at) - 2)
    assert (y >= np.minimum(values[left], values[left + 1]) - 1e-9).all()
    assert (y <= np.maximum(values[left], values[left + 1]) + 1e-9).all()


@settings(deadline=None)
@given(levels, seeds)
def test_the_slope_has_no_jump_at_a_level(at, seed):
    _, values = between(seed, at)
    step = 1e-6 * np.diff(at).min()
    table = constant(values, len(at) - 2)
    inner = at[1:-1]
    here = shape_preserving(inner, at, table)
    before = (here - shape_preserving(inner - step, at, table)) / step
    after = (shape_preserving(inner + step, at, table) - here) / step
    np.testing.assert_allclose(before, after, atol=1e-3 * (1 + np.abs(np.diff(values) / np.diff(at)).max()))


def test_words_beyond_the_outermost_level():
    at = np.array([1.0, 2.0, 4.0])
    values = constant(np.array([1.0, 4.0, 16.0]), 2)
    x = np.array([0.0, 5.0])
    np.testing.assert_array_equal(shape_preserving(x, at, values), [1, 16])
    np.testing.assert_array_equal(shape_preserving(x, at, values, "zero", "zero"), [0, 0])
    pchip = PchipInterpolator(at, values[0])
    straight = [1 - pchip.derivative()(1.0), 16 + pchip.derivative()(4.0)]
    np.testing.assert_allclose(shape_preserving(x, at, values, "continue_linear", "continue_linear"), straight)


def test_one_level_holds_everywhere():
    np.testing.assert_array_equal(shape_preserving(np.array([0.0, 9.0]), np.array([5.0]), np.array([[3.0], [4.0]])), [3, 4])


@settings(deadline=None)
@given(levels, seeds, st.floats(0, 1))
def test_all_of_the_residual_at_the_levels_and_beyond_and_g_in_the_middle(at, seed, g):
    np.testing.assert_allclose(carried_share(at, at, g), 1)
    np.testing.assert_allclose(carried_share((at[1:] + at[:-1]) / 2, at, g), g, atol=1e-9)
    np.testing.assert_array_equal(carried_share(np.array([at[0] - 1, at[-1] + 1]), at, g), 1)
    x, _ = between(seed, at)
    share = carried_share(x, at, g)
    assert (share >= g - 1e-12).all()
    assert (share <= 1 + 1e-12).all()


def test_the_share_is_a_parabola():
    """g + (1 - g)(1 - 2t)^2 at a quarter of the way."""
    assert carried_share(np.array([2.5]), np.array([2.0, 4.0]), 0.4)[0] == pytest.approx(0.4 + 0.6 * 0.25)
