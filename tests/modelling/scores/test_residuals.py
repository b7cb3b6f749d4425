"""Residual tests, against definitions written down here and against errors whose cause is known."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mapmore_cli.modelling.validation.residuals import PARTS, autocorrelation, cross_correlation, means_over


@given(st.integers(0, 10**6), st.integers(40, 120))
def test_one_piece_is_the_textbook_formula(seed: int, n: int) -> None:
    random = np.random.default_rng(seed)
    e, u = random.normal(2, 1, n), random.normal(-3, 2, n)
    found = autocorrelation([e])
    c, d = e - e.mean(), u - u.mean()
    for lag, value in zip(found.lags, found.values, strict=True):
        np.testing.assert_allclose(value, sum(c[t] * c[t + int(lag)] for t in range(n - int(lag))) / sum(c**2), atol=1e-12)
    crossed = cross_correlation([e], [u])
    for lag, value in zip(crossed.lags.astype(int), crossed.values, strict=True):
        pairs = [(t, t + lag) for t in range(n) if 0 <= t + lag < n]
        np.testing.assert_allclose(value, sum(d[a] * c[b] for a, b in pairs) / np.sqrt(sum(c**2) * sum(d**2)), atol=1e-12)


def test_noise_stays_within_the_bounds_nineteen_times_in_twenty() -> None:
    random = np.random.default_rng(11)
    own = [autocorrelation([random.normal(size=150), random.normal(size=250)]) for _ in range(60)]
    crossed = [cross_correlation([random.normal(size=400)], [random.normal(size=400)]) for _ in range(60)]
    parts = [means_over(random.normal(size=400), random.uniform(size=400)) for _ in range(60)]
    for tests in (own, crossed, parts):
        assert 0.02 < sum(test.beyond for test in tests) / sum(test.tested for test in tests) < 0.08


def test_errors_with_memory_are_seen() -> None:
    noise = np.random.default_rng(2).normal(size=600)
    errors = np.convolve(noise, 0.8 ** np.arange(30))[:600]
    assert autocorrelation([errors]).beyond > 5


def test_a_forgotten_input_shows_at_its_lag() -> None:
    random = np.random.default_rng(4)
    u = random.normal(size=500)
    errors = np.concatenate([np.zeros(3), 0.5 * u[:-3]]) + random.normal(size=500)
    found = cross_correlation([errors], [u])
    assert found.lags[np.argmax(np.abs(found.values))] == 3
    assert found.values.max() > 3 * found.bound


def test_pieces_do_not_touch() -> None:
    """The end of one piece tells nothing of the beginning of the next."""
    ramp = np.linspace(-1, 1, 40)
    apart, joined = autocorrelation([ramp, -ramp, ramp]), autocorrelation([np.concatenate([ramp, -ramp, ramp])])
    total = 3 * np.sum(ramp**2)
    np.testing.assert_allclose(apart.values[1], 3 * np.sum(ramp[:-1] * ramp[1:]) / total)
    assert joined.values[1] > apart.values[1]  # +1 meets +1 where they were put together


def test_missing_values_count_nowhere() -> None:
    random = np.random.default_rng(5)
    e, u = random.normal(size=200), random.normal(size=200)
    e[::7] = np.nan
    assert np.isfinite(autocorrelation([e]).values).all()
    assert np.isfinite(cross_correlation([e], [u]).values).all()
    assert autocorrelation([e]).bound == 1.959964 / np.sqrt(np.isfinite(e).sum())


def test_parts_are_values_where_there_are_few_else_as_many_samples_each() -> None:
    random = np.random.default_rng(6)
    level = random.choice([80.0, 150.0, 250.0], 300)
    errors = np.where(level == 150, 1.0, 0.0) + random.normal(0, 0.5, 300)
    found = means_over(errors - errors.mean(), level)
    assert found.places.tolist() == [80.0, 150.0, 250.0]
    assert found.beyond == 3
    assert found.values[1] == np.mean((errors - errors.mean())[level == 150])
    assert len(means_over(errors, random.uniform(size=300)).places) == PARTS
