"""Rates and resampling on stamps as loggers write them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import savgol_filter

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.signals.rates import rate
from mapmore_cli.modelling.signals.sampling import resample


def rounded_stamps(seed: int, n: int) -> np.ndarray:
    """Stamps at about 550 Hz as a logger writes them: jittered, rounded to 1 ms, some repeating."""
    steps = np.random.default_rng(seed).uniform(0.0008, 0.0028, n)
    return np.round(np.cumsum(steps), 3)


@given(
    seed=st.integers(0, 2**31),
    order=st.integers(1, 5),
    degree=st.integers(0, 5),
    offset=st.sampled_from([0.0, 1e3, -1e5]),
)
def test_polynomial_up_to_the_order_has_its_exact_rate_on_rounded_stamps(seed: int, order: int, degree: int, offset: float) -> None:
    degree = min(degree, order)
    time = rounded_stamps(seed, 150)
    c = np.random.default_rng(seed + 1).uniform(-3, 3, degree + 1)
    values = np.polynomial.polynomial.polyval(time, c) + offset
    exact = np.polynomial.polynomial.polyval(time, np.polynomial.polynomial.polyder(c)) if degree else np.zeros_like(time)
    np.testing.assert_allclose(rate(time, values, 0.04, order), exact, atol=1e-6 * (1 + abs(offset) / 100))


@pytest.mark.parametrize("order", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("half", [3, 5, 12])
def test_even_stamps_give_the_filter_of_scipy_ends_included(order: int, half: int) -> None:
    step = 0.01
    time = 7.0 + step * np.arange(200)
    values = np.random.default_rng(order).normal(size=200)
    expected = savgol_filter(values, 2 * half + 1, order, deriv=1, delta=step, mode="interp")
    np.testing.assert_allclose(rate(time, values, 2 * half * step, order), expected, rtol=1e-8, atol=1e-8)


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 2**31), row=st.integers(0, 149))
def test_uneven_stamps_give_the_slope_of_a_fit_to_the_window(seed: int, row: int) -> None:
    time = rounded_stamps(seed, 150)
    values = np.random.default_rng(seed + 1).normal(size=150)
    begin = np.clip(time[row] - 0.02, time[0], time[-1] - 0.04)
    inside = (time >= begin - 1e-9) & (time <= begin + 0.04 + 1e-9)
    slope = np.polyfit(time[inside] - time[row], values[inside], 2)[1]
    assert rate(time, values, 0.04, 2)[row] == pytest.approx(slope, rel=1e-6, abs=1e-6)


def test_blocks_do_not_show(monkeypatch: pytest.MonkeyPatch) -> None:
    time = rounded_stamps(1, 500)
    values = np.sin(9 * time)
    whole = rate(time, values, 0.04, 3)
    monkeypatch.setattr("mapmore_cli.modelling.signals.rates.BLOCK", 70)
    np.testing.assert_allclose(rate(time, values, 0.04, 3), whole, rtol=1e-10)


@pytest.mark.parametrize(
    ("time", "window", "order", "parts"),
    [
        (0.01 * np.arange(50), 0.02, 3, ["0.02 s", "3 different", "needs 4", "wider"]),
        (np.repeat([0.0, 1.0, 2.0], 40), 2.0, 3, ["3 different", "needs 4"]),
        (np.array([0.0]), 1.0, 1, ["1 different"]),
        (np.array([0.0, 1e-160, 2e-160, 3e-160]), 1.0, 3, ["too close together", "wider"]),
        (np.array([0.0, 0.01, 0.02, 0.03, 5.0]), 0.03, 2, ["t = 5 s", "1 different"]),
    ],
)
def test_window_with_too_few_stamps_says_what_to_do(time: np.ndarray, window: float, order: int, parts: list[str]) -> None:
    with pytest.raises(DataError) as caught:
        rate(time, time**2, window, order)
    assert all(part in str(caught.value) for part in parts), str(caught.value)


@settings(deadline=None)
@given(
    n=st.integers(2, 400),
    ratio=st.floats(0.1, 30),
    slope=st.floats(-100, 100),
    start=st.floats(-1e3, 1e3),
    jitter=st.floats(0, 0.3),
    seed=st.integers(0, 99),
)
def test_straight_lines_stay_straight_on_even_stamps(n: int, ratio: float, slope: float, start: float, jitter: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    time = start + 0.01 * (np.arange(n) + jitter * rng.uniform(-1, 1, n))
    step = 0.01 * ratio
    stamps, columns = resample(time, {"time": time, "x": 3 + slope * (time - start)}, step)
    assert list(columns) == ["x"]
    np.testing.assert_allclose(np.diff(stamps), step, rtol=1e-6)
    assert len(stamps) == 0 or (stamps[0] >= time[0] - 1e-9 and stamps[-1] <= time[-1] + step)
    assert len(stamps) >= int((time[-1] - time[0]) / step)
    means_inside = slice(1, -1)  # at both ends, the first and the last mean are held
    np.testing.assert_allclose(columns["x"][means_inside], (3 + slope * (stamps - start))[means_inside], atol=1e-6 * (1 + abs(slope)))


@pytest.mark.parametrize("samples", [2, 3, 10])
def test_blocks_of_an_even_record_are_plain_means(samples: int) -> None:
    time = 5 + 0.001 * np.arange(12 * samples + 1)
    x = np.random.default_rng(1).normal(size=len(time))
    stamps, columns = resample(time, {"x": x}, 0.001 * samples)
    np.testing.assert_allclose(columns["x"], x[: 12 * samples].reshape(12, samples).mean(axis=1), atol=1e-9)
    np.testing.assert_allclose(stamps, time[: 12 * samples].reshape(12, samples).mean(axis=1), rtol=0, atol=1e-9)


def test_what_the_new_rate_cannot_show_is_averaged_away() -> None:
    time = np.arange(10_000) * 0.001
    hum = np.sin(2 * np.pi * 100 * time)  # a whole period in each step of 10 ms: picking samples would alias it to a constant
    _, columns = resample(time, {"x": hum + 7}, 0.01)
    np.testing.assert_allclose(columns["x"], 7, atol=1e-6)


def test_finer_steps_are_interpolated() -> None:
    stamps, columns = resample(np.array([0.0, 1.0, 2.0]), {"x": np.array([0.0, 4.0, 0.0])}, 0.25)
    np.testing.assert_allclose(stamps, np.arange(9) * 0.25)
    np.testing.assert_allclose(columns["x"], [0, 1, 2, 3, 4, 3, 2, 1, 0])


def test_record_shorter_than_a_step_has_nothing_to_say() -> None:
    stamps, columns = resample(np.array([0.0, 0.1, 0.2]), {"x": np.ones(3)}, 1.0)
    assert stamps.size == columns["x"].size == 0
