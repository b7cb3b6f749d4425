"""States: their numbers come from training samples alone, their values from one piece alone."""

from dataclasses import replace

import numpy as np
import pytest
from common import curve_of
from hypothesis import given, settings
from hypothesis import strategies as st
from memory_samples import STEP, recipe_of, record, resonance, slow, wandering
from reading import refused

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.expressions import evaluate, parse
from mapmore_cli.modelling.expressions.operators.play import play
from mapmore_cli.modelling.memory.records import (
    AtSample,
    records_of,
    sampled,
    time_step,
    uninterrupted,
)
from mapmore_cli.modelling.memory.states import (
    evaluate_states,
    resolve_states,
    with_ranges,
)
from mapmore_cli.modelling.signals.sampling import UNEVEN

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
    ("resonance(x)", {"step": 1.0}, "with 1 s between samples, no resonance can be found"),
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


def test_a_record_is_cut_at_gaps_and_where_the_clock_was_set_back():
    time = np.r_[0:5, 7:9, 3:6] * STEP + 1e-6
    assert uninterrupted(time, STEP) == [slice(0, 5), slice(5, 7), slice(7, 10)]
    assert uninterrupted(np.empty(0), STEP) == [slice(0, 0)]
    rounded = np.round(np.arange(1000) * STEP, 5)
    assert uninterrupted(rounded, STEP) == [slice(0, 1000)]
    late = 1.7e9 + STEP * np.arange(100)  # stamps that a day of the year 2023 leaves 2e-7 s of
    assert uninterrupted(late, STEP) == [slice(0, 100)]
    for uneven, cuts in ((0.9, 1), (1.2, 2)):  # of UNEVEN, from one step on
        time = np.r_[0:5, 5 + uneven * UNEVEN : 9] * STEP
        assert len(uninterrupted(time, STEP)) == cuts
    with pytest.raises(AtSample, match=r"only 0\.0094 s after") as told:
        uninterrupted(np.array([0.0, 1.0, 1.94]) * STEP, STEP)
    assert told.value.sample == 2


def test_where_the_order_alone_counts_steps_may_be_uneven():
    time = np.r_[0.0, 1.0, 1.2, 9.0, 3.0, 4.0]
    curves = [curve_of({"time": time, "x": time})]
    with pytest.raises(DataError, match="a: sample 2"):
        sampled(curves)
    step, uneven, records = sampled(curves, ordered=True)
    assert (step, uneven, [piece.size for piece in records]) == (1.0, True, [4, 2])
    assert sampled([curve_of({"time": STEP * np.arange(5)})], ordered=True)[:2] == (STEP, False)


def test_pieces_of_curves_share_one_time_step():
    def curve(name, time):
        time = np.asarray(time)
        return curve_of({"time": time, "x": time}, time > 0.03, name)

    curves = [curve("a", np.r_[0:5, 9:12] * STEP), curve("b", np.arange(4) * STEP)]
    assert time_step(curves) == pytest.approx(STEP)
    records = records_of(curves, STEP)
    assert [piece.size for piece in records] == [5, 3, 4]
    assert [piece.training.tolist() for piece in records][:2] == [[True] * 4 + [False], [False] * 3]
    with pytest.raises(
        DataError,
        match=r"c: its samples are 0\.02 s apart, but those of other recordings are 0\.01 s",
    ):
        time_step([*curves, curve("c", np.arange(9) * 2 * STEP)])
    with refused("a: sample 2 (at 0.015 s): only 0.005 s after", "add `resample: 0.01 s`"):
        records_of([curve("a", [0.0, STEP, 1.5 * STEP])], STEP)
    with pytest.raises(DataError, match="the time step is unknown"):
        time_step([curve("single", [0.0])])


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
