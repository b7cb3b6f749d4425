from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import savgol_filter

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.signals.rates import rate


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
