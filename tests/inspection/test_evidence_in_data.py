"""What recordings show: settling, what was held, copies of a signal, and spikes."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.checking.evidence import (
    same_signals,
    settling,
    spikes,
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
LOOP = 1 - np.abs(T / 20 - 1)


def test_steps_are_told_from_sweeps():
    def rests(pressure):
        return settling([recording(time=T, pressure=pressure)]).share_between

    assert rests(500 * (np.floor(10 * LOOP) / 10)) > 0.5 > rests(2000 * LOOP)
    assert settling([recording(time=T, pressure=0 * T + 100)]) is None


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


@settings(max_examples=300, deadline=None)
@given(smooth_signals())
def test_noise_has_no_spikes(values):
    assert not spikes(values).size


@settings(deadline=None)
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
