"""Operators along a piece: against their recursions, written out sample by sample."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from memory_samples import resonance, slow

from mapmore_cli.modelling.expressions.operator import Setting, along
from mapmore_cli.modelling.expressions.operators import OPERATORS as DECLARED
from mapmore_cli.modelling.memory.states import delayed
from mapmore_cli.rig.muscle import stop as rig_stop

PATHS = arrays(float, st.integers(1, 60), elements=st.floats(-10, 10, width=32))


def play(x, width):
    return along(DECLARED["play"], x, Setting((1.0,), 0.01, (0.0, width)))


def stop(x, width):
    return along(DECLARED["stop"], x, Setting((1.0,), 0.01, (0.0, width)))


def resonance_velocity(x, frequency, damping, step):
    return resonance(x, frequency, damping, step, "resonance_velocity")


@given(PATHS, st.integers(1, 70))
def test_delayed_values_are_those_of_earlier_samples(x, steps):
    values = delayed(x, steps)
    assert np.isnan(values[:steps]).all()
    np.testing.assert_array_equal(values[steps:], x[: max(len(x) - steps, 0)])


@settings(deadline=None)
@given(PATHS, st.floats(1e-3, 100))
def test_slow_follows_its_recursion_from_rest(x, tau):
    a, s = np.exp(-0.01 / tau), x[0]
    expected = [s := a * s + (1 - a) * now for now in x]
    np.testing.assert_allclose(slow(x, tau, 0.01), expected, rtol=1e-9, atol=1e-9)


@given(PATHS, st.floats(0.01, 20))
def test_play_follows_its_recursion(x, width):
    w = x[0]
    expected = [w := min(max(w, now - width), now + width) for now in x]
    np.testing.assert_array_equal(play(x, width), expected)


@given(PATHS, st.floats(0.01, 20))
def test_stop_is_the_elasto_slide_operator_of_the_rig(x, width):
    np.testing.assert_allclose(stop(x, width), width * rig_stop(x, np.array([width]))[:, 0], atol=1e-12 + 1e-14 * len(x) * np.abs(x).max())


@given(PATHS, st.floats(0.01, 20), st.lists(st.integers(1, 4), min_size=60, max_size=60))
def test_play_does_not_depend_on_how_fast_the_path_is_run(x, width, repeats):
    each = np.array(repeats[: len(x)])
    last = np.cumsum(each) - 1
    np.testing.assert_array_equal(play(np.repeat(x, each), width)[last], play(x, width))


@settings(deadline=None)
@given(PATHS, st.floats(0.1, 15), st.floats(0.01, 0.95))
def test_resonance_follows_its_recursion_from_rest(x, frequency, damping):
    step, w = 0.01, 2 * np.pi * frequency
    q, th = np.exp(-damping * w * step), w * step * np.sqrt(1 - damping**2)
    y, before, velocity, expected = x[0], x[0], [], []
    for now in x:
        y, before = 2 * q * np.cos(th) * y - q**2 * before + (1 - 2 * q * np.cos(th) + q**2) * now, y
        expected.append(y)
        velocity.append((y - before) / (w * step))
    np.testing.assert_allclose(resonance(x, frequency, damping, step), expected, rtol=1e-7, atol=1e-7)
    found = resonance_velocity(x, frequency, damping, step)
    assert found[0] == 0.0
    np.testing.assert_allclose(found[1:], velocity[1:], rtol=1e-5, atol=1e-5)


def test_resonance_rings_at_its_frequency_with_its_decay():
    step, frequency, damping = 1e-3, 4.0, 0.1
    y = resonance(np.r_[0.0, np.ones(5000)], frequency, damping, step)
    peaks = np.flatnonzero((np.diff(y)[:-1] > 0) & (np.diff(y)[1:] <= 0)) + 1
    assert np.diff(peaks[:4]) * step == pytest.approx(1 / (frequency * np.sqrt(1 - damping**2)), rel=5e-3)
    over = y[peaks[:4]] - 1
    assert over[1:] / over[:-1] == pytest.approx(np.exp(-2 * np.pi * damping / np.sqrt(1 - damping**2)), rel=5e-3)
    assert y[-1] == pytest.approx(1.0, abs=1e-4)


OPERATORS = {
    "slow": lambda x: slow(x, 0.05, 0.01),
    "play": lambda x: play(x, 1.0),
    "stop": lambda x: stop(x, 1.0),
    "resonance": lambda x: resonance(x, 4.0, 0.2, 0.01),
    "velocity": lambda x: resonance_velocity(x, 4.0, 0.2, 0.01),
}


@pytest.mark.parametrize("name", OPERATORS)
@given(x=PATHS, empty=st.integers(1, 5))
def test_what_the_source_leaves_empty_at_the_beginning_stays_empty(name, x, empty):
    operator = OPERATORS[name]
    values = operator(np.r_[np.full(empty, np.nan), x])
    assert np.isnan(values[:empty]).all()
    np.testing.assert_allclose(values[empty:], operator(x), atol=1e-9)
    assert np.isnan(operator(np.full(empty, np.nan))).all()
    assert len(operator(np.empty(0))) == 0
