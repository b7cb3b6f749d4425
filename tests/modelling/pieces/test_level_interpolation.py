"""Between levels: shape-preserving interpolation and the share of a residual that is carried."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from mapmore_cli.domain.models import Fusion
from mapmore_cli.modelling.expressions import Name
from mapmore_cli.modelling.pieces.levels import across_levels
from mapmore_cli.modelling.program.values import evaluator
from mapmore_cli.modelling.program.writing import Writer

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


def interpolated(scheme, x, at, values, below="continue", above="continue", shrink=1.0):
    """Each row of values, (n, L), interpolated at its own level value, (n,), by the statements of the definition."""
    m, fusion = Writer(), Fusion(extrapolation={}, levels=scheme, shrink=shrink)
    value = across_levels(m, Name("x_x"), at.tolist(), (below, above), fusion, lambda _i, _j, number, _t: Name(f"x_v{number}"))
    program = m.program(["x", *(f"v{number}" for number in range(len(at)))], value)
    return evaluator(program)({"x": x, **{f"v{number}": column for number, column in enumerate(values.T)}})[0]


shape_preserving = partial(interpolated, "pchip")


def level_weights(x, at, below="continue", above="continue"):
    """(n, L) weights of the triangles: the interpolants of curves that are one, and zero at all other levels."""
    return np.stack([interpolated("linear", x, at, constant(own, len(x)), below, above) for own in np.eye(len(at))], axis=1)


def carried_share(x, at, shrink):
    return shape_preserving(x, at, np.ones((len(x), len(at))), shrink=shrink)


@settings(deadline=None)
@given(levels, seeds)
def test_agrees_with_scipys_pchip(at, seed):
    x, values = between(seed, at)
    np.testing.assert_allclose(shape_preserving(x, at, constant(values, len(x))), PchipInterpolator(at, values)(x), atol=1e-8)


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


@settings(deadline=None)
@given(levels, seeds, sides, sides)
def test_level_weights_sum_to_one(at, seed, below, above):
    rng = np.random.default_rng(seed)
    x = np.concatenate([rng.uniform(2 * at[0] - at[-1], 2 * at[-1] - at[0], 100), at])
    np.testing.assert_allclose(level_weights(x, at, below, above).sum(axis=1), 1, atol=1e-9)
    np.testing.assert_array_equal(level_weights(at, at, below, above), np.eye(len(at)))


def test_linear_continuation_reproduces_a_line_and_holding_does_not():
    at = np.array([80.0, 150, 350])
    x = np.array([20.0, 80, 100, 350, 500])
    np.testing.assert_allclose(level_weights(x, at, "continue_linear", "continue_linear") @ (3 * at + 1), 3 * x + 1)
    np.testing.assert_allclose(level_weights(x, at) @ at, [80, 80, 100, 350, 350])
    np.testing.assert_allclose(level_weights(x, at, "zero", "zero").sum(axis=1), [0, 1, 1, 1, 0])
