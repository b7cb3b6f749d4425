"""States: their numbers come from training samples alone, their values from one piece alone."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from memory_samples import STEP, recipe_of, record, resonance, slow, wandering

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.expressions import evaluate, parse
from mapmore_cli.modelling.expressions.operators.play import play
from mapmore_cli.modelling.memory.states import (
    evaluate_states,
    find_resonance,
    resolve_states,
    with_ranges,
)

RECIPE = recipe_of("y", (), max_terms=1)
NAMES = (
    "x",
    "x[k-2]",
    "slow(play(x, 0.2), 0.05)",
    "stop(slow(x, 0.1), 0.1)",
    "slow(saturate(x), 0.1)",
    "resonance(x, 3, 0.2)",
)


def test_widths_are_fractions_of_the_training_range_of_their_source():
    x = wandering(400)
    training = np.arange(400) < 200
    states = resolve_states(NAMES, [record(training, x=x, y=x)], RECIPE)
    assert states.ranges["x"] == (x[:200].min(), x[:200].max())
    lagging = slow(x, 0.1, STEP)
    assert states.ranges["slow(x, 0.1)"] == (lagging[:200].min(), lagging[:200].max())
    values = evaluate_states(states, {"x": x})
    np.testing.assert_array_equal(
        values["slow(play(x, 0.2), 0.05)"], slow(play(x, 0.2 * np.ptp(x[:200])), 0.05, STEP)
    )
    np.testing.assert_array_equal(
        values["slow(saturate(x), 0.1)"], slow(np.clip(x, *states.ranges["x"]), 0.1, STEP)
    )


@settings(max_examples=25)
@given(st.integers(20, 300), st.floats(0, 0.5), st.floats(0.01, 1e3), st.floats(-1e3, 1e3))
def test_scaled_states_span_one_in_training_and_are_clipped_beyond(n, margin, slope, offset):
    x = wandering(300)
    training = np.arange(300) < n
    asked = replace(RECIPE, scaling="range", margin=margin)
    physical, other = (
        evaluate_states(resolve_states(NAMES, [record(training, x=z, y=x)], asked), {"x": z})
        for z in (slope * x + offset, x)
    )
    for name in NAMES:
        taught = physical[name][:n][np.isfinite(physical[name][:n])]
        assert taught.min() == pytest.approx(0.0, abs=1e-12)
        assert taught.max() == pytest.approx(1.0, abs=1e-12)
        known = np.isfinite(physical[name])
        assert np.abs(physical[name][known] - 0.5).max() <= 0.5 + margin + 1e-12
        np.testing.assert_allclose(physical[name], other[name], atol=1e-5)  # units do not matter


def test_a_state_that_stood_still_in_training_is_zero():
    states = resolve_states(
        ["x"], [record(x=np.full(5, 3.0), y=np.arange(5.0))], replace(RECIPE, scaling="range")
    )
    np.testing.assert_array_equal(
        evaluate_states(states, {"x": np.array([1.0, 3.0, 9.0])})["x"], 0.0
    )


@pytest.mark.parametrize(("frequency", "damping"), [(1.59, 0.1), (4.46, 0.3), (10.3, 0.06)])
def test_the_resonance_of_a_recording_is_found(frequency, damping):
    x = np.repeat(np.random.default_rng(1).uniform(0, 1, 20), 100)
    y = 3 + 2 * x + x**2 + 0.5 * slow(x, 0.3, STEP) + 2 * resonance(x, frequency, damping, STEP)
    states = resolve_states(
        ["resonance(x)", "resonance_velocity(x)"],
        [record(x=x[:900], y=y[:900]), record(x=x[900:], y=y[900:])],
        RECIPE,
    )
    assert list(states.resonances) == ["x"]
    found = states.resonances["x"]
    assert found[0] == pytest.approx(frequency, rel=0.06)
    assert found[1] == pytest.approx(damping, rel=0.35)
    np.testing.assert_array_equal(
        evaluate_states(states, {"x": x})["resonance(x)"], resonance(x, *found, STEP)
    )


REFUSED = [
    ("x[k-99]", {"scaling": "range"}, r"`x\[k-99\]` has no value on any training sample"),
    *((name, {}, "no column `z`") for name in ("z", "slow(z, 1)", "play(z, 0.1)")),
]


@pytest.mark.parametrize(("name", "changed", "told"), REFUSED)
def test_a_state_without_values_is_refused(name, changed, told):
    columns = {"x": wandering(50), "y": wandering(50, 1)}
    with pytest.raises(DataError, match=told):
        evaluate_states(
            resolve_states([name], [record(**columns)], replace(RECIPE, **changed)), columns
        )


def test_a_resonance_needs_five_samples_of_its_period():
    """The lowest frequency that is tried is 1 Hz."""
    x, trains = [wandering(80)], [np.ones(80, dtype=bool)]
    assert find_resonance(x, x, trains, 0.2)[0] == pytest.approx(1.0)
    with pytest.raises(DataError, match=r"with 0\.201 s between samples, no resonance"):
        find_resonance(x, x, trains, 0.201)


def test_an_input_that_never_moves_has_the_lowest_of_equally_good_resonances():
    x, y = np.zeros(80), wandering(80)
    assert find_resonance([x], [y], [np.ones(80, dtype=bool)], STEP) == (1.0, 0.03)


def test_a_resonance_is_found_behind_a_delay():
    x = wandering(1500)
    y = 2 * resonance(x, 4.0, 0.3, STEP)
    states = resolve_states(["resonance(x[k-3])"], [record(x=x, y=np.roll(y, 3))], RECIPE)
    frequency, damping = states.resonances["x[k-3]"]
    assert frequency == pytest.approx(4.0, rel=0.3)
    assert 0 < damping < 1


def test_ranges_that_terms_wait_for_are_those_of_training_samples():
    x = wandering(300)
    given_record = record(training=np.arange(300) < 200, x=x, y=x)
    low, high = x[:200].min(), x[:200].max()
    plain = recipe_of("y", ("exp(-unit(x/0.1))",), max_terms=1)
    (ends,) = with_ranges([given_record], plain)
    values = {"x": np.array([low, low + 0.1 * (high - low)])}
    np.testing.assert_allclose(evaluate(parse(ends), values, 2), [1, np.exp(-1)], rtol=0.02)
    assert with_ranges([given_record], replace(plain, scaling="range")) == ("exp(-x/0.1)",)
