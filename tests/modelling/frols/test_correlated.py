"""Standard errors along recordings: against the covariance of the noise in full, and against what
simulated recordings scatter by.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag, toeplitz
from scipy.signal import lfilter
from scipy.stats import chi2

from mapmore_cli.domain.fits import BY_CURVE, BY_RECORDING, LOWER_BOUND
from mapmore_cli.modelling.frols import Weighing, correlated, frols, weighing
from mapmore_cli.modelling.frols.correlated import _Records, correlated_errors

LENGTHS = (500, 300)


def regressors(lengths=LENGTHS):
    """A constant, strokes, and their square."""
    x = np.concatenate([np.abs(np.linspace(0, 6, n) % 2 - 1) * 2 - 1 for n in lengths])
    return np.column_stack([x**0, x, x**2])


def noise(rng, kept, lengths=LENGTHS):
    """Autoregressive noise of first order, of variance one, for each recording."""
    innovations = [rng.standard_normal(n + 600) * np.sqrt(1 - kept**2) for n in lengths]
    return np.concatenate([lfilter([1], [1, -kept], one)[600:] for one in innovations])


def apart(lengths):
    """How many samples lie between two of one recording, (n, n); infinite for two recordings."""
    blocks = [np.abs(np.subtract.outer(np.arange(n), np.arange(n))) + 1.0 for n in lengths]
    between = block_diag(*blocks)
    return np.where(between > 0, between - 1, np.inf)


def records_of(lengths, count=3):
    rng = np.random.default_rng(7)
    basis = np.linalg.qr(rng.normal(size=(sum(lengths), count)))[0]
    return _Records(basis, rng.normal(size=sum(lengths)), lengths)


def test_sums_over_lags_have_the_expected_values_of_whole_matrices():
    """`tr(L M R M)` with the projection M, the correlations R, and the mean L of both shifts."""
    records, kept = records_of((40, 27, 1)), 0.7
    distance, e = apart(records.lengths), records.residual
    assert records.lags == [0, 1, 2, 4]  # up to an eighth of forty samples
    R, M = kept**distance, np.eye(len(e)) - records.basis @ records.basis.T
    shifts = [np.where(distance == lag, 0.5 if lag else 1.0, 0.0) for lag in records.lags]
    assert records.pairs.tolist() == pytest.approx([shift.sum() for shift in shifts])
    np.testing.assert_allclose(records.sums, [e @ shift @ e for shift in shifts])
    np.testing.assert_allclose(
        records.expected(kept), [np.trace(shift @ M @ R @ M) for shift in shifts]
    )


@pytest.mark.parametrize(("lengths", "kept"), [((400, 300), 0.8), ((2000, 30), 0.998)])
def test_noise_is_matched_to_its_expected_sums(lengths, kept):
    """Also if a drift lasts for a quarter of the longest recording."""
    records = records_of(lengths)
    sums = 0.3 * records.expected(0.0) + 2.0 * records.expected(kept)
    size = np.sqrt(sums[0]) / np.linalg.norm(records.residual)
    known = replace(records, residual=size * records.residual)
    vars(known)["sums"] = sums
    found = correlated.matched(known)
    assert (found.white, found.drift) == pytest.approx((0.3, 2.0), rel=0.05)
    assert found.kept == pytest.approx(kept, rel=0.01)
    assert correlated.Noise(0.0).worth == 1


def test_the_first_samples_of_a_long_record_show_the_noise_and_all_samples_its_size(monkeypatch):
    records = replace(records_of((400, 300)), residual=noise(np.random.default_rng(1), 0.9, [700]))
    part = records.first(420)
    assert (part.lengths, len(part.residual)) == ([400, 20], 420)
    own = correlated.matched(part)
    monkeypatch.setattr(correlated, "PART", 420)
    found = correlated.matched(records)
    assert (found.kept, found.white / found.drift) == (own.kept, own.white / own.drift)
    assert found.white + found.drift == pytest.approx(records.residual @ records.residual / 697)
    late = replace(records, residual=records.residual * (np.arange(700) >= 420))
    assert correlated.matched(late).drift > 0  # the first samples show no noise


@pytest.mark.parametrize(
    ("lengths", "factor", "found"),
    [
        ((400, 300), 0.98, False),
        ((400, 300), 1.02, True),
        ((20, 3), 3, True),  # a recording of 20 samples is enough
        ((19, 4), 3, False),
    ],
)
def test_a_drift_is_found_only_if_chance_explains_the_sums_once_in_a_hundred(
    lengths, factor, found
):
    """The squared distance of the sums from those of white noise is a chi square."""
    records = records_of(lengths)
    white = records.residual @ records.residual / (sum(lengths) - 3)
    limit, squares = chi2.isf(0.01, len(records.lags) - 1), records.pairs[1:]
    sums = white * records.expected(0.0)
    sums[1:] += factor * white * np.sqrt(limit * squares / len(squares))
    known = replace(records)
    vars(known)["sums"] = sums
    assert (correlated.matched(known).drift > 0) == found


@pytest.mark.parametrize("ridge", [None, np.array([1.0, 20.0, 300.0])])
def test_standard_errors_are_those_of_the_covariance_of_the_noise(ridge, monkeypatch):
    lengths = (50, 30)
    monkeypatch.setattr(correlated, "matched", lambda _: correlated.Noise(0.3, 2.0, 0.8))
    P, n = regressors(lengths), 80
    cov = 0.3 * np.eye(n) + 2.0 * 0.8 ** apart(lengths)
    inverse = np.linalg.inv(P.T @ P + np.diag(np.zeros(3) if ridge is None else ridge))
    errors, worth = correlated_errors(P, np.zeros(n), lengths, ridge)
    exact = np.sqrt(np.diag(inverse @ P.T @ cov @ P @ inverse))
    np.testing.assert_allclose(errors, exact)
    long = toeplitz(2.0 * 0.8 ** np.arange(2000)) + 0.3 * np.eye(2000)
    assert worth == pytest.approx(80 * 2.3 / (long.sum() / 2000), rel=5e-3)


def test_the_order_of_the_rows_does_not_matter_but_that_of_the_recording(monkeypatch):
    rng, P = np.random.default_rng(2), regressors((400,))
    y = P @ [1.0, 2.0, -1.0] + 0.1 * noise(rng, 0.95, (400,))
    mixed, time = rng.permutation(400), np.arange(400)
    told = frols(P, y, weighing=Weighing(recorded=time))
    same = frols(P[mixed], y[mixed], weighing=Weighing(recorded=mixed))
    assert same.theta_error == pytest.approx(told.theta_error, rel=1e-6)
    plain = frols(P, y)
    assert (told.theta_error > 2 * plain.theta_error).all()
    assert told.freedom < 30 < plain.freedom
    for most, counted in ((3 * 400, True), (3 * 400 - 1, False)):
        monkeypatch.setattr(weighing, "MOST", most)
        found = frols(P, y, weighing=Weighing(recorded=time))
        assert (found.freedom == told.freedom) == counted
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
