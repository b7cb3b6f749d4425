from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.modelling.signals.sampling import resample


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
