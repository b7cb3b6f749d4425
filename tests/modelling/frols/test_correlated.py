"""Standard errors along recordings: against the covariance of the noise in full, and against what
simulated recordings scatter by.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag, toeplitz
from scipy.signal import lfilter

from mapmore_cli.domain.fits import BY_CURVE, BY_RECORDING, LOWER_BOUND
from mapmore_cli.modelling.frols import Weighing, frols
from mapmore_cli.modelling.frols.correlated import correlated_errors

LENGTHS = (500, 300)


def regressors(lengths=LENGTHS):
    """A constant, strokes, and their square."""
    x = np.concatenate([np.abs(np.linspace(0, 6, n) % 2 - 1) * 2 - 1 for n in lengths])
    return np.column_stack([x**0, x, x**2])


def noise(rng, kept, lengths=LENGTHS):
    """Autoregressive noise of first order, of variance one, for each recording."""
    innovations = [rng.standard_normal(n + 600) * np.sqrt(1 - kept**2) for n in lengths]
    return np.concatenate([lfilter([1], [1, -kept], one)[600:] for one in innovations])


def newey_west(P, e, lags):
    """The formula of statsmodels' `cov_hac` with Bartlett's weights, written out."""
    scores, inverse = P * e[:, None], np.linalg.inv(P.T @ P)
    total = scores.T @ scores
    for lag in range(1, lags + 1):
        part = scores[lag:].T @ scores[:-lag]
        total += (1 - lag / (lags + 1)) * (part + part.T)
    return np.sqrt(np.diag(inverse @ total @ inverse))


def simulated(kept, white, count):
    """Mean told errors, those of Newey and West at statsmodels' default of lags, and the scatter of
    the coefficients of so many fits, (3, k).
    """
    rng, P = np.random.default_rng(round(100 * kept)), regressors()
    lags = int(4 * (len(P) / 100) ** (2 / 9))
    found = []
    for _ in range(count):
        y = np.sqrt(1 - white) * noise(rng, kept) + np.sqrt(white) * rng.standard_normal(len(P))
        theta = np.linalg.lstsq(P, y, rcond=None)[0]
        e = y - P @ theta
        found.append((correlated_errors(P, e, LENGTHS)[0], newey_west(P, e, lags), theta))
    told, hac, theta = np.swapaxes(found, 0, 1)
    return np.array([told.mean(axis=0), hac.mean(axis=0), theta.std(axis=0)])


@pytest.mark.parametrize(
    "kept", [0.0, 0.97, *(pytest.param(one, marks=pytest.mark.long) for one in (0.5, 0.9))]
)
def test_told_errors_are_what_coefficients_scatter_by(kept):
    told, hac, scatter = simulated(kept, 0.0, 120)
    assert told == pytest.approx(scatter, rel=0.25)
    if kept > 0.9:  # a sum over few lags sees half of it
        assert (hac[:2] < 0.6 * scatter[:2]).all()


@pytest.mark.long
def test_white_noise_does_not_hide_a_drift():
    told, _, scatter = simulated(0.97, 0.5, 120)
    assert told == pytest.approx(scatter, rel=0.25)


def test_of_many_samples_they_are_those_of_the_covariance_of_the_noise():
    """The whole matrix of the noise, from which each recording is drawn, against what is matched to
    the residuals of long ones.
    """
    lengths = (3000, 2000)
    P, rng = regressors(lengths), np.random.default_rng(5)
    kept = 0.8
    cov = block_diag(*(toeplitz(kept ** np.arange(n)) for n in lengths))
    inverse = np.linalg.inv(P.T @ P)
    exact = np.sqrt(np.diag(inverse @ P.T @ cov @ P @ inverse))
    e = noise(rng, kept, lengths)
    e -= P @ np.linalg.lstsq(P, e, rcond=None)[0]
    told, worth = correlated_errors(P, e, lengths)
    assert told == pytest.approx(exact, rel=0.15)
    assert worth == pytest.approx(5000 * 0.2 / 1.8, rel=0.3)


def test_the_order_of_the_rows_does_not_matter_but_that_of_the_recording():
    rng, P = np.random.default_rng(2), regressors((400,))
    y = P @ [1.0, 2.0, -1.0] + 0.1 * noise(rng, 0.95, (400,))
    mixed, time = rng.permutation(400), np.arange(400)
    told = frols(P, y, weighing=Weighing(recorded=time))
    same = frols(P[mixed], y[mixed], weighing=Weighing(recorded=mixed))
    assert same.theta_error == pytest.approx(told.theta_error, rel=1e-6)
    plain = frols(P, y)
    assert (told.theta_error > 2 * plain.theta_error).all()
    assert told.freedom < 30 < plain.freedom
    with_few = frols(P[:3], y[:3], weighing=Weighing(recorded=time[:3]))
    assert np.isnan(with_few.theta_error).all()


def test_a_selection_says_what_its_standard_errors_take_residuals_to_be():
    """Lower bounds, unless curves or what goes together along a recording were counted."""
    P, rng = regressors(), np.random.default_rng(0)
    y = P @ [1.0, 2.0, 3.0] + noise(rng, 0.9)
    alone = frols(P, y, max_terms=3)
    along = frols(P, y, max_terms=3, weighing=Weighing(recorded=np.arange(len(y))))
    assert [one.errors_note for one in (alone, along, replace(along, curves=7))] == [
        LOWER_BOUND,
        BY_RECORDING,
        BY_CURVE,
    ]
