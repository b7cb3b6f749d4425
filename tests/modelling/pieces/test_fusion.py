"""Weights and M2 eq 9-12 to the letter: partitions of unity along inputs and levels, zones, limits of the domain, the weights drawn."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from surfaces import QUANTITIES, curves, recipe

from mapmore_cli.modelling.expressions import dictionary_matrix, parse
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.literature.backbone import fit_formula
from mapmore_cli.modelling.pieces.build import build
from mapmore_cli.modelling.pieces.definition import TRANSITIONS, cell_weights, weight_of, zones


def increasing(width):
    lists = st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=8, unique=True).map(sorted)
    return lists.filter(lambda b: min(np.diff(b)) > width).map(np.array)


@given(increasing(1e-6), st.floats(0, 0.5), st.sampled_from(sorted(TRANSITIONS)), st.integers(0, 2**32 - 1))
def test_cell_weights_are_a_partition_of_unity(boundaries, z_s, name, seed):
    width = boundaries[-1] - boundaries[0]
    anywhere = np.random.default_rng(seed).uniform(boundaries[0] - width, boundaries[-1] + width, 200)
    weights = cell_weights(np.concatenate([anywhere, boundaries]), boundaries, name, z_s)
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


def model_of(samples=None, **changes):
    return build("m", samples or curves(), recipe(**changes), QUANTITIES)


def function(segment, x):
    """A segment function from its numbers (M2 eq 8)."""
    z = segment.scaling.slope[0] * x + segment.scaling.intercept[0]
    terms = dictionary_matrix([parse(term) for term in segment.terms], {"strain": z}, len(x))
    return segment.scaling.y_slope * (terms @ segment.theta) + segment.scaling.y_intercept


def test_limits_of_the_domain_are_those_of_the_longest_curve():
    """At 80 kPa the curve ends at a strain of 0.09, the domain at 0.225 (M2 eq 12)."""
    model, own = (model_of(limits=limits, extrapolation={"strain": ("saturate", "saturate")}) for limits in ("domain", "curve"))
    free = model_of(extrapolation={"strain": ("continue", "continue")})
    assert model.body.fusion.domain == {"strain": (0.0, pytest.approx(0.225))}
    at = {"pressure": np.full(3, 80.0), "strain": np.array([0.05, 0.15, 0.3])}
    inside, beyond = predict(model, at)[:2], predict(model, at)[2]
    np.testing.assert_allclose(inside, predict(free, at)[:2])
    assert beyond == pytest.approx(predict(free, {"pressure": np.array([80.0]), "strain": np.array([0.225])})[0])
    assert predict(own, at)[1] == pytest.approx(predict(own, {"pressure": np.array([80.0]), "strain": np.array([0.09])})[0])


@pytest.mark.parametrize("extrapolation", ["continue", "zero", "saturate"])
def test_weights_make_the_model(extrapolation):
    """The weights times the segment functions are what is added to the backbone."""
    samples = curves(held_out=())
    formula = fit_formula("polynomial_2", samples, "force")
    made = recipe(shrink=0.3, hold="none", max_terms=1, extrapolation={"pressure": (extrapolation, extrapolation)})
    model = build("m", samples, made, QUANTITIES, formula)
    rng = np.random.default_rng(0)
    at = {"pressure": rng.uniform(60, 380, 200), "strain": rng.uniform(0.0, 0.085, 200)}
    segments = model.body.segments
    pieces = sum(weight_of(model.body, {segment.id}, at) * function(segment, at["strain"]) for segment in segments)
    bare = replace(model, body=replace(model.body, backbone=None))
    np.testing.assert_allclose(pieces, predict(bare, at), atol=1e-6)
    middle = {"pressure": np.array([200.0]), "strain": np.array([0.03])}
    assert weight_of(model.body, {segment.id for segment in segments}, middle) == pytest.approx([0.3])
    assert sum(weight_of(model.body, {segment.id}, middle) for segment in segments) == pytest.approx([0.3])
