"""What recordings show: settling, what was held, copies of a signal, and spikes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmore_cli.checking.evidence import (
    same_signals,
    settling,
    spikes,
    two_digits,
)
from mapmore_cli.domain.recording import Recording
from mapmore_cli.modelling.expressions.operator import from_rest, linear


def recording(**columns):
    return Recording(
        "r",
        "r.csv",
        {name: np.asarray(values, dtype=float) for name, values in columns.items()},
        len(columns["pressure"]),
        {},
    )


T = np.arange(0, 40, 0.02)


def test_one_signal_in_two_units_is_found_and_a_loop_is_none():
    one = np.sin(T)
    assert same_signals([one, np.cos(T), 7 - 3 * one]) == [[0, 2]]
    assert same_signals([one, one + 0.1 * np.cos(T)]) == []
    assert same_signals([np.ones(400), np.ones(400)]) == []


@st.composite
def smooth_signals(draw):
    """Sums of slow waves with normal noise of any size, as records of a sensor are."""
    n, seed = draw(st.integers(30, 3000)), draw(st.integers(0, 2**32 - 1))
    rng, time = np.random.default_rng(seed), np.arange(n)
    waves = [
        rng.normal() * np.sin(2 * np.pi * time * rng.uniform(0, 1 / 12) + rng.uniform(0, 7))
        for _ in range(draw(st.integers(1, 5)))
    ]
    noisy = sum(waves) + 10 ** draw(st.floats(-6, 1)) * rng.normal(size=n)
    resolution = draw(st.sampled_from([0.0, 1e-3, 0.05, 0.5]))  # of the converter
    return np.round(noisy / resolution) * resolution if resolution else np.asarray(noisy)


@given(smooth_signals())
def test_noise_has_no_spikes(values):
    assert not spikes(values).size


@given(st.integers(30, 2000), st.integers(0, 2**32 - 1), st.sampled_from(["two", "many", "steps"]))
def test_commands_and_steps_have_no_spikes(n, seed, kind):
    rng = np.random.default_rng(seed)
    held = rng.geometric(rng.uniform(0.02, 1.0), size=n)
    if kind == "steps":
        values = np.cumsum(rng.normal(size=n) * (rng.random(n) < 3 / n))
        values = from_rest(linear([0.7], [0.3]), values) + 1e-3 * rng.normal(size=n)
    else:
        values = np.repeat(
            rng.integers(0, 2, size=n) if kind == "two" else rng.uniform(size=n), held
        )[:n].astype(float)
    assert not spikes(values).size


@given(
    st.integers(40, 1000),
    st.integers(0, 2**32 - 1),
    st.floats(1.0, 100.0),
    st.sampled_from([-1.0, 1.0]),
)
def test_a_sample_that_left_the_range_is_a_spike(n, seed, height, sign):
    rng = np.random.default_rng(seed)
    values = np.sin(np.arange(n) * rng.uniform(0.01, 0.1)) + 0.01 * rng.normal(size=n)
    place = int(rng.integers(1, n - 1))
    values[place] += sign * (2 + height)
    assert list(spikes(values)) == [place]


@pytest.mark.parametrize(
    ("step", "unit", "window"), [(0.02, "s", 0.16), (0.02, "ms", 0.16), (0.001, "s", 0.1)]
)
def test_shares_of_settled_samples_at_two_rates(step, unit, window):
    """A pressure that rises 30 at 3 per second, and 70 at 5: 4 is settled, of a range of 100."""
    seconds = np.arange(0, 24, step)
    time = seconds * {"s": 1, "ms": 1000}[unit]
    pressure = 20 + np.where(seconds < 10, 3 * seconds, 30 + 5 * (seconds - 10))
    settled = settling([recording(time=time, pressure=pressure)], unit)
    assert (settled.limit, settled.window) == (4.0, window)
    assert settled.share == pytest.approx(10 / 24, abs=0.005)
    assert settled.share_between == pytest.approx(20 / 3 / (20 / 3 + 12), abs=0.005)
    halves = zip(np.split(time, [600]), np.split(pressure, [600]), strict=True)
    parts = [recording(time=t, pressure=p) for t, p in halves]
    assert settling(parts, unit).share == pytest.approx(settled.share, abs=0.01)


def test_no_rate_without_a_clock_that_goes_on():
    pressure = np.sin(T)
    assert settling([recording(time=T, pressure=0 * T + 100)]) is None
    for time in (0 * T, np.where(T == 20, 0, T), np.where(T < 20, T, T + 100)[:1002]):
        assert settling([recording(time=time, pressure=pressure[: len(time)])]) is None


def test_as_a_person_rounds():
    numbers = [0.0123, 0.456, 9.96, 10.4, 123, 98765, 1.0]
    assert [two_digits(each) for each in numbers] == [0.012, 0.46, 10, 10, 120, 99000, 1]


def test_how_alike_signals_have_to_be_to_be_one():
    rng = np.random.default_rng(3)
    noise = rng.normal(size=len(T))
    noise /= noise.std()
    for share, same in ((0.012, True), (0.02, False)):  # a correlation of 1 - share^2 / 2
        assert bool(same_signals([np.sin(T), np.sin(T) + share * np.sin(T).std() * noise])) == same
    assert same_signals([T[:30], -T[:30]]) == [[0, 1]]
    assert same_signals([T[:29], -T[:29]]) == same_signals([T, T[:-1]]) == []
    assert same_signals([T, T**2, 3 - T**2, 1 + T, T * 2]) == [[0, 3, 4], [1, 2]]
