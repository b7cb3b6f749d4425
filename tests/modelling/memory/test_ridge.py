"""Regularised selection: against problems written out in full."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from memory_samples import recipe_of, record, wandering

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.expressions import parse
from mapmore_cli.modelling.frols import frols
from mapmore_cli.modelling.frols.correlated import correlated_errors
from mapmore_cli.modelling.frols.moments import gram, moments, standard, standardised, weighted
from mapmore_cli.modelling.frols.ridge import (
    RIDGES,
    Regularised,
    choose_ridge,
    prune,
    ridge_press,
    select,
)
from mapmore_cli.modelling.frols.select import PRICES
from mapmore_cli.modelling.memory.selectors import Regressors, problem_of, selector
from mapmore_cli.modelling.memory.training import TrainingData


def blocks_of(P, y, *cuts):
    return lambda: zip(np.split(P, cuts), np.split(y, cuts), strict=True)


def problem(n, M, seed):
    rng = np.random.default_rng(seed)
    P = rng.normal(size=(n, M)) @ rng.normal(size=(M, M)) + rng.normal(0, 50, M)
    return P, P[:, 0] - 2 * P[:, M // 2] + 0.3 * rng.normal(size=n) + 7


def regularised(P, y, ridge):
    blocks = blocks_of(P, y)
    total = moments(standardised(blocks, standard(blocks)))
    return Regularised(total.covariance, total.samples, ridge)


def in_full(P, y, ridge):
    """Standardised columns with rows for the ridge below: least squares on them is the regularised
    problem.
    """
    Z, z = (P - P.mean(axis=0)) / P.std(axis=0), (y - y.mean()) / y.std()
    n, M = P.shape
    return np.vstack([Z, np.sqrt(n * ridge) * np.eye(M)]), np.r_[z, np.zeros(M)]


def squares_left(Z, z, columns):
    """Sum of squares that least squares on some columns leave."""
    residual = (
        z - Z[:, columns] @ np.linalg.lstsq(Z[:, columns], z, rcond=None)[0] if len(columns) else z
    )
    return residual @ residual


CASES = {
    "n": st.integers(8, 60),
    "M": st.integers(2, 7),
    "seed": st.integers(0, 10_000),
    "ridge": st.sampled_from([1e-6, 1e-3, 0.1, 10.0]),
}


@given(**CASES)
def test_selection_is_frols_on_data_with_rows_for_the_ridge(n, M, seed, ridge):
    P, y = problem(n, M, seed)
    Z, z = in_full(P, y, ridge)
    found, expected = select(regularised(P, y, ridge), M), frols(Z, z, M)
    assert found.chosen.tolist() == expected.chosen.tolist()
    np.testing.assert_allclose(found.err, expected.err, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(found.theta, expected.theta, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(found.g_all, expected.g_all, rtol=1e-5, atol=1e-9)
    k = len(found.chosen)  # rows for the ridge are no samples
    scale = np.sqrt((n + M - k) / (n - k))
    np.testing.assert_allclose(found.theta_error, scale * expected.theta_error, rtol=1e-5)
    residual = z[:n] - Z[:n, found.chosen] @ found.theta
    assert found.sse == pytest.approx(residual @ residual, rel=1e-6, abs=1e-9 * n)
    assert (found.yy, found.samples) == (pytest.approx(n), n)


def test_nothing_of_a_target_without_variance_is_unexplained():
    data = Regularised(np.array([[1.0, 0.0], [0.0, 0.0]]), 9, 0.1)
    assert data.unexplained(np.array([0]), np.array([0.0])) == 0.0


@pytest.mark.parametrize(
    ("loss", "n", "outlier"),
    [("huber", 200, 0), ("bisquare", 200, 0), ("huber", 201, None), ("squares", 200, None)],
)
def test_a_robust_loss_leaves_a_gross_outlier_out_if_there_are_few_samples(loss, n, outlier):
    x = np.random.default_rng(n).normal(size=n)
    given = Regressors((parse("x"),), {"x": x}, x + x**2 + 1000.0 * (np.arange(n) == 0))
    assert (
        problem_of(given, recipe_of("y", ("x",), max_terms=1, loss=loss)).weighing.outlier
        == outlier
    )


@pytest.mark.parametrize("stop", ["press", *PRICES, "tolerance", "none of it"])
def test_coefficients_are_those_of_the_squares_and_the_penalty(stop):
    """In the units of the candidates, and as many terms as the rule prefers."""
    P, y = problem(40, 5, 42)  # of which six candidates would keep three terms by ebic
    names = [f"x{i}" for i in range(5)]
    given = Regressors(tuple(map(parse, names)), dict(zip(names, P.T, strict=True)), y)
    rule = "tolerance" if stop == "none of it" else stop
    asked = recipe_of("y", names, max_terms=4, ridge=0.01, stop=rule)
    subsets, data = (own := selector(given, asked)).sizes, own.data
    shares = np.array([data.unexplained(one, data.coefficients(one)) for one in subsets])
    if stop == "tolerance":
        own = selector(given, replace(asked, tolerance=shares[1]))
    found = own.best()
    chosen, theta = found.selection.chosen, found.selection.theta
    Z = P[:, chosen] - P[:, chosen].mean(axis=0)
    penalty = own.penalty(chosen)
    assert penalty == pytest.approx(0.01 * 40 * P[:, chosen].var(axis=0))
    normal = Z.T @ Z + np.diag(penalty)
    assert theta == pytest.approx(np.linalg.solve(normal, Z.T @ (y - y.mean())))
    assert found.constant == pytest.approx(y.mean() - theta @ P[:, chosen].mean(axis=0))
    k = np.arange(1, 5)
    few, large = k * np.log(40), 2 * k * np.log(5)
    prices = {"bic": few, "ebic": few + large, "aicc": 2 * k + 2 * k * (k + 1) / (39 - k)}
    assert prices.keys() == PRICES.keys()
    expected = {name: np.argmin(40 * np.log(shares) + price) for name, price in prices.items()} | {
        "press": np.argmin(ridge_press(own.blocks, data, subsets)),
        "tolerance": 1,
        "none of it": 3,
    }
    assert len(chosen) == expected[stop] + 1
    assert (len(subsets), own.forward.size) == (4, 5)


@pytest.mark.parametrize("ridge", [0.0, 0.02])
def test_standard_errors_allow_for_correlation_along_recordings(ridge):
    """With a ridge, of centred columns and with the penalty; not with a robust loss. In free run,
    the constant of a model with a ridge is one more parameter.
    """
    records = []
    for n in (90, 60):
        x = wandering(n, seed=n)
        z = np.random.default_rng(n).normal(size=n)
        records.append(record(x=x, z=z, y=x - 0.3 * z + np.cumsum(z) / 9 + 2))
    columns = [np.concatenate([one.columns[name] for one in records]) for name in ("x", "z", "y")]
    asked = recipe_of("y", ["x", "z"], max_terms=2, ridge=ridge)
    data = TrainingData(records, asked)
    found = data.fit(data.selector.best())
    theta, names = found.model.theta, found.model.terms
    P, y = np.column_stack([columns["xz".index(name)] for name in names]), columns[2]
    residual = y - P @ theta - found.model.constant
    penalty = ridge * len(y) * P.var(axis=0)
    errors, worth = correlated_errors(P - P.mean(axis=0) * (ridge > 0), residual, [90, 60], penalty)
    np.testing.assert_allclose(found.model.theta_error, errors)
    assert found.selection.worth == worth
    vector = np.append(theta, found.model.constant)
    in_free_run = data.fit(data.selector.best(), vector).model
    constant = np.ones((len(y), int(ridge > 0)))
    expected, _ = correlated_errors(
        np.hstack([P, constant]), residual, [90, 60], np.append(penalty, constant[0] * 0)
    )
    np.testing.assert_allclose(in_free_run.theta_error, expected[:2])
    robust = TrainingData(records, replace(asked, ridge=0.0, loss="huber"))
    assert np.isnan(robust.fit(robust.selector.best()).selection.worth)


@given(**CASES, power=st.sampled_from([-1000, -600, 600, 900]))
def test_squares_that_overflow_or_vanish_change_nothing(n, M, seed, ridge, power):
    """A column in units of 2^900 or 2^-1000: the division by a power of two is exact, and so is the
    selection.
    """
    P, y = problem(n, M, seed)
    units = np.where(np.arange(M) % 2, 1.0, 2.0**power)
    near, far = regularised(P, y, ridge), regularised(P * units, y, ridge)
    np.testing.assert_allclose(far.covariance, near.covariance, rtol=0, atol=1e-12)
    assert select(far, M).chosen.tolist() == select(near, M).chosen.tolist()


@given(**CASES)
def test_pruning_leaves_out_the_term_that_costs_least(n, M, seed, ridge):
    P, y = problem(n, M, seed)
    full = in_full(P, y, ridge)
    subsets = prune(regularised(P, y, ridge), np.arange(M))
    assert [len(kept) for kept in subsets] == list(range(1, M + 1))
    for smaller, larger in pairwise(subsets):
        every = [squares_left(*full, np.delete(larger, place)) for place in range(len(larger))]
        assert set(smaller) < set(larger)
        assert squares_left(*full, smaller) <= min(every) * (1 + 1e-9) + 1e-9


@given(
    st.integers(0, 10_000),
    st.lists(st.integers(0, 40), max_size=3),
    st.floats(1e-6, 1e6),
    st.floats(-1e6, 1e6),
)
def test_moments_do_not_depend_on_blocks_units_or_origin(seed, cuts, slope, offset):
    P, y = problem(40, 3, seed)
    blocks, others = blocks_of(P, y), blocks_of(slope * P + slope * offset, y, *sorted(cuts))
    whole, cut = (moments(standardised(given, standard(given))) for given in (blocks, others))
    np.testing.assert_allclose(whole.covariance, np.corrcoef(np.column_stack([P, y]).T), atol=1e-9)
    np.testing.assert_allclose(cut.covariance, whole.covariance, atol=1e-6)
    early, late = (
        moments(standardised(blocks_of(P[part], y[part]), standard(blocks)))
        for part in (slice(15), slice(15, None))
    )
    np.testing.assert_allclose(whole.without(early).covariance, late.covariance, atol=1e-9)


@given(st.integers(0, 10_000), st.lists(st.integers(0, 40), max_size=3))
def test_uncertainties_and_rows_in_messages_go_with_their_samples_in_every_block(seed, cuts):
    P, y = problem(40, 3, seed)
    sigma = np.random.default_rng(seed + 1).uniform(0.5, 2.0, 40)
    products, scale, samples = gram(weighted(blocks_of(P, y, *sorted(cuts)), sigma))
    Z = np.column_stack([P, y]) / sigma[:, None]
    np.testing.assert_allclose(products * np.outer(scale, scale), Z.T @ Z, rtol=1e-9, atol=1e-6)
    assert samples == 40
    y[31] = np.nan
    with pytest.raises(DataError, match="y is not finite at row 31"):
        gram(blocks_of(P, y, *sorted(cuts)))


def test_a_constant_candidate_is_never_chosen_and_harms_nothing():
    P, y = problem(30, 3, 1)
    P = np.column_stack([np.full(30, 0.1), P, np.zeros(30)])
    assert 0 not in select(regularised(P, y, 1e-3), 5).chosen
    assert sorted(select(regularised(P, y, 1e-3), 5).chosen.tolist()) == [1, 2, 3]
    assert len(select(regularised(P, np.full(30, 2.0), 1e-3), 5).chosen) == 0


def test_there_must_be_a_row():
    with pytest.raises(ValueError, match="no row"):
        standard(lambda: iter([(np.empty((0, 2)), np.empty(0))]))


def test_without_anything_to_choose_between_the_ridge_is_weak():
    P, y = np.random.default_rng(0).normal(size=(8, 2)), np.full(8, 3.0)
    by = standard(blocks_of(P, y))
    total, half = (moments(standardised(blocks_of(P[:n], y[:n]), by)) for n in (8, 4))
    assert choose_ridge(total, [half], 2, 2) == RIDGES[0]


@settings(max_examples=25)
@given(
    n=st.integers(8, 25),
    M=st.integers(1, 4),
    seed=st.integers(0, 10_000),
    ridge=st.sampled_from([1e-6, 1e-3, 0.1]),
)
def test_press_is_the_error_of_models_fitted_without_the_sample(n, M, seed, ridge):
    P, y = problem(n, M + 1, seed)
    Z, z = (P[:, :M] - P[:, :M].mean(axis=0)) / P[:, :M].std(axis=0), (y - y.mean()) / y.std()
    expected = 0.0
    for left in range(n):
        A = np.column_stack([np.ones(n - 1), np.delete(Z, left, axis=0)])
        penalty = n * ridge * np.diag([0.0, *[1.0] * M])
        theta = np.linalg.solve(A.T @ A + penalty, A.T @ np.delete(z, left))
        expected += (z[left] - np.r_[1.0, Z[left]] @ theta) ** 2
    data = regularised(P[:, :M], y, ridge)
    errors = ridge_press(blocks_of(Z, z, 3), data, [np.arange(1), np.arange(M)])
    assert errors[1] == pytest.approx(expected, rel=1e-6)
