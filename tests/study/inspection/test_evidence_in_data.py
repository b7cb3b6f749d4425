"""What recordings show: settling, what was held, copies of a signal, and spikes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.annexes.drafting.experiment import find_held, goes_in_cycles, levels_to_hold_out
from mapmore_cli.checking.evidence import (
    same_signals,
    settling,
    spikes,
)
from mapmore_cli.domain.recording import Recording
from mapmore_cli.modelling.expressions.operator import linear, run_recursion


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


def strokes(pressures, rows=slice(None)):
    """Strokes there and back, each at a pressure or the course of one."""
    return [
        recording(time=T[rows], pressure=(pressure + 0 * T)[rows], strain=0.2 * LOOP[rows])
        for pressure in pressures
    ]


LEVELS = np.array([[1], [2], [3]])
BOTH = ("pressure", "strain")


@pytest.mark.parametrize(
    ("pressures", "at", "off"),
    [
        (
            np.random.default_rng(3).normal([[80], [150], [250], [350]], 0.7, (4, T.size)),
            [80, 150, 250, 350],
            0,
        ),
        # a closed or slow supply: the pressure dwells at both ends of every stroke, and each
        # recording has its own
        (100 * (LEVELS + np.where(T < 20, 0.2, -0.2) + 0.02 * np.sin(7 * T)), [100, 200, 300], 25),
        # it rests at the end of a stroke, and is far lower on the way back: the median would leave
        # that to the level below
        (100 * (LEVELS + np.where(T < 30, 0.0, -0.6)), [70, 170, 270], 0),
    ],
)
def test_what_hardly_moves_was_held(pressures, at, off):
    recordings = strokes(pressures)
    held = find_held(recordings, BOTH)
    assert (held.of, held.swept) == BOTH
    np.testing.assert_allclose(held.at, at, rtol=0, atol=off)
    assert goes_in_cycles(recordings, held)
    there = strokes(pressures, slice(T.size // 2))
    assert not goes_in_cycles(there, find_held(there, BOTH))


def test_holds_within_one_recording_keep_the_ways_between_out():
    holds = np.concatenate(
        [
            np.concatenate([np.full(T.size, e), np.linspace(e, e + 0.1, 300)])
            for e in (0.0, 0.1, 0.2)
        ]
    )[:-300]
    loops = np.concatenate([np.concatenate([500 * LOOP, np.zeros(300)]) for _ in range(3)])[:-300]
    held = find_held([recording(pressure=loops, strain=holds)], BOTH)
    assert (held.of, held.at.tolist()) == ("strain", [0, 0.1, 0.2])
    assert held.within < 0.02


def test_nothing_was_held_where_both_move_or_only_one_level_was():
    assert find_held(strokes([500 * LOOP]), BOTH) is None
    assert find_held(strokes([100]), BOTH) is None


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


@settings(deadline=None)
@given(st.lists(st.floats(0, 1e3), unique=True, max_size=20).map(sorted))
def test_held_out_levels_are_inner_ones(levels):
    inner = levels_to_hold_out(levels)
    assert set(inner) <= set(levels[1:-1])
    assert bool(inner) == (len(levels) >= 3)
    assert len(levels) - len(inner) >= min(len(levels), 2)


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
        values = run_recursion(linear([0.7], [0.3]), values) + 1e-3 * rng.normal(size=n)
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
