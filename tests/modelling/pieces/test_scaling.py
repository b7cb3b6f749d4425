"""Scaling: the unit square, its anchors, and what changes of unit may not change."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.modelling.pieces.build import placements, scaled

seeds = st.integers(0, 2**32 - 1)


def falling(seed, n=60):
    rng = np.random.default_rng(seed)
    x = np.sort(rng.uniform(0.02, 0.1, n))
    return x, 700 * np.exp(-x / 0.05) - 50 + rng.normal(0, 2, n)


@settings(deadline=None)
@given(seeds)
def test_unit_square_spans_one_unit_from_the_anchor(seed):
    x, y = falling(seed)
    left, right = placements("unit_square", x[:, None], y, ["strain"])
    assert (left.placement, right.placement) == ("left", "right")
    for scaling, ends in ((left, (0, 1)), (right, (-1, 0))):
        z = scaled(scaling, {"strain": x})["strain"]
        np.testing.assert_allclose([z.min(), z.max()], ends, atol=1e-12)
        y_scaled = (y - scaling.y_intercept) / scaling.y_slope
        assert np.ptp(y_scaled) == pytest.approx(1)


def test_the_anchor_does_not_hang_on_one_noisy_sample():
    x = np.linspace(0, 1, 100)
    y = 5 - 3 * x
    spoilt = y.copy()
    spoilt[0] += 2.0
    left = placements("unit_square", x[:, None], spoilt, ["x"])[0]
    assert abs(left.y_intercept - y[:5].mean()) == pytest.approx(2.0 / 5)
    assert abs(left.y_intercept - spoilt[0]) > 1.0


@settings(deadline=None)
@given(seeds, st.floats(1e-3, 1e3), st.floats(1e-3, 1e3))
def test_positive_units_do_not_show_in_scaled_data(seed, a, b):
    x, y = falling(seed)
    for plain, other in zip(
        placements("unit_square", x[:, None], y, ["x"]), placements("unit_square", a * x[:, None], b * y, ["x"]), strict=True
    ):
        np.testing.assert_allclose(scaled(plain, {"x": x})["x"], scaled(other, {"x": a * x})["x"], atol=1e-9)
        np.testing.assert_allclose((y - plain.y_intercept) / plain.y_slope, (b * y - other.y_intercept) / other.y_slope, atol=1e-9)


@settings(deadline=None)
@given(seeds)
def test_the_order_of_rows_does_not_matter(seed):
    x, y = falling(seed)
    x = np.round(x, 3)  # equal strains, so that the end value has ties to break
    order = np.random.default_rng(seed).permutation(len(x))
    for one, two in zip(
        placements("unit_square", x[:, None], y, ["x"]), placements("unit_square", x[order, None], y[order], ["x"]), strict=True
    ):
        assert one.y_intercept == pytest.approx(two.y_intercept, rel=1e-12)
        np.testing.assert_array_equal(one.slope, two.slope)


def test_every_corner_of_two_variables_is_offered():
    X = np.random.default_rng(0).uniform(size=(50, 2))
    assert [s.placement for s in placements("unit_square", X, X[:, 0], ["a", "b"])] == [
        "left,left",
        "left,right",
        "right,left",
        "right,right",
    ]
    assert len(placements("unit_square", np.random.default_rng(0).uniform(size=(50, 5)), X[:, 0], list("abcde"))) == 2


def test_max_abs_divides_without_offset():
    (scaling,) = placements("max_abs", np.array([[-4.0], [2.0]]), np.array([10.0, -20]), ["x"])
    np.testing.assert_allclose([scaling.slope[0], scaling.intercept[0], scaling.y_slope, scaling.y_intercept], [0.25, 0, 20, 0])


def test_constant_variables_and_constant_force_divide_by_nothing():
    X = np.full((10, 1), 3.0)
    for rule in ("unit_square", "max_abs", "none"):
        for scaling in placements(rule, X, np.zeros(10), ["x"]):
            assert np.isfinite(scaling.slope).all()
            assert scaling.y_slope > 0


def test_unknown_rule():
    with pytest.raises(ValueError, match="unit_square"):
        placements("zscore", np.ones((3, 1)), np.ones(3), ["x"])
