"""Weights, robust losses and standard errors against SciPy, and against what simulations show."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import curve_fit, least_squares, minimize
from textbook import textbook

from mapmore_cli.modelling.frols import Weighing, frols
from mapmore_cli.modelling.frols.weighing import (
    LARGEST_TUNING,
    LOSSES,
    gross_outlier,
    loss_weights,
    numbered_curves,
    scale_of,
)

TRUE = np.array([2.0, -1.0, 0.5])


def columns(x):
    return np.column_stack([x**0, x, x**2])


def fitted(P, y, **weighing):
    """Coefficients and standard errors by candidate, and the degrees of freedom of the latter."""
    found = frols(P, y, weighing=Weighing(**weighing))
    return *(one[np.argsort(found.chosen)] for one in (found.theta, found.theta_error)), found


def test_weights_make_the_choice_the_errors_and_the_tolerance():
    """A constant explains nearly all of a length; the tolerance is of what the length does."""
    rng = np.random.default_rng(4)
    x, sigma = np.linspace(-1, 1, 80), rng.uniform(0.5, 2.0, 80)
    y = 500 + columns(x) @ TRUE + 0.1 * sigma * rng.normal(size=80)
    theta, errors, found = fitted(columns(x), y, uncertainty=sigma)
    chosen, _, err, _, _ = textbook(columns(x) / sigma[:, None], y / sigma, 3)
    assert (found.chosen.tolist(), found.err.tolist()) == (chosen, pytest.approx(err))
    best, cov = curve_fit(lambda x, *b: columns(x) @ b, x, y, TRUE, sigma)
    np.testing.assert_allclose([theta, errors], [best, np.sqrt(np.diag(cov))], rtol=1e-5)
    left = np.sum(((y - columns(x)[:, :2] @ np.polyfit(x, y, 1, w=1 / sigma)[::-1]) / sigma) ** 2)
    share = left / np.sum(((y - np.average(y, weights=sigma**-2)) / sigma) ** 2)
    for tolerance, terms in ((1.01 * share, 2), (0.99 * share, 3)):
        found = frols(columns(x), y, None, tolerance, weighing=Weighing(sigma))
        assert len(found.chosen) == terms


def test_weights_keep_the_unit_of_the_output():
    sigma, weights = np.array([1.0, 2.0, 5.0]), np.array([1.0, 0.25, 1.0])
    assert np.mean(Weighing(sigma).sigma ** -2) == pytest.approx(1)
    assert Weighing(sigma).sigma == pytest.approx(sigma * Weighing(sigma).sigma[0])
    assert Weighing().by(weights).tolist() == [1, 2, 1]
    three = columns(np.array([0.0, 1.0, 3.0])), np.array([1.0, 0.0, 2.0])
    assert np.isnan(fitted(*three, loss="huber")[1]).all()  # no degree of freedom


def with_outliers(seed, noise=0.1):
    """200 samples, a tenth of them far off to one side."""
    rng = np.random.default_rng(seed)
    P = columns(np.linspace(-1, 1, 200))
    y = P @ TRUE + noise * rng.normal(size=200)
    y[rng.choice(200, 20, replace=False)] += rng.uniform(2, 10, 20)
    return P, y


def test_robust_fits_of_a_given_scale_are_the_minima_that_scipy_finds():
    P, y = with_outliers(1)
    huber = least_squares(lambda b: P @ b - y, TRUE, loss="huber", f_scale=1.345 * 0.1).x
    np.testing.assert_allclose(fitted(P, y, loss="huber", scale=0.1)[0], huber, atol=1e-5)

    def tukey(b):
        return np.sum(1 - np.maximum(1 - ((P @ b - y) / (4.685 * 0.1)) ** 2, 0.0) ** 3)

    least = minimize(tukey, TRUE, method="BFGS", options={"gtol": 1e-10}).x
    np.testing.assert_allclose(fitted(P, y, loss="bisquare", scale=0.1)[0], least, atol=1e-5)


@pytest.mark.parametrize("loss", LOSSES)
def test_a_loss_has_the_slope_of_its_weighted_residual_and_is_efficient_for_normal_noise(loss):
    """Its efficiency is the square of the mean slope by the mean square of `w(r) r`."""
    r, h = np.linspace(-9, 9, 36_001) + 1e-5, 1e-7
    density = np.exp(-(r**2) / 2) / np.sqrt(2 * np.pi) * (r[1] - r[0])
    above, psi, below = (x * loss_weights(loss, x) for x in (r + h, r, r - h))
    slope = LOSSES[loss].slope(loss_weights(loss, r))
    np.testing.assert_allclose(slope, (above - below) / (2 * h), atol=1e-5)
    assert (density @ slope) ** 2 / (density @ psi**2) == pytest.approx(0.95, abs=1e-4)


def test_residuals_that_are_rounding_errors_of_the_output_have_its_scale():
    y = 500 * np.ones(7)
    for size, scale in ((3e-12, 1.4826 * 3e-12), (0.3e-12, 1e-12), (0.0, 1e-12)):
        assert scale_of(500 * size * np.ones(7), y) == pytest.approx(500 * scale)
    assert scale_of(0 * y, 0 * y) == 1.0


def test_beyond_the_largest_tuning_no_loss_gives_a_sample_much_weight():
    assert max(loss_weights(loss, np.array([LARGEST_TUNING]))[0] for loss in LOSSES) < 0.3


def test_a_law_without_noise_is_found_beside_outliers():
    exact = fitted(*with_outliers(3, noise=0.0), loss="bisquare")[0]
    np.testing.assert_allclose(exact, TRUE, atol=1e-9)


def test_errors_by_curve_are_the_sandwich_of_few_samples():
    """`(P'P)^-1 (sum s_c s_c') (P'P)^-1 G/(G-1) (n-1)/(n-k)`: 24 samples of six curves."""
    rng, curve = np.random.default_rng(3), np.repeat(np.arange(6), 4)
    P = columns(rng.uniform(-1, 1, 24))
    y = P @ TRUE + rng.normal(size=6)[curve]
    left = y - P @ np.linalg.lstsq(P, y, rcond=None)[0]
    sums = np.array([P[curve == c].T @ left[curve == c] for c in range(6)])
    inverse = np.linalg.inv(P.T @ P)
    cov = inverse @ sums.T @ sums @ inverse * 6 / 5 * 23 / 21
    assert fitted(P, y, curves=curve)[1] == pytest.approx(np.sqrt(np.diag(cov)))


def test_four_curves_are_too_few_for_sums_and_curves_may_count_alike():
    P, y = with_outliers(0)
    curve = np.repeat([0, 1, 2, 3, 4], [80, 60, 40, 19, 1])
    assert [fitted(P, y, curves=one)[2].curves for one in (curve, curve % 4)] == [5, 0]
    mean = fitted(P[:, :1], 1.0 * curve, curves=curve, alike=True)[0]
    assert mean == pytest.approx([2.0])  # of five curves
    assert fitted(P[:, :1], 1.0 * curve, curves=curve)[0] == pytest.approx([curve.mean()])


@pytest.mark.parametrize(("terms", "numbers"), [(5, [1, 0, 1, 2, 3, 4, 5]), (6, None)])
def test_errors_of_curves_need_more_curves_than_terms(terms, numbers):
    labels = np.array([2, 0, 2, 4, 5, 6, 9])
    found = numbered_curves(labels, terms)
    assert (found if found is None else found.tolist()) == numbers


@pytest.mark.parametrize(("size", "outlier"), [(0.1, None), (1.01, 3), (-1.01, 3), (0.99, None)])
def test_a_gross_outlier_is_twenty_deviations_from_a_fit_to_the_other_samples(size, outlier):
    P = columns(np.linspace(-1, 1, 7))
    y = P @ TRUE + 0.1 * np.array([1, -2, 2, 0, -1, 2, -2])

    def without(i):
        """The value of a fit to the other samples, and the deviation of the sample from it."""
        rest = np.arange(7) != i
        theta, (square,), *_ = np.linalg.lstsq(P[rest], y[rest], rcond=None)
        spread = 1 + P[i] @ np.linalg.inv(P[rest].T @ P[rest]) @ P[i]
        return P[i] @ theta, np.sqrt(spread * square / 3)

    value, deviation = without(3)
    y[3] = value + size * 20 * deviation
    found, worst = gross_outlier(P, y)
    expected = [(y[i] - without(i)[0]) / without(i)[1] for i in range(7)]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    assert worst == outlier
    for own, freedom in ((1e-9, 2), (1e-10, 3)):  # two columns that are almost the same one
        alike = P[:5, 1:2] * [1, 1] + own * P[:5, 2:] * [0, 1]
        assert gross_outlier(alike, y[:5])[0].any() == (freedom == 3)
    zeros, none = gross_outlier(P[:6], y[:6])  # two degrees of freedom of the others
    assert (zeros.tolist(), none) == ([0.0] * 6, None)


def test_a_row_of_the_table_has_the_coefficient_in_its_standard_errors():
    x = np.linspace(0, 1, 30)
    found = frols(columns(x), 2 + 3 * x + 0.1 * np.sin(40 * x), max_terms=2)
    for row in found.table():
        assert row["t"] == pytest.approx(row["coefficient"] / row["standard_error"])


@pytest.mark.parametrize(
    ("worth", "curves", "freedom"),
    [(np.nan, 0, 28), (10.9, 0, 8), (2.5, 0, 1), (29.0, 0, 27), (500.0, 0, 28), (10.9, 6, 5)],
)
def test_degrees_of_freedom_are_of_what_samples_are_worth(worth, curves, freedom):
    """Thirty samples and two terms; of curves, those less one."""
    x = np.linspace(0, 1, 30)
    found = frols(columns(x), 2 + 3 * x + 0.1 * np.sin(40 * x), max_terms=2)
    assert replace(found, worth=worth, curves=curves).freedom == freedom


@pytest.mark.parametrize(("outlier", "start"), [(None, [1, 0.5, 1]), (1, [1, 1e-12, 1])])
def test_an_outlier_gets_almost_no_weight_and_given_weights_are_kept(outlier, start):
    weights = np.array([1, 0.5, 1])
    found = Weighing().without(outlier, weights)
    assert (found.start.tolist(), found.outlier) == (start, outlier)
    assert weights.tolist() == [1, 0.5, 1]
