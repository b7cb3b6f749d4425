"""Descents from several starts: minima, bounds, starts without a value."""

from __future__ import annotations

import numpy as np
import pytest

from mapmore_cli.modelling.literature.solvers import descend, onto_bounds


def test_each_start_ends_in_its_own_minimum():
    """The two minima of `(x^2 - 1)^2 + 0.01` are as deep as each other."""

    def system(x):
        return np.array([x[0] ** 2 - 1.0, 0.1]), np.array([[2 * x[0]], [0.0]])

    ends = descend(system, [np.array([0.9]), np.array([-3.0])])
    assert [end.x[0] for end in ends] == pytest.approx([1.0, -1.0])
    assert all(end.converged for end in ends)


@pytest.mark.parametrize("method", ["trf", "lm"])
def test_a_start_without_a_value_has_no_end_and_a_step_to_such_a_place_is_not_taken(method):
    def system(x):
        return np.sqrt(x) - 0.001, 0.5 / np.sqrt(x)[:, None]

    (end,) = descend(system, [np.array([-1.0]), np.array([4.0])], method=method)
    assert end.converged
    assert end.x == pytest.approx([1e-6], rel=1e-4)


def test_a_coordinate_on_which_nothing_depends_stays():
    target = np.array([1.0, -2.0])
    (end,) = descend(lambda x: (x[:2] - target, np.eye(2, 3)), [np.array([0.0, 0.0, 7.0])])
    assert end.x == pytest.approx([1.0, -2.0, 7.0])


def test_descents_stay_within_the_bounds_and_say_where_they_touch():
    """The distance to a point outside of the unit box, in the first coordinate; the third has no
    upper end.
    """
    bounds = np.array([0.0, 0.0, 0.0]), np.array([1.0, 1.0, np.inf])
    point = np.array([2.0, 0.3, -1.0])
    (found,) = descend(lambda x: (x - point, np.eye(3)), [np.full(3, 0.5)], bounds)
    moved, touched = onto_bounds(found.x, bounds)
    assert touched == [0, 2]
    assert moved == pytest.approx([1.0, 0.3, 0.0], abs=1e-9)
