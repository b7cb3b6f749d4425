"""Every constant of the rules by which solvers start, stop and compare their ends, by hand."""

from dataclasses import replace
from types import SimpleNamespace
from typing import get_args

import numpy as np
import pytest

from mapmore_cli.modelling.expressions import parse
from mapmore_cli.modelling.literature import solvers
from mapmore_cli.modelling.literature.descent import (
    End,
    agreement,
    descend,
    drawn_starts,
    onto_bounds,
    rivals,
)
from mapmore_cli.modelling.literature.problem import LeastSquares, Nonlinear
from mapmore_cli.modelling.literature.solvers import (
    METHODS,
    _best_solution,
    _valleys,
    levenberg_marquardt,
    simplex,
    variable_projection,
)
from mapmore_cli.study.sections.model import FitMethod


def end(cost, converged=True, x=(0.0,)):
    return End(np.array(x), cost, converged)


def test_a_spec_offers_every_method():
    assert get_args(FitMethod) == tuple(METHODS)


@pytest.mark.parametrize(
    ("given", "span", "text"),
    [
        ({"per": None}, 1.0, "-2"),
        ({"per": "x"}, 4.0, "-2/max|x|"),
        ({"per": None, "of": "x"}, 0.25, "-2 max|x|"),
        ({"per": "zero"}, 1.0, "-2/max|zero|"),
        ({"per": None, "of": "zero"}, 1.0, "-2 max|zero|"),
    ],
)
def test_a_coordinate_has_no_unit(given, span, text):
    parameter = Nonlinear("b", intervals=((-5.0, -1.0), (2.0, 3.0)), **given)
    assert parameter.span({"x": np.array([3.0, -4.0]), "zero": np.zeros(2)}) == span
    assert (parameter.written(-2.0), parameter.bounds) == (text, (-5, 3))


def test_a_coordinate_touches_within_a_millionth_of_its_range():
    lower, upper = np.array([-2.0, -np.inf, 5.0, 0.0]), np.array([8.0, 3.0, np.inf, 10.0])
    near = np.array([-2 + 0.9e-5, 3 - 0.9e-6, 5 + 0.9e-6, 10 - 0.9e-5])
    moved, touched = onto_bounds(near, (lower, upper))
    assert (moved.tolist(), touched) == ([-2, 3, 5, 10], [0, 1, 2, 3])
    exactly = onto_bounds(np.array([1e-6, -1e-6]), (np.array([0.0, -1]), np.array([1.0, 0])))
    assert exactly[0].tolist() == [0, 0]
    far = np.array([-2 + 1.1e-5, 3 - 1.1e-6, 5 + 1.1e-6, 10 - 1.1e-5])
    moved, touched = onto_bounds(far, (lower, upper))
    assert (moved.tolist(), touched) == (far.tolist(), [])


def test_ends_agree_within_a_millionth():
    ends = [end(2.0), end(2 + 1.9e-6), end(2 + 2.1e-6), end(3.0)]
    assert agreement(ends, ends[0], 5) == "2 of 5 starts found the same sum of squares"
    zeros = [end(0.0), end(1e-20), end(1.1e-20)]
    assert agreement(zeros, zeros[0], 3).startswith("2 of 3")


def test_a_simplex_leaves_a_regressor_that_is_zero_alone():
    gradient = {"a": parse("x"), "b": parse("1")}
    columns, y = {"x": np.zeros(5)}, np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    found = simplex(LeastSquares(parse("a*x + b"), ("a", "b"), (), gradient, columns, y))
    assert found.beta[1] == pytest.approx(3.0, abs=1e-3)


def test_rivals_are_other_minima_up_to_five_quarters():
    best = end(100.0)
    near, next_one, limit = end(100.2), end(100.4), end(125.0)
    others = [end(125.1), limit, end(100.05), next_one, near, end(101.0, converged=False)]
    assert rivals([best, *others], best) == [near, next_one, limit]


def test_starts_are_drawn_from_the_intervals_with_magnitudes_evenly_in_the_logarithm():
    one = Nonlinear("a", None, intervals=((-10.0, -0.1), (1.0, 100.0)))
    other = Nonlinear("b", None, intervals=((2.0, 4.0),))
    a, b = np.transpose([*drawn_starts((one, other))])
    assert len(a) == 10
    assert {*np.sign(a)} == {-1, 1}
    rng = np.random.default_rng(20170714)
    low, high = one.intervals[rng.integers(2)]
    assert np.log(a[0] / low) / np.log(high / low) == pytest.approx(rng.random())
    rng.integers(1)
    assert np.log2(b[0] / 2) == pytest.approx(rng.random())


def test_a_descent_starts_within_the_bounds_where_the_system_is_finite():
    asked = []

    def system(x):
        asked.append(float(x[0]))
        return np.array([x[0] - 3.0, 0.0]) if x[0] < 8 else np.full(2, np.nan), np.array(
            [[1.0], [0.0]]
        )

    ends = descend(system, [np.array([-5.0]), np.array([9.0])], (np.zeros(1), np.full(1, 10.0)))
    assert asked[0] == 0.0
    (found,) = ends
    assert found.x == pytest.approx([3.0], rel=1e-9)
    assert (found.converged, found.status) == (True, "converged")
    (cut,) = descend(lambda x: (np.exp(x) + 1, np.diag(np.exp(x))), [np.zeros(1)], evaluations=3)
    assert (cut.converged, cut.status) == (False, "stopped_by_limit")
    assert cut.cost == pytest.approx((np.exp(cut.x[0]) + 1) ** 2 / 2)


def test_of_ends_those_with_allowed_signs_win():
    problem = SimpleNamespace(
        linear=("k",), nonlinear=("c",), allows=lambda nonlinear: bool(nonlinear[0] > 0)
    )
    ends = [end(1.0, x=(5.0, -1.0)), end(2.1, x=(6.0, 2.0)), end(2.0, x=(7.0, 3.0))]
    best = _best_solution(problem, ends, 3, "simplex")
    assert (best.beta, best.c, best.status, best.method) == (7.0, 3.0, "converged", "simplex")
    assert best.notes == ("1 of 3 starts found the same sum of squares",)
    ((beta, c),) = best.rivals
    assert (beta, c) == (6.0, 2.0)
    only = _best_solution(problem, ends[:1], 1, "simplex")
    assert only.beta == 5.0
    assert only.notes == ("every start ended with a sign that the source excludes",)
    assert _best_solution(problem, [], 3, "simplex").status == "failed"


X = np.linspace(0, 2, 30)
SINE = LeastSquares(
    parse("a*sin(c*x)"),
    ("a",),
    (Nonlinear("c", "x", ((0.5, 40.0),)),),
    {"a": parse("sin(c*x)"), "c": parse("a*x*cos(c*x)")},
    {"x": X},
    3 * np.sin(4 * X) + 2 * np.sin(11 * X),
)
GROWTH = LeastSquares(
    parse("a*exp(c*x)"),
    ("a",),
    (Nonlinear("c", "x", ((-9.0, -0.1), (0.2, 10.0))),),
    {"a": parse("exp(c*x)"), "c": parse("a*x*exp(c*x)")},
    {"x": X},
    5 * np.exp(-1.5 * X),
)


def misfit(problem, c):
    """The smallest sum of squares with a parameter of this value, by NumPy."""
    term = np.sin(c * X)
    return np.linalg.lstsq(term[:, None], problem.y, rcond=None)[1][0]


def test_one_coordinate_is_scanned_and_every_valley_is_descended():
    best = variable_projection(SINE)
    places = np.linspace(0.25, 20, 20_000)
    costs = np.array([misfit(SINE, c) for c in places])
    assert best.c == pytest.approx([2 * places[costs.argmin()]], abs=2e-3)
    assert best.beta == pytest.approx(
        [SINE.y @ np.sin(best.c / 2 * X) / np.sum(np.sin(best.c / 2 * X) ** 2)]
    )
    assert (best.status, best.method, best.notes) == ("converged", "variable projection", ())
    assert all(misfit(SINE, c / 2) < 1.25 * costs.min() for _, (c,) in best.rivals)


@pytest.mark.parametrize("method", [variable_projection, levenberg_marquardt])
def test_a_start_leads_to_the_next_minimum_alone(method):
    here = method(replace(SINE, start={"a": 1.0, "c": 10.5}))
    assert here.c == pytest.approx([22], rel=0.05)
    assert not any("starts" in note for note in here.notes)
    away = method(replace(SINE, start={"a": 1.0, "c": 4.2}))
    assert away.c == pytest.approx([8], rel=0.05)


def test_a_start_that_overflows_is_left_for_the_search():
    far = variable_projection(replace(GROWTH, start={"a": 1.0, "c": 1e4}))
    assert far.c == pytest.approx([-3])  # it begins at the nearer end of its bounds
    broken = replace(GROWTH, expression=parse("a*exp(c*x)/(c - 3)*(c - 3)"))
    assert variable_projection(replace(broken, start={"a": 1.0, "c": 3.0})).c == pytest.approx([-3])


@pytest.mark.parametrize("method", METHODS.values())
def test_every_method_finds_the_law_that_made_the_data(method):
    found = method(GROWTH)
    loose = 1e-2 if method is simplex else 1e-7
    assert found.c == pytest.approx([-3], rel=loose)
    assert found.beta == pytest.approx([5], rel=loose)
    assert found.status == "converged"
    assert found.rivals == ()
    assert len(found.notes) == (method is not variable_projection)
    assert all(note.endswith("of 10 starts found the same sum of squares") for note in found.notes)


def test_a_parameter_at_the_end_of_its_search():
    found = variable_projection(replace(GROWTH, y=np.exp(7 * X)))
    assert (found.c, found.status) == (10.0, "at_bound")
    assert found.notes == ("c went to the limit of its search, 10/max|x|",)


def test_a_parameter_that_nothing_tells_is_nearest_to_one():
    found = variable_projection(replace(GROWTH, y=0 * X))
    places = [*-np.geomspace(0.1, 9, 24), *np.geomspace(0.2, 10, 24)]
    assert found.c == pytest.approx([min(places, key=lambda c: abs(np.log(abs(c))))])
    assert found.beta.tolist() == [0]
    assert (found.status, len(found.notes)) == ("converged", 1)
    assert found.notes[0].startswith("c is arbitrary")


@pytest.mark.parametrize("method", [variable_projection, levenberg_marquardt])
def test_without_nonlinear_parameters_nothing_is_searched(method):
    line = LeastSquares(parse("a*x"), ("a",), (), {"a": parse("x")}, {"x": X}, 3 * X + 1)
    found = method(line)
    assert found.beta == pytest.approx([X @ line.y / (X @ X)])
    assert len(found.c) == 0
    assert (found.status, found.notes) == ("converged", ())


def test_of_several_coordinates_thirteen_starts_are_descended():
    two = replace(
        GROWTH,
        expression=parse("a*exp(c*x) + exp(d*x)"),
        nonlinear=(Nonlinear("c", "x", ((-9.0, -0.1),)), Nonlinear("d", "x", ((0.1, 4.0),))),
        gradient={**GROWTH.gradient, "d": parse("x*exp(d*x)")},
        y=5 * np.exp(-1.5 * X) + np.exp(X),
    )
    found = variable_projection(two)
    assert found.c == pytest.approx([-3, 2])
    assert found.notes == ("13 of 13 starts found the same sum of squares",)


def but(*places):
    return [place for place in range(24) if place not in places]


@pytest.mark.parametrize(
    ("costs", "starts"),
    [
        (lambda place: 5 + abs(place - 7), [7]),
        (lambda place: 5 - abs(place - 7), [0, 23]),
        (lambda place: 5 + (place not in (3, 4, 20)), but(2, 5, 19, 21)),
        (lambda place: 5 * (1 + 1.1e-10 * (place == 9)), but(9)),
        (lambda place: 5 * (1 + 0.9e-10 * (place == 9)), []),
        (lambda place: 1.1e-21 * (place != 9), but(8, 10)),
        (lambda place: 0.9e-21 * (place != 9), []),
    ],
)
def test_valleys_of_a_scan(costs, starts, monkeypatch):
    grid = np.geomspace(0.2, 10, 24)
    monkeypatch.setattr(
        solvers, "_projected_sse", lambda _, c: float(costs(int(np.argmin(np.abs(grid - c)))))
    )
    problem = SimpleNamespace(
        nonlinear=(Nonlinear("c", None, ((0.2, 10.0),)),), y=np.full(10, 10.0)
    )
    found = _valleys(problem)
    if not starts:
        assert found == []
        return
    ((bounds, places),) = found
    assert bounds == (pytest.approx([0.2]), pytest.approx([10]))
    assert [int(np.argmin(np.abs(grid - place))) for place in places] == starts


def test_the_simplex_starts_with_terms_at_most_as_large_as_the_target(monkeypatch):
    asked = []

    def minimize(cost, start, method, options):
        asked.append((cost(np.array([1.0, start[1]])), cost(0 * start), start, method, options))
        return SimpleNamespace(x=np.array([2.0, start[1]]), fun=7.0, success=False)

    monkeypatch.setattr("scipy.optimize.minimize", minimize)
    found = simplex(GROWTH)
    y = GROWTH.y
    drawn = [float(c) for (c,) in drawn_starts(GROWTH.nonlinear)]
    assert [start[1] for _, _, start, _, _ in asked] == drawn
    for (at_one, at_zero, start, method, options), c in zip(asked, drawn, strict=True):
        assert abs(start[0]) <= 1
        term = np.exp(c / 2 * X)
        term *= np.linalg.norm(y) / np.linalg.norm(term)
        assert at_one == pytest.approx(np.sum((term - y) ** 2))
        assert at_zero == pytest.approx(y @ y)
        wanted = {"xatol": 1e-4, "fatol": pytest.approx(1e-4 * (y @ y)), "maxfev": 400}
        assert (method, options) == ("Nelder-Mead", wanted)
    assert found.beta == pytest.approx(
        2 * np.linalg.norm(y) / np.linalg.norm(np.exp(found.c * X / 2))
    )
    assert (found.c, found.status) == (drawn[0], "stopped_by_limit")
