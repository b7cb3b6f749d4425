"""Descents side by side: the minima of a library's own method, bounds, starts without a value; and linear problems side by side."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.literature import descent, hinge, linear
from mapmore_cli.modelling.literature.descent import descend, onto_bounds

STEP = descent._step
EVERYWHERE = np.full(3, -np.inf), np.full(3, np.inf)


def decay(seed: int, rows: int = 30):
    """A noisy `b0 + b1 exp(b2 t)` as a system of residuals and derivatives."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 3, rows)
    y = 1.0 + 2.0 * np.exp(-1.3 * t) + 0.05 * rng.standard_normal(rows)

    def system(x: Array) -> tuple[Array, Array]:
        falling = np.exp(x[:, 2, None] * t)
        slopes = np.stack([np.ones_like(falling), falling, x[:, 1, None] * t * falling], axis=2)
        return x[:, 0, None] + x[:, 1, None] * falling - y, slopes

    return system


def by_scipy(system, start, bounds):
    return least_squares(
        lambda x: system(x[None])[0][0], start, lambda x: system(x[None])[1][0], bounds=bounds, xtol=1e-15, ftol=1e-15, gtol=1e-15
    )


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("lowest", [-np.inf, -1.0], ids=["free", "at a bound"])
def test_every_start_ends_where_a_library_ends(seed, lowest):
    system, bounds = decay(seed), (np.array([-np.inf, -np.inf, lowest]), np.array([np.inf, np.inf, 0.0]))
    starts = [np.array([0.0, 1.0, -0.5]), np.array([2.0, 3.0, -0.9])]
    oracle = by_scipy(system, starts[0], bounds)
    for end in descend(system, starts, bounds, 1e-14):
        assert end.converged
        assert end.cost <= oracle.cost * (1 + 1e-12)
        assert end.x == pytest.approx(oracle.x, rel=1e-6)
        assert (end.x[2] == -1.0) == (lowest == -1.0)


def test_a_descent_that_joins_another_ends_where_that_one_ended(monkeypatch):
    """Of two starts that lead to one minimum, the slower one stops on its way."""
    system, starts = decay(3), [np.array([1.0, 2.0, -1.3]), np.array([0.0, 1.0, -0.2])]
    steps = []
    monkeypatch.setattr(descent, "_step", lambda at, *how: steps.append(1) or STEP(at, *how))
    one, other = descend(system, starts, EVERYWHERE, 1e-12)
    assert (other.x.tolist(), other.cost, other.converged) == (one.x.tolist(), one.cost, True)
    joined = len(steps)
    monkeypatch.setattr(descent, "SAME_COST", -0.5)
    for end in descend(system, starts, EVERYWHERE, 1e-12):
        assert end.cost == pytest.approx(one.cost, rel=1e-12)
    assert len(steps) - joined > joined


def test_a_descent_in_a_minimum_of_its_own_joins_no_other():
    """The two minima of `(x^2 - 1)^2 + 0.01` are as deep as each other."""

    def system(x: Array) -> tuple[Array, Array]:
        return np.stack([x[:, 0] ** 2 - 1.0, np.full(len(x), 0.1)], axis=1), np.stack([2 * x, np.zeros_like(x)], axis=1)

    ends = descend(system, [np.array([0.9]), np.array([-3.0])], (np.array([-np.inf]), np.array([np.inf])), 1e-12)
    assert [end.x[0] for end in ends] == pytest.approx([1.0, -1.0])
    assert all(end.converged for end in ends)


def test_descents_that_crawl_far_above_the_end_of_another_are_given_up(monkeypatch):
    """Two of the hinged formula's five starts crawl over a flat table, a hundred times as high as the minimum of the others."""
    pressure, strain = (column.ravel() for column in np.meshgrid(np.linspace(0, 600, 7), np.linspace(-0.04, 0.25, 8)))
    force = 3.0 * pressure * (1 - 3.5 * strain) ** 2 - 200 * np.exp(-20 * strain)
    fits, evaluations = [], []
    for pace in (descent.PACE, descent.EVALUATIONS + 1):
        monkeypatch.setattr(descent, "PACE", pace)
        calls = []
        monkeypatch.setattr(descent, "_step", lambda *how, calls=calls: calls.append(1) or STEP(*how))
        fits.append(hinge.fit({"pressure": pressure, "strain": strain}, force))
        evaluations.append(len(calls))
    assert fits[0].parameters == fits[1].parameters
    assert evaluations[0] < 0.7 * evaluations[1]


def test_a_start_without_a_value_has_no_end_and_a_step_to_such_a_place_is_not_taken():
    def system(x: Array) -> tuple[Array, Array]:
        return np.sqrt(x) - 0.001, (0.5 / np.sqrt(x))[:, :, None]

    (end,) = descend(system, [np.array([-1.0]), np.array([4.0])], (np.array([-np.inf]), np.array([np.inf])), 1e-12)
    assert end.converged
    assert end.x == pytest.approx([1e-6], rel=1e-4)


def test_a_coordinate_on_which_nothing_depends_stays():
    def system(x: Array) -> tuple[Array, Array]:
        slopes = np.zeros((len(x), 2, 3))
        slopes[:, 0, 0] = slopes[:, 1, 1] = 1.0
        return np.stack([x[:, 0] - 1.0, x[:, 1] + 2.0], axis=1), slopes

    (end,) = descend(system, [np.array([0.0, 0.0, 7.0])], EVERYWHERE, 1e-12)
    assert end.x == pytest.approx([1.0, -2.0, 7.0])


def test_descents_stay_within_the_bounds_and_say_where_they_touch():
    """The distance to a point outside of the unit box, in the first coordinate; the third has no upper end."""
    bounds = np.array([0.0, 0.0, 0.0]), np.array([1.0, 1.0, np.inf])
    point = np.array([2.0, 0.3, -1.0])
    (found,) = descend(lambda x: (x - point, np.broadcast_to(np.eye(3), (len(x), 3, 3))), [np.full(3, 0.5)], bounds, 1e-12)
    moved, touched = onto_bounds(found.x, bounds)
    assert touched == [0, 2]
    assert moved == pytest.approx([1.0, 0.3, 0.0], abs=1e-9)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10**6), st.integers(1, 4), st.integers(1, 5), st.booleans(), st.floats(1e-6, 1e6))
def test_linear_problems_side_by_side_are_those_one_by_one(seed, problems, columns, dependent, scale):
    rng = np.random.default_rng(seed)
    phi, y = rng.standard_normal((problems, 20, columns)) * scale, rng.standard_normal((problems, 20))
    if dependent and columns > 1:
        phi[0, :, -1] = 2 * phi[0, :, 0]
    together, least = linear.solve_each(phi, y), linear.least_sse(phi, y)
    for number in range(problems):
        alone = linear.solve(phi[number], y[number])
        assert together.beta[number] == pytest.approx(alone.beta, rel=1e-9, abs=1e-12 / scale)
        assert together.residual[number] == pytest.approx(alone.residual, rel=1e-9, abs=1e-12)
        assert least[number] == pytest.approx(alone.sse, rel=1e-9)


def test_a_problem_that_overflows_spoils_no_other():
    phi, y = np.random.default_rng(0).standard_normal((2, 10, 3)), np.ones((2, 10))
    phi[0, 4, 1] = np.inf
    assert not np.isfinite(linear.solve_each(phi, y).residual[0]).any()
    assert linear.solve_each(phi, y).residual[1] == pytest.approx(linear.solve(phi[1], y[1]).residual)
    assert np.isinf(linear.least_sse(phi, y)[0])
