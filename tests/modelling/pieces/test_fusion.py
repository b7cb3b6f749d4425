"""Weights: a partition of unity whatever the boundaries, zones, transitions and levels."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.modelling.pieces.weights import TRANSITIONS, cell_weights, level_weights, zones

increasing = (
    st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=8, unique=True).map(sorted).filter(lambda b: min(np.diff(b)) > 1e-6).map(np.array)
)
zone = st.floats(0, 0.5)
transition = st.sampled_from(sorted(TRANSITIONS))
seeds = st.integers(0, 2**32 - 1)


def points(seed, boundaries):
    width = boundaries[-1] - boundaries[0]
    rng = np.random.default_rng(seed)
    return np.concatenate([rng.uniform(boundaries[0] - width, boundaries[-1] + width, 200), boundaries])


@settings(deadline=None)
@given(increasing, zone, transition, seeds)
def test_cell_weights_are_a_partition_of_unity(boundaries, z_s, name, seed):
    weights = cell_weights(points(seed, boundaries), boundaries, name, z_s)
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-12)
    assert weights.min() >= -1e-12
    assert weights.max() <= 1 + 1e-12
    assert ((weights > 1e-12).sum(axis=1) <= 2).all()


@settings(deadline=None)
@given(increasing, transition, seeds, zone, zone)
def test_weights_of_two_variables_sum_to_one_as_products(boundaries, name, seed, z_a, z_b):
    x = points(seed, boundaries)
    a, b = cell_weights(x, boundaries, name, z_a), cell_weights(x[::-1], boundaries, name, z_b)
    np.testing.assert_allclose(np.einsum("ni,nj->n", a, b), 1, atol=1e-12)


@settings(deadline=None)
@given(
    increasing,
    seeds,
    st.sampled_from(["continue", "continue_linear", "saturate"]),
    st.sampled_from(["continue", "continue_linear", "saturate"]),
)
def test_level_weights_sum_to_one(levels, seed, below, above):
    weights = level_weights(points(seed, levels), levels, below, above)
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-9)


@settings(deadline=None)
@given(increasing, st.integers(0, 7))
def test_at_a_level_its_curve_alone_counts(levels, number):
    number %= len(levels)
    np.testing.assert_allclose(level_weights(levels[number : number + 1], levels), np.eye(len(levels))[number : number + 1], atol=1e-12)


def test_linear_continuation_reproduces_a_line_and_holding_does_not():
    levels = np.array([80.0, 150, 350])
    x = np.array([20.0, 80, 100, 350, 500])
    np.testing.assert_allclose(level_weights(x, levels, "continue_linear", "continue_linear") @ (3 * levels + 1), 3 * x + 1)
    np.testing.assert_allclose(level_weights(x, levels) @ levels, [80, 80, 100, 350, 350])
    np.testing.assert_allclose(level_weights(x, levels, "zero", "zero").sum(axis=1), [0, 1, 1, 1, 0])


def test_zones_are_those_of_the_paper():
    """M2 eq 10 and 11: seg_i - z (seg_i - seg_{i-1}) to seg_i + z (seg_{i+1} - seg_i)."""
    start, end = zones(np.array([0.0, 1, 3, 4]), 0.25)
    np.testing.assert_allclose(start, [0.75, 2.5])
    np.testing.assert_allclose(end, [1.5, 3.25])


def test_a_step_gives_the_boundary_to_the_left_segment():
    weights = cell_weights(np.array([0.999, 1.0, 1.001]), np.array([0.0, 1, 2]), "linear", 0.0)
    np.testing.assert_array_equal(weights, [[1, 0], [1, 0], [0, 1]])


@pytest.mark.parametrize("name", sorted(TRANSITIONS))
def test_transitions_rise_from_zero_to_one_and_are_antisymmetric(name):
    t = np.linspace(0, 1, 101)
    s = TRANSITIONS[name](t)
    np.testing.assert_allclose(s + s[::-1], 1, atol=1e-14)
    assert s[0] == 0
    assert s[-1] == 1
    assert (np.diff(s) > -1e-15).all()


def test_transitions_are_those_of_the_paper():
    np.testing.assert_allclose(
        [TRANSITIONS[name](np.array([0.25]))[0] for name in ("linear", "quadratic", "cubic")], [0.25, 0.125, 0.15625]
    )
