"""Weights: a partition of unity whatever the boundaries, zones, transitions and levels."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.modelling.pieces.definition import TRANSITIONS, cell_weights, zones

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


def test_zones_are_those_of_the_paper():
    """M2 eq 10 and 11: seg_i - z (seg_i - seg_{i-1}) to seg_i + z (seg_{i+1} - seg_i)."""
    start, end = zones(np.array([0.0, 1, 3, 4]), 0.25)
    np.testing.assert_allclose(start, [0.75, 2.5])
    np.testing.assert_allclose(end, [1.5, 3.25])


def test_a_step_gives_the_boundary_to_the_left_segment():
    weights = cell_weights(np.array([0.999, 1.0, 1.001]), np.array([0.0, 1, 2]), "linear", 0.0)
    np.testing.assert_array_equal(weights, [[1, 0], [1, 0], [0, 1]])
