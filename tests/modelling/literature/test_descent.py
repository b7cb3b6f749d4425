"""Descents from several starts: minima, bounds, starts without a value."""

import numpy as np
import pytest

from mapmore_cli.modelling.literature.solvers import descend


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
