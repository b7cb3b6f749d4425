"""What to measure next: gaps of levels and points of maps."""

from itertools import count

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.gaussian_process import GaussianProcessRegressor, kernels

from mapmore_cli.domain.models import LeftOut
from mapmore_cli.modelling.planning import levels, points
from mapmore_cli.modelling.planning.points import GaussianProcess, fitted, matern
from mapmore_cli.modelling.validation.intervals import SHARES, half_widths


def left_out_of(places: list[float], errors: list[float], residual: float = 0.1, repeats: int = 1) -> LeftOut:
    """Levels whose inner ones err by so much when left out, half of it an offset."""
    e = np.array(errors)
    sizes = e[:, None] * SHARES
    counts = (repeats,) * len(places)
    kept = (np.array([10] * len(e)), 0.5 * e, np.sqrt(0.75) * e, sizes, tuple(places), counts, 400.0, residual)
    return LeftOut("levels", len(places), tuple(map(str, e)), *kept)


steps = st.lists(st.floats(1.0, 50.0), min_size=2, max_size=7)


@given(steps, st.floats(0.5, 20.0))
def test_where_errors_follow_distances_the_widest_gap_is_next(widths: list[float], rate: float) -> None:
    places = np.cumsum([0.0, *widths])
    errors = rate * (places[2:] - places[:-2]) ** levels.POWER
    expected = levels.gap_errors(places, errors)
    assert expected == pytest.approx(rate * np.diff(places) ** levels.POWER)
    assert widths[int(np.argmax(expected))] == pytest.approx(max(widths))


def test_gap_errors_by_hand() -> None:
    places, errors = np.array([0.0, 1.0, 3.0, 4.0]), np.array([3.0, 6.0])
    a, b = 3.0 / 3**0.75, 6.0 / 3**0.75
    assert levels.gap_errors(places, errors) == pytest.approx([a, (a + b) / 2 * 2**0.75, b])


@given(steps, st.floats(0.1, 500.0))
def test_the_forecast_counts_the_parts_that_every_gap_needs(widths: list[float], wanted: float) -> None:
    places = np.cumsum([0.0, *widths])
    data = left_out_of(places.tolist(), [30.0] * (len(widths) - 1), residual=1e-3)
    found, halves = levels.until(data, wanted), half_widths(data, (places[1:] + places[:-1]) / 2, 0.95)
    # one level more at a time, until each part is narrow enough
    assert found.more == sum(next(n for n in count() if half * (n + 1) ** -0.75 <= wanted * (1 + 1e-6)) for half in halves)
    assert found.least <= wanted * (1 + 1e-6) or found.more == 0


def test_candidates_are_the_middles_the_worst_first() -> None:
    found = levels.candidates(left_out_of([0.0, 100.0, 200.0, 300.0], [2.0, 20.0]), "pressure", 3.0)
    assert [one.at["pressure"] for one in found] == [250.0, 150.0, 50.0]
    assert all(one.kind == "between" and one.after <= one.half_width and one.cost == 3.0 for one in found)


def test_repeats_come_first_where_they_limit() -> None:
    found = levels.candidates(left_out_of([0.0, 1.0, 2.0], [1.0], residual=5.0, repeats=3), "strain")
    assert [one.kind for one in found] == ["repeat"] * 3 + ["between"] * 2
    assert found[0].after < found[0].half_width
    once = levels.candidates(left_out_of([0.0, 1.0, 2.0], [1.0], residual=5.0), "strain")
    assert np.isnan(once[0].half_width)


def test_a_forecast_knows_what_is_out_of_reach() -> None:
    out = levels.until(left_out_of([0.0, 100.0, 200.0, 300.0], [20.0, 20.0], residual=10.0), 5.0)
    assert out.more is None
    assert out.least >= 19.5


def test_a_process_of_two_points_by_hand() -> None:
    own = GaussianProcess(np.array([[0.0]]), np.array([2.0]), np.array([1.0]), 3.0, 0.5)
    k = float(matern(np.array([[0.0]]), np.array([[0.4]]), np.array([1.0]))[0, 0])
    mean, deviation = own.predict(np.array([[0.4]]))
    assert mean[0] == pytest.approx(9 * k * 2 / 9.25)
    assert deviation[0] == pytest.approx(np.sqrt(9 - (9 * k) ** 2 / 9.25))


def test_a_fitted_process_agrees_with_scikit_learn() -> None:
    rng = np.random.default_rng(4)
    x, at = rng.random((25, 2)), rng.random((9, 2))
    own = fitted(x, np.sin(3 * x[:, 0]) + x[:, 1] ** 2)
    kernel = own.deviation**2 * kernels.Matern(own.lengths, nu=2.5)
    other = GaussianProcessRegressor(kernel, alpha=own.noise**2, optimizer=None).fit(own.x, own.y)
    mean, deviation = other.predict(at, return_std=True)
    ours = own.predict(at)
    assert ours[0] == pytest.approx(mean, abs=1e-8)
    assert ours[1] == pytest.approx(deviation, abs=1e-6)


def map_of(count: int = 9) -> points.Measured:
    x = np.random.default_rng(1).random((count, 2)) * [500.0, 0.25]
    x[:4] = [[0, 0], [500, 0], [0, 0.25], [500, 0.25]]
    return points.Measured(("pressure", "strain"), x, x[:, 0] * (1 - 3 * x[:, 1]) + 100 * np.sin(20 * x[:, 1]))


def committee_of(measured: points.Measured) -> points.Committee:
    places = measured.grid(13)
    plane = (measured.x[:, 0] * 0.7, places[:, 0] * 0.7)
    return points.Committee(measured, places, {"none": (0 * measured.y, 0 * places[:, 0]), "plane": plane})


@settings(max_examples=5, deadline=None)
@given(st.integers(6, 12))
def test_points_differ_and_make_the_map_surer(count: int) -> None:
    committee = committee_of(map_of(count))
    found, (before, after) = points.chosen(committee, ("pressure", "strain"), 5, {})
    assert len({tuple(one.at.values()) for one in found}) == 5
    assert (committee.deviation >= 0).all()
    assert after.mean() < before.mean()
    assert all(one.after <= one.half_width for one in found)


def test_a_dear_quantity_is_changed_seldom() -> None:
    names = ("pressure", "strain")
    free, _ = points.chosen(committee_of(map_of()), names, 6, {})
    dear, _ = points.chosen(committee_of(map_of()), names, 6, {"pressure": 1.0, "strain": 1000.0})
    assert len({one.at["strain"] for one in dear}) < len({one.at["strain"] for one in free})
    assert dear[0].cost == 1001.0
    assert min(one.cost for one in dear) == 1.0


def test_places_lie_within_what_was_measured() -> None:
    x = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.2, 0.2]])
    grid = points.Measured(("a", "b"), x, x[:, 0]).grid(11)
    assert (grid.sum(axis=1) <= 1 + 1e-6).all()
    assert len(grid) == 66


def test_a_map_forecast_stops() -> None:
    found = points.until(committee_of(map_of()), 1e-9)
    assert found.more is None
    assert 0 < found.least <= found.widest
    assert points.until(committee_of(map_of()), 1e9).more == 0
