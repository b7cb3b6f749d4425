"""Weights, robust losses and standard errors against SciPy, and against what simulations show."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import curve_fit, least_squares, minimize
from scipy.stats import t as student
from textbook import textbook

from mapmore_cli.modelling.frols import Weighing, frols, frols_streamed
from mapmore_cli.modelling.frols.moments import blocks_of_rows

TRUE = np.array([2.0, -1.0, 0.5])


def columns(x):
    return np.column_stack([x**0, x, x**2])


def in_order(found, k=3):
    """Coefficients and standard errors by candidate."""
    both = np.full((2, k), np.nan)
    both[:, found.chosen] = found.theta, found.theta_error
    return both


@given(seed=st.integers(0, 2**32 - 1))
def test_weighted_selection_is_that_of_the_weighted_columns(seed):
    rng = np.random.default_rng(seed)
    P, sigma = rng.normal(size=(40, 6)), rng.uniform(0.1, 3.0, 40)
    y = P @ rng.normal(size=6) + sigma * rng.normal(size=40)
    chosen, g, err, theta, _ = textbook(P / sigma[:, None], y / sigma, 3)
    found = frols(P, y, 3, weighing=Weighing(sigma))
    assert found.chosen.tolist() == chosen
    np.testing.assert_allclose(found.err, err, rtol=1e-9)
    np.testing.assert_allclose(found.g, g, rtol=1e-7)
    only = lambda among: blocks_of_rows(P[:, among], y)  # noqa: E731
    streamed = frols_streamed(blocks_of_rows(P, y), 3, weighing=Weighing(sigma), only=only)
    np.testing.assert_allclose(streamed.theta, theta, rtol=1e-7)
    scaled = frols(P, y, 3, weighing=Weighing(7 * sigma))
    np.testing.assert_allclose(scaled.theta_error, found.theta_error, rtol=1e-9)


def test_weighted_errors_are_those_of_scipy():
    rng = np.random.default_rng(4)
    x = np.linspace(-1, 1, 80)
    sigma = 0.05 + 0.2 * np.abs(x)
    y = columns(x) @ TRUE + sigma * rng.normal(size=80)
    theta, errors = in_order(frols(columns(x), y, weighing=Weighing(sigma)))
    best, cov = curve_fit(lambda x, *b: columns(x) @ np.array(b), x, y, TRUE, sigma)
    np.testing.assert_allclose(theta, best, rtol=1e-6)
    np.testing.assert_allclose(errors, np.sqrt(np.diag(cov)), rtol=1e-6)


def test_the_tolerance_is_of_the_weighted_squares_about_the_weighted_mean():
    """A constant explains nearly all of a length; the tolerance is of what the length does."""
    rng = np.random.default_rng(0)
    x, sigma = np.linspace(0, 1, 60), rng.uniform(0.5, 2.0, 60)
    y = 500 + 2 * x + 1e-3 * sigma * rng.normal(size=60)
    root, line = 1 / sigma, columns(x)[:, :2]
    left = np.linalg.lstsq(line * root[:, None], y * root)[1][0]
    share = left / np.sum((root * (y - np.average(y, weights=root**2))) ** 2)
    for tolerance, terms in ((1.01 * share, 2), (0.99 * share, 3)):
        assert len(frols(columns(x), y, None, tolerance, weighing=Weighing(sigma)).chosen) == terms


def with_outliers(seed, loss_scale=0.1):
    """200 samples, a tenth of them off by 20 to 100 standard deviations to one side."""
    rng = np.random.default_rng(seed)
    P = columns(np.linspace(-1, 1, 200))
    y = P @ TRUE + loss_scale * rng.normal(size=200)
    y[rng.choice(200, 20, replace=False)] += rng.uniform(2, 10, 20)
    return P, y


def test_robust_fits_of_a_given_scale_are_the_minima_that_scipy_finds():
    P, y = with_outliers(1)
    huber = least_squares(lambda b: P @ b - y, TRUE, loss="huber", f_scale=1.345 * 0.1).x
    theta, _ = in_order(frols(P, y, weighing=Weighing(loss="huber", scale=0.1)))
    np.testing.assert_allclose(theta, huber, atol=1e-5)

    def tukey(b):
        return np.sum(1 - np.maximum(1 - ((P @ b - y) / (4.685 * 0.1)) ** 2, 0.0) ** 3)

    least = minimize(tukey, theta, method="BFGS", options={"gtol": 1e-10}).x
    theta, _ = in_order(frols(P, y, weighing=Weighing(loss="bisquare", scale=0.1)))
    np.testing.assert_allclose(theta, least, atol=1e-5)


def test_with_a_tenth_of_gross_outliers_coefficients_are_within_three_standard_errors():
    for loss in ("huber", "bisquare"):
        for seed in range(10):
            P, y = with_outliers(seed)
            theta, errors = in_order(frols(P, y, weighing=Weighing(loss=loss)))
            assert np.all(np.abs(theta - TRUE) < 3 * errors), (loss, seed)
            plain, plain_errors = in_order(frols(P, y))
            assert np.abs(plain - TRUE).max() > 3 * np.abs(theta - TRUE).max()
            assert errors.max() < plain_errors.max() / 5


def test_exact_samples_beside_outliers_are_fitted_exactly():
    P, y = with_outliers(3, loss_scale=0.0)
    theta, _ = in_order(frols(P, y, weighing=Weighing(loss="bisquare")))
    np.testing.assert_allclose(theta, TRUE, atol=1e-9)


def test_intervals_by_curve_cover_what_residuals_of_a_curve_hide():
    """Every curve has an offset and a slope of its own; 95 % intervals hold the truth in 93-97 %
    with sums over curves, those that take samples to be independent in two thirds.
    """
    curve, x = np.repeat(np.arange(12), 15), np.tile(np.linspace(-1, 1, 15), 12)
    P, by_curve, alone = columns(x), [], []
    for seed in range(500):
        rng = np.random.default_rng(seed)
        own = rng.normal(0, 0.2, (2, 12))[:, curve]
        y = P @ TRUE + own[0] + own[1] * x + 0.1 * rng.normal(size=len(x))
        for hits, weighing in ((by_curve, Weighing(curves=curve)), (alone, None)):
            found = frols(P, y, weighing=weighing)
            theta, errors = in_order(found)
            width = student.ppf(0.975, found.freedom) * errors
            hits.append(np.abs(theta - TRUE)[:2] < width[:2])
    assert found.freedom == 177
    assert 0.93 < np.mean(by_curve) < 0.97
    assert np.mean(alone) < 0.75


def test_too_few_curves_leave_the_errors_as_they_are():
    P, y = with_outliers(0)
    plain = frols(P, y)
    four = frols(P, y, weighing=Weighing(curves=np.repeat(np.arange(4), 50)))
    assert four.curves == 0
    np.testing.assert_array_equal(four.theta_error, plain.theta_error)
    assert frols(P, y, weighing=Weighing(curves=np.repeat(np.arange(5), 40))).curves == 5


def test_curves_count_alike_however_many_samples_they_have():
    """The mean of a curve of 90 samples and one of 10 is half-way between the two."""
    y, curve = np.repeat([0.0, 1.0], [90, 10]), np.repeat([0, 1], [90, 10])
    found = frols(np.ones((100, 1)), y, weighing=Weighing(curves=curve, alike=True))
    assert found.theta == pytest.approx([0.5])


@pytest.mark.parametrize("value", [0.0, np.nan, np.inf, -1.0])
def test_an_uncertainty_that_is_none_is_refused(value):
    with pytest.raises(ValueError, match="no number above zero"):
        Weighing(np.full(20, value))
