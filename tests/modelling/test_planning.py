"""What to measure next: points of maps."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from reading import refused
from scipy.stats import multivariate_normal
from sklearn.gaussian_process import GaussianProcessRegressor, kernels
from surfaces import QUANTITIES, curves

from mapmore_cli.annexes.planning import of_points, planning, points
from mapmore_cli.annexes.planning.of_points import formulas_of
from mapmore_cli.annexes.planning.results import Until
from mapmore_cli.domain.errors import SpecError, UsageError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.literature.backbone import fit_formula
from mapmore_cli.modelling.validation.gaussian_process import GaussianProcess, most_likely
from mapmore_cli.modelling.validation.intervals import NORMAL


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


def test_a_fitted_process_is_likelier_than_its_neighbours():
    rng = np.random.default_rng(4)
    x = rng.random((25, 2))
    y = np.sin(6 * x[:, 0]) + x[:, 1] ** 2 + 0.2 * rng.normal(size=25)
    y -= y.mean()
    own = most_likely(x, y)
    start = [*own.lengths, own.deviation, own.noise]

    def likelihood(numbers):
        *lengths, deviation, noise = numbers
        made = GaussianProcess(x, y, np.array(lengths), deviation, noise)
        return multivariate_normal(np.zeros(25), made.covariance).logpdf(y)

    for place in range(4):
        for factor in (0.9, 1.1):
            other = [value * (factor if i == place else 1) for i, value in enumerate(start)]
            assert likelihood(other) < likelihood(start)


def test_a_process_of_zeros_has_the_smallest_deviation():
    found = most_likely(np.random.default_rng(4).random((9, 2)), np.zeros(9))
    assert found.deviation == pytest.approx(0.3)


def test_a_process_has_its_parameters_within_their_bounds():
    x = np.linspace(0, 1, 20)
    smooth, alternating = (
        most_likely(x[:, None], y) for y in (np.sqrt(12) * (x - 0.5), np.tile([-1.0, 1.0], 10))
    )
    size = np.std(smooth.y)
    assert (smooth.deviation / size, smooth.noise / size) == pytest.approx((3.0, 1e-3))
    assert (alternating.noise, *alternating.lengths) == pytest.approx((0.5, 0.1))


def map_of():
    x = np.random.default_rng(1).random((9, 2)) * [500.0, 0.25]
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


@pytest.mark.parametrize("prices", [{}, {"strain": 5.0}, {"pressure": 0.5, "strain": 3.0}])
def test_the_next_point_is_worth_most_for_its_cost(prices):
    """A value of a quantity that no planned point has costs its price, 1 where none is named; a
    point costs the lowest price at least.
    """
    measured = map_of()
    free = np.arange(len(measured.grid(13))) % 3 > 0
    names = measured.names
    found, _ = points.next_points(committee_of(measured), names, 4, prices, free)
    committee, planned = committee_of(measured), []
    each = [prices.get(name, 1.0) for name in names]
    for one in found:
        new = [[all(place[i] != one[i] for one in planned) for i in (0, 1)]
               for place in committee.places.tolist()]  # fmt: skip
        cost = np.maximum(np.array(new) @ each, min(each)) if prices else np.ones(len(new))
        best = int(np.argmax(np.where(free, committee.score / cost, -1)))
        planned.append(committee.places[best].tolist())
        assert [*one.at.values()] == planned[-1]
        assert (one.cost, one.half_width) == (cost[best], committee.half[best])
        assert one.error == committee.error[best]
        committee.add(best)
        assert one.after == committee.half[best]


def test_what_a_place_is_worth():
    """Spread times deviation, .15 of it where less than 2 % of the largest value is expected; of a
    single process the variance.
    """
    measured = map_of()
    for committee in (committee_of(measured), points.Committee(measured, measured.grid(13),
            {"none": (0 * measured.y, np.zeros(len(measured.grid(13))))})):  # fmt: skip
        largest = np.abs(measured.y).max()
        spread = committee.spread if committee.spread.any() else committee.deviation
        slack = np.where(np.abs(committee.expected) < 0.02 * largest, 0.15, 1.0)
        assert set(slack) == {0.15, 1.0}
        np.testing.assert_allclose(committee.score, spread * committee.deviation * slack)
        np.testing.assert_allclose(committee.error**2, committee.spread**2 + committee.deviation**2)
        np.testing.assert_allclose(
            (committee.half / 1.959964) ** 2, committee.error**2 + committee.noise**2
        )


def test_members_agree_at_a_planned_point_on_what_they_expected_together():
    committee = committee_of(map_of())
    place = int(np.argmax(committee.spread))
    before = committee.expected[place], committee.spread[place]
    committee.add(place)
    assert committee.expected[place] == pytest.approx(before[0], abs=0.01 * before[1])
    assert committee.spread[place] < 0.01 * before[1]


def test_many_samples_are_spread_out_and_grid_places_near_samples_are_measured(monkeypatch):
    monkeypatch.setattr(points, "MOST_MEASURED", 3)
    x = np.array([[0.0, 0.0], [10.0, 0.1], [10.0, 1.0], [9.0, 0.9]])
    taken, y = points.spread_out(x, np.arange(4.0))
    assert (taken.tolist(), y.tolist()) == (x[[0, 2, 1]].tolist(), [0, 2, 1])
    assert points.spread_out(x[:3], y)[0].tolist() == x[:3].tolist()  # in their own order
    assert len(points.spread_out(np.repeat(x[:2], 3, axis=0), np.arange(6.0))[1]) == 2
    measured = points.MeasuredMap(("a", "b"), x, y)
    at = np.array([[5.0, 0.5], [5.48, 0.5], [5.52, 0.5], [5.0, 0.552]])
    near = measured.unmeasured(at, np.array([[5.0, 0.5]]), 11)
    assert near.tolist() == [False, False, True, True]  # half a step is .5 and .05
    line = points.MeasuredMap(("a",), np.array([[0.0], [8.0]]), np.zeros(2))
    near = line.unmeasured(np.array([[5.0], [5.01]]), np.array([[4.0]]), 5)
    assert near.tolist() == [False, True]  # half a step of 2 belongs to the sample


def at_levels(*levels, held_out=()):
    made = curves(levels=levels, held_out=held_out, n=20)
    return Dataset("force", "pressure", QUANTITIES, (), made)


def test_the_middle_of_the_widest_gap_comes_first():
    """Of equal gaps the lower one; held-out levels are measured already."""
    given = at_levels(100.0, 200.0, 300.0, 400.0, 700.0, held_out=(300.0,))
    found, shown, forecast, (note,) = planning._of_levels("a", given, {"pressure": 3.0})
    assert [(one.at["pressure"], one.gap) for one in found] == [
        (550.0, 300.0),
        (150.0, 100.0),
        (250.0, 100.0),
        (350.0, 100.0),
    ]
    assert "from 400 to 700" in note
    assert (forecast, shown.places["pressure"].tolist()) == (None, [100, 200, 300, 400, 700])
    assert len(planning._of_levels("a", at_levels(100.0, 200.0), {})[0]) == 1
    with refused("only one level of pressure"):
        planning._of_levels("a", at_levels(100.0), {})
    with refused("--cost strain: the plan does not choose this quantity", error=UsageError):
        planning._of_levels("a", given, {"pressure": 3.0, "strain": 1.0})


def test_formulas_that_stay_within_twice_the_measured_range_are_members():
    given = at_levels(80.0, 150.0, 250.0)
    columns = {name: np.concatenate([c.columns[name] for c in given.curves]) for name in QUANTITIES}
    x, y = np.column_stack([columns["pressure"], columns["strain"]]), columns["force"]
    measured, places = points.MeasuredMap(("pressure", "strain"), x, y), x[::7] * [1.0, 0.9]
    said = formulas_of(given, measured, places)
    assert list(said) == ["none", "sarosi_hinged", "sarosi"]
    assert [(not one.any(), len(one)) for one in said["none"]] == [(True, 60), (True, 9)]
    fit = fit_formula("sarosi", given.curves, "force")
    for at, values in zip((x, places), said["sarosi"], strict=True):
        inputs = dict(zip(("pressure", "strain"), at.T, strict=True))
        np.testing.assert_allclose(values, literature.of(fit).predict(fit.parameters, inputs))
    for share, members in ((1.95, True), (2.05, False)):
        low, high = y.min(), y.min() + share * np.ptp(y)
        far = np.column_stack([np.linspace(250, 9000, 4000), np.zeros(4000)])
        inputs = dict(zip(("pressure", "strain"), far.T, strict=True))
        reached = literature.of(fit).predict(fit.parameters, inputs)
        out = far[[int(np.argmin(np.abs(reached - high)))]]
        assert low < high
        assert ("sarosi" in formulas_of(given, measured, out)) == members
    other = replace(given, target="strain")
    assert list(formulas_of(other, measured, places)) == ["none"]
    turned = replace(measured, names=("pressure", "load"))
    assert list(formulas_of(given, turned, places)) == ["none"]


@pytest.mark.parametrize("held_out", [(), (150.0,)])
def test_points_are_planned_over_the_inputs_that_vary_and_not_where_samples_are(
    held_out, monkeypatch
):
    """A grid of 41 steps; samples that are held out are measured, too."""
    names = ["pressure", "strain"]
    monkeypatch.setattr(of_points, "refit", lambda *_: SimpleNamespace(input_names=names))
    monkeypatch.setattr(of_points, "STEPS", {1: 11, 2: 5})
    whole, choices = at_levels(100.0, 150.0, 200.0, held_out=held_out), SimpleNamespace(name="a")
    found, shown, forecast, notes = of_points.of_points(choices, whole, 2, 1e9, {"strain": 2.0})
    assert (len(found), forecast.more, len(notes)) == (2, 0, 2)
    pressure = np.concatenate([curve.columns["pressure"] for curve in whole.curves])
    strain = np.concatenate([curve.columns["strain"] for curve in whole.curves])
    for one in found:
        near = np.abs(pressure - one.at["pressure"]) <= 100 / 4 / 2
        near &= np.abs(strain - one.at["strain"]) <= np.ptp(strain) / 4 / 2 * (1 - 1e-9)
        assert not near.any()
    assert len(shown.measured["strain"]) == 20 * (3 - len(held_out))
    level = at_levels(100.0)
    constant = level.curves[0].columns | {"pressure": np.full(20, 100.0)}
    level = replace(level, curves=(replace(level.curves[0], columns=constant),))
    monkeypatch.setattr(of_points, "STEPS", {1: 101, 2: 5})
    (one,), *_, (note,) = of_points.of_points(choices, level, 1, None, {})
    assert (list(one.at), "Half widths" in note) == (["strain"], True)  # one pressure is no range
    monkeypatch.setattr(of_points, "STEPS", {1: 11, 2: 5})
    names[:] = ["strain"]
    with refused("all points of a grid with 11 steps have been measured"):
        of_points.of_points(choices, whole, 2, None, {})
    names[:] = ["pressure", "strain", "force"]
    with refused("at most 2 inputs, but 3 vary", error=SpecError):
        of_points.of_points(choices, whole, 2, None, {})


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
    widest = float(committee_of(map_of()).half.max())
    assert points.until(committee_of(map_of()), widest) == Until(widest, widest, 0, widest)


def test_a_map_forecast_counts_points_until_the_width_is_reached(monkeypatch):
    """Each where the width is largest, at most a number of them; noise alone sets a lower limit."""
    committee = committee_of(map_of())
    noise = committee.noise = 0.3 * committee.error.max()
    wanted, widths = 1.2 * NORMAL * noise, [committee.half.max()]
    while widths[-1] > wanted:
        committee.add(int(np.argmax(committee.half)))
        widths.append(committee.half.max())
    for most, more in ((100, len(widths) - 1), (2, None)):
        monkeypatch.setattr(points, "MOST_POINTS", most)
        committee = committee_of(map_of())
        committee.noise = noise
        found = points.until(committee, wanted)
        assert (found.more, found.widest) == (more, widths[0])
        assert found.least == min(widths[: most + 1])
