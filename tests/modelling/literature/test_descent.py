"""Descents from several starts: minima, bounds, starts without a value; and linear problems side by
side.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.literature import linear
from mapmore_cli.modelling.literature.descent import descend, onto_bounds

EVERYWHERE = np.full(3, -np.inf), np.full(3, np.inf)


def test_each_start_ends_in_its_own_minimum():
    """The two minima of `(x^2 - 1)^2 + 0.01` are as deep as each other."""

    def system(x: Array) -> tuple[Array, Array]:
        return np.stack([x[:, 0] ** 2 - 1.0, np.full(len(x), 0.1)], axis=1), np.stack(
            [2 * x, np.zeros_like(x)], axis=1
        )

    ends = descend(
        system,
        [np.array([0.9]), np.array([-3.0])],
        (np.array([-np.inf]), np.array([np.inf])),
        1e-12,
    )
    assert [end.x[0] for end in ends] == pytest.approx([1.0, -1.0])
    assert all(end.converged for end in ends)


def test_a_start_without_a_value_has_no_end_and_a_step_to_such_a_place_is_not_taken():
    def system(x: Array) -> tuple[Array, Array]:
        return np.sqrt(x) - 0.001, (0.5 / np.sqrt(x))[:, :, None]

    (end,) = descend(
        system,
        [np.array([-1.0]), np.array([4.0])],
        (np.array([-np.inf]), np.array([np.inf])),
        1e-12,
    )
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
    """The distance to a point outside of the unit box, in the first coordinate; the third has no
    upper end.
    """
    bounds = np.array([0.0, 0.0, 0.0]), np.array([1.0, 1.0, np.inf])
    point = np.array([2.0, 0.3, -1.0])
    (found,) = descend(
        lambda x: (x - point, np.broadcast_to(np.eye(3), (len(x), 3, 3))),
        [np.full(3, 0.5)],
        bounds,
        1e-12,
    )
    moved, touched = onto_bounds(found.x, bounds)
    assert touched == [0, 2]
    assert moved == pytest.approx([1.0, 0.3, 0.0], abs=1e-9)


@settings(deadline=None, max_examples=40)
@given(
    st.integers(0, 10**6), st.integers(1, 4), st.integers(1, 5), st.booleans(), st.floats(1e-6, 1e6)
)
def test_linear_problems_side_by_side_are_those_one_by_one(
    seed, problems, columns, dependent, scale
):
    rng = np.random.default_rng(seed)
    phi, y = (
        rng.standard_normal((problems, 20, columns)) * scale,
        rng.standard_normal((problems, 20)),
    )
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
    assert linear.solve_each(phi, y).residual[1] == pytest.approx(
        linear.solve(phi[1], y[1]).residual
    )
    assert np.isinf(linear.least_sse(phi, y)[0])
