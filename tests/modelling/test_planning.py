"""What to measure next: points of maps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.gaussian_process import GaussianProcessRegressor, kernels

from mapmore_cli.annexes.planning import points
from mapmore_cli.modelling.validation.gaussian_process import most_likely


def test_a_fitted_process_agrees_with_scikit_learn():
    rng = np.random.default_rng(4)
    x, at = rng.random((25, 2)), rng.random((9, 2))
    own = most_likely(x, np.sin(3 * x[:, 0]) + x[:, 1] ** 2)
    kernel = own.deviation**2 * kernels.Matern(own.lengths, nu=2.5)
    other = GaussianProcessRegressor(kernel, alpha=own.noise**2, optimizer=None).fit(own.x, own.y)
    mean, deviation = other.predict(at, return_std=True)
    ours = own.predict(at)
    assert ours[0] == pytest.approx(mean, abs=1e-8)
    assert ours[1] == pytest.approx(deviation, abs=1e-6)


def map_of(count=9):
    x = np.random.default_rng(1).random((count, 2)) * [500.0, 0.25]
    x[:4] = [[0, 0], [500, 0], [0, 0.25], [500, 0.25]]
    return points.MeasuredMap(
        ("pressure", "strain"), x, x[:, 0] * (1 - 3 * x[:, 1]) + 100 * np.sin(20 * x[:, 1])
    )


def committee_of(measured):
    places = measured.grid(13)
    plane = (measured.x[:, 0] * 0.7, places[:, 0] * 0.7)
    return points.Committee(
        measured, places, {"none": (0 * measured.y, 0 * places[:, 0]), "plane": plane}
    )


@settings(max_examples=5)
@given(st.integers(6, 12))
def test_points_differ_and_make_the_map_surer(count):
    committee = committee_of(map_of(count))
    found, (before, after) = points.next_points(committee, ("pressure", "strain"), 5, {})
    assert len({tuple(one.at.values()) for one in found}) == 5
    assert (committee.deviation >= 0).all()
    assert after.mean() < before.mean()
    assert all(one.after <= one.half_width for one in found)


def test_a_dear_quantity_is_changed_seldom():
    names = ("pressure", "strain")
    free, _ = points.next_points(committee_of(map_of()), names, 6, {})
    dear, _ = points.next_points(
        committee_of(map_of()), names, 6, {"pressure": 1.0, "strain": 1000.0}
    )
    assert len({one.at["strain"] for one in dear}) < len({one.at["strain"] for one in free})
    assert dear[0].cost == 1001.0
    assert min(one.cost for one in dear) == 1.0


def test_places_lie_within_what_was_measured():
    x = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.2, 0.2]])
    grid = points.MeasuredMap(("a", "b"), x, x[:, 0]).grid(11)
    assert (grid.sum(axis=1) <= 1 + 1e-6).all()
    assert len(grid) == 66


def test_a_map_forecast_stops():
    found = points.until(committee_of(map_of()), 1e-9)
    assert found.more is None
    assert 0 < found.least <= found.widest
    assert points.until(committee_of(map_of()), 1e9).more == 0
