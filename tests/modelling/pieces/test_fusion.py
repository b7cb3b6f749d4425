"""Weights and M2 eq 9-12 to the letter: partitions of unity along inputs and levels, zones, limits of the domain, the weights drawn."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from surfaces import QUANTITIES, curves, recipe

from mapmore_cli.domain.models import Fusion
from mapmore_cli.modelling.expressions import Name, dictionary_matrix, parse
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.literature.backbone import fit_formula
from mapmore_cli.modelling.pieces.build import build
from mapmore_cli.modelling.pieces.definition import TRANSITIONS, cell_weights, weight_of, zones
from mapmore_cli.modelling.pieces.levels import across_levels
from mapmore_cli.modelling.program.values import evaluator
from mapmore_cli.modelling.program.writing import Writer


def increasing(width):
    lists = st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=8, unique=True).map(sorted)
    return lists.filter(lambda b: min(np.diff(b)) > width).map(np.array)


seeds = st.integers(0, 2**32 - 1)
sides = st.sampled_from(["continue", "continue_linear", "saturate"])


def points(seed, boundaries):
    width = boundaries[-1] - boundaries[0]
    rng = np.random.default_rng(seed)
    return np.concatenate([rng.uniform(boundaries[0] - width, boundaries[-1] + width, 200), boundaries])


@given(increasing(1e-6), st.floats(0, 0.5), st.sampled_from(sorted(TRANSITIONS)), seeds)
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


def interpolated(scheme, x, at, values, below="continue", above="continue"):
    """The values of the curves at their levels, (L,), interpolated at x, (n,), by the statements of the definition."""
    m, fusion = Writer(), Fusion(extrapolation={}, levels=scheme)
    value = across_levels(m, Name("x_x"), at.tolist(), (below, above), fusion, lambda _i, _j, number, _t: Name(f"x_v{number}"))
    program = m.program(["x", *(f"v{number}" for number in range(len(at)))], value)
    return evaluator(program)({"x": x, **{f"v{number}": np.full(len(x), own) for number, own in enumerate(values)}})[0]


@given(increasing(1e-2), seeds, sides, sides, st.floats(-1e3, 1e3), st.floats(-10, 10))
def test_a_constant_on_all_levels_is_added_to_the_result_and_weights_scale_with_nothing(at, seed, below, above, offset, factor):
    x, values = points(seed, at), np.random.default_rng(seed).normal(0, 10, len(at))
    plain = interpolated("pchip", x, at, values, below, above)
    moved = interpolated("pchip", x, at, factor * values + offset, below, above)
    np.testing.assert_allclose(moved, factor * plain + offset, atol=1e-6 * (1 + np.abs(plain).max()))


def level_weights(x, at, below="continue", above="continue"):
    """(n, L) weights of the triangles: the interpolants of curves that are one, and zero at all other levels."""
    return np.stack([interpolated("linear", x, at, own, below, above) for own in np.eye(len(at))], axis=1)


@given(increasing(1e-2), seeds, sides, sides)
def test_level_weights_are_a_partition_of_unity(at, seed, below, above):
    np.testing.assert_allclose(level_weights(points(seed, at), at, below, above).sum(axis=1), 1, atol=1e-9)
    np.testing.assert_array_equal(level_weights(at, at, below, above), np.eye(len(at)))


def test_linear_continuation_reproduces_a_line_and_holding_does_not():
    at = np.array([80.0, 150, 350])
    x = np.array([20.0, 80, 100, 350, 500])
    np.testing.assert_allclose(level_weights(x, at, "continue_linear", "continue_linear") @ (3 * at + 1), 3 * x + 1)
    np.testing.assert_allclose(level_weights(x, at) @ at, [80, 80, 100, 350, 350])
    np.testing.assert_allclose(level_weights(x, at, "zero", "zero").sum(axis=1), [0, 1, 1, 1, 0])


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
