"""The choice of the ridge: errors from sums of products are those of the rows themselves."""

import numpy as np
import pytest

from mapmore_cli.modelling.frols.moments import (
    Moments,
    blocks_of_rows,
    moments,
    standard,
    standardised,
)
from mapmore_cli.modelling.frols.ridge import (
    RIDGES,
    Regularised,
    _left_out_error,
    choose_ridge,
    prune,
    select,
)


@pytest.mark.parametrize("seed", range(6))
def test_a_block_that_is_left_out_has_the_error_of_its_rows(seed):
    """A model of two of four terms, fitted to the other rows, whose means differ from the block's;
    the ridge is that of the smallest sum over two blocks.
    """
    rng, cut = np.random.default_rng(seed), 28
    P = rng.normal(size=(40, 4)) + (np.arange(40) >= cut)[:, None]
    y = P @ [1.0, -0.5, 0.2, 0.1] + 2 * rng.normal(size=40)
    by = standard(blocks_of_rows(P, y))
    Z, z = (P - P.mean(axis=0)) / P.std(axis=0), (y - y.mean()) / y.std()
    rows = np.arange(40) < cut
    parts = [moments(standardised(blocks_of_rows(P[one], y[one]), by)) for one in (rows, ~rows)]
    total = moments(standardised(blocks_of_rows(P, y), by))

    def error(known, ridge):
        data = Regularised(np.cov(np.column_stack([Z, z])[known].T, bias=True), known.sum(), ridge)
        kept = prune(data, select(data, 4).chosen)[1]
        own, target = Z[:, kept] - Z[known][:, kept].mean(axis=0), z - z[known].mean()
        normal = own[known].T @ own[known] + known.sum() * ridge * np.eye(2)
        theta = np.linalg.solve(normal, own[known].T @ target[known])
        return np.sum((target - own @ theta)[~known] ** 2)

    for known, one, other in ((rows, *parts), (~rows, *parts[::-1])):
        found = _left_out_error(one, other, 0.05, 4, 2)
        assert found == pytest.approx(error(known, 0.05))
    sums = [error(rows, ridge) + error(~rows, ridge) for ridge in RIDGES]
    assert choose_ridge(total, parts, 4, 2) == RIDGES[int(np.argmin(sums))]


def test_without_terms_the_error_of_a_block_is_the_square_of_its_output():
    still = Moments(4, np.zeros(2), np.diag([4.0, 0.0]))  # an output that does not vary
    block = Moments(2, np.ones(2), np.array([[2.0, 0.5], [0.5, 7.0]]))
    assert _left_out_error(still, block, 0.01, 1, 1) == 7


@pytest.mark.parametrize(("samples", "known"), [(2, False), (3, True)])
def test_standard_errors_need_more_samples_than_terms(samples, known):
    found = select(Regularised(np.eye(3) + 0.5, samples, 1e-3), 2)
    assert np.isfinite(found.theta_error).tolist() == [known, known]


def test_ridges_are_tried_from_small_to_large_in_steps_of_at_most_ten():
    """Of equally good ridges the first is chosen, which is then the smallest."""
    steps = np.divide(RIDGES[1:], RIDGES[:-1])
    assert steps.min() > 1
    assert steps.max() < 10.1
