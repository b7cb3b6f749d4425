"""Every constant of the rules by which solvers start, stop and compare their ends, by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from mapmore_cli.modelling.literature.problem import Nonlinear
from mapmore_cli.modelling.literature.solvers import (
    End,
    _best_solution,
    agreement,
    descend,
    drawn_starts,
    onto_bounds,
    rivals,
)


def end(cost, converged=True, x=(0.0,)):
    return End(np.array(x), cost, converged)


def test_a_coordinate_touches_within_a_millionth_of_its_range():
    lower, upper = np.array([0.0, -np.inf, 5.0, 0.0]), np.array([10.0, 3.0, np.inf, 10.0])
    near = np.array([0.9e-5, 3 - 0.9e-6, 5 + 0.9e-6, 10 - 0.9e-5])
    moved, touched = onto_bounds(near, (lower, upper))
    assert (moved.tolist(), touched) == ([0, 3, 5, 10], [0, 1, 2, 3])
    far = np.array([1.1e-5, 3 - 1.1e-6, 5 + 1.1e-6, 10 - 1.1e-5])
    moved, touched = onto_bounds(far, (lower, upper))
    assert (moved.tolist(), touched) == (far.tolist(), [])


def test_ends_agree_within_a_millionth():
    ends = [end(2.0), end(2 + 1.9e-6), end(2 + 2.1e-6), end(3.0)]
    assert agreement(ends, ends[0], 5) == "2 of 5 starts found the same sum of squares"
    zeros = [end(0.0), end(0.9e-20), end(1.1e-20)]
    assert agreement(zeros, zeros[0], 3).startswith("2 of 3")


def test_rivals_are_other_minima_up_to_five_quarters():
    best = end(100.0)
    near, next_one, limit = end(100.2), end(100.4), end(125.0)
    others = [end(125.1), limit, end(100.05), next_one, near, end(101.0, converged=False)]
    assert rivals([best, *others], best) == [near, next_one, limit]


def test_starts_are_drawn_from_the_intervals_with_magnitudes_evenly_in_the_logarithm():
    one = Nonlinear("a", None, intervals=((-10.0, -0.1), (1.0, 100.0)))
    starts = np.array([*drawn_starts((one, Nonlinear("b", None, intervals=((2.0, 4.0),))))])
    assert starts.shape == (10, 2)
    a, b = starts.T
    assert (((a >= -10) & (a <= -0.1)) | ((a >= 1) & (a <= 100))).all()
    assert {*np.sign(a)} == {-1, 1}
    assert ((b >= 2) & (b <= 4)).all()
    rng = np.random.default_rng(20170714)
    low, high = one.intervals[rng.integers(2)]
    share = np.log(a[0] / low) / np.log(high / low)
    assert share == pytest.approx(rng.random())


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
