"""Repeatability: each sample against other recordings at its level, coordinate and direction, or
against the last training cycle.
"""

from dataclasses import replace

import numpy as np
import pytest
from common import curve_of
from hypothesis import given
from hypothesis import strategies as st

from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.signals.cycles import last_cycles
from mapmore_cli.modelling.validation.repeatability import (
    floors,
    repeated_cycles,
    repeats,
    rising_samples,
)

UP_AND_DOWN = np.concatenate([np.linspace(50, 600, 400), np.linspace(600, 50, 400)])


def curve(
    offsets,
    pressure=UP_AND_DOWN,
    hysteresis=0.0,
    level=0.1,
):
    """One recording for each name: the same force up to an offset, higher by `hysteresis` on the
    way down.
    """
    n, names = len(pressure), tuple(offsets)
    falling = np.arange(n) >= n // 2
    force = [0.5 * pressure + offset + hysteresis * falling for offset in offsets.values()]
    columns = {
        "pressure": np.tile(pressure, len(names)),
        "strain": np.full(n * len(names), level),
        "force": np.concatenate(force),
    }
    origin = np.repeat(np.arange(len(names)), n)
    return Curve(
        f"strain={level}", level, columns, np.zeros(n * len(names), bool), names, origin=origin
    )


def repeated(curves, inputs):
    """What repeats say, where recordings are logs but for the pieces of the log called `log`."""
    logs = {
        name: "log" if name.startswith("log") else name for one in curves for name in one.recordings
    }
    return repeats(curves, "force", inputs, logs)


def errors(one):
    """Others minus own, `(recordings, samples)`."""
    (found,) = repeated([one], ["pressure"])
    return (found - one.columns["force"]).reshape(len(one.recordings), -1)


@given(st.lists(st.floats(-50, 50), min_size=2, max_size=5), st.floats(0, 30))
def test_a_repeat_is_held_against_the_mean_of_the_others_on_its_own_branch(offsets, hysteresis):
    found = errors(
        curve({f"r{i}": offset for i, offset in enumerate(offsets)}, hysteresis=hysteresis)
    )
    for i, offset in enumerate(offsets):
        others = np.mean([other for j, other in enumerate(offsets) if j != i])
        known = np.isfinite(found[i])
        assert known.mean() > 0.97
        # the very sample of the turn belongs to either branch
        inner = found[i][known & (UP_AND_DOWN < 590)]
        np.testing.assert_allclose(inner, others - offset, atol=1e-6)


def test_nothing_is_said_beyond_the_ends_of_the_others():
    both = curve({"long": 0.0, "short": 0.0})
    kept = (both.origin == 0) | (both.columns["pressure"] > 190)
    columns = {name: x[kept] for name, x in both.columns.items()}
    (found,) = repeated(
        [replace(both, columns=columns, held_out=both.held_out[kept], origin=both.origin[kept])],
        ["pressure"],
    )
    assert np.isnan(found[:800][columns["pressure"][:800] < 190]).all()
    assert np.isfinite(found[800:]).mean() > 0.99


def test_a_dwell_counts_no_more_than_a_passage():
    dwelling = np.concatenate(
        [UP_AND_DOWN[:200], np.full(2000, UP_AND_DOWN[200]), UP_AND_DOWN[200:]]
    )
    noise = np.random.default_rng(3).normal(0, 1, 2000)
    one = curve({"a": 0.0, "b": 0.0}, dwelling)
    force = one.columns["force"].copy()
    force[200:2200] += noise - noise.mean()
    found = errors(replace(one, columns={**one.columns, "force": force}))
    assert np.nanmax(np.abs(found[1])) < 0.7  # half a bin's slope, not the noise


@pytest.mark.parametrize(
    "changed",
    [
        lambda c: replace(c, origin=None),
        lambda c: replace(c, recordings=("log#1", "log#2")),  # pieces of one log
        lambda c: replace(c, columns={**c.columns, "pressure": np.full(c.size, 300.0)}),
        lambda c: replace(
            c, columns={**c.columns, "temperature": np.where(c.origin == 0, 20.0, 60.0)}
        ),
        lambda c: replace(c, columns={**c.columns, "temperature": np.linspace(20, 60, c.size)}),
    ],
    ids=[
        "unknown recordings",
        "pieces of one log",
        "nothing varies",
        "another held value",
        "two inputs vary",
    ],
)
def test_what_does_not_repeat(changed):
    one = changed(curve({"a": 0.0, "b": 1.0}))
    inputs = ["pressure", *(["temperature"] if "temperature" in one.columns else [])]
    assert repeated([one], inputs) is None


def test_a_single_recording_has_no_repeat_and_other_levels_are_none():
    alone, pair = curve({"c": 0.0}, level=0.2), curve({"a": 0.0, "b": 1.0})
    assert repeated([alone, curve({"d": 5.0}, level=0.3)], ["pressure"]) is None
    found = repeated([alone, pair], ["pressure"])
    assert [np.isfinite(values).any() for values in found] == [False, True]


def test_recordings_at_the_same_value_of_a_held_input_repeat_each_other():
    one = curve({"a": 0.0, "b": 1.0, "c": 40.0, "d": 41.0})
    length = np.where(one.origin < 2, 83.0, 281.0)
    found = repeated(
        [replace(one, columns={**one.columns, "length": length})], ["length", "pressure"]
    )
    assert np.nanmax(np.abs(found[0] - one.columns["force"])) == pytest.approx(1.0)


def test_a_record_that_never_turns_rises():
    assert rising_samples(np.linspace(0, 1, 5)).all()
    assert not rising_samples(np.linspace(1, 0, 5)).any()
    assert rising_samples(np.ones(4)).all()
    ripple = np.array([0, 1, 2, 1.8, 3, 0, 0.2, 0])  # less than a tenth of the range is none
    assert rising_samples(ripple).tolist() == [True] * 4 + [False] * 4


def test_a_loop_has_its_floor_told():
    x = np.tile(np.arange(10.0), 2)
    loop = np.where(np.arange(20) < 10, 5.0, -5.0) + 10 * x
    assert floors([x, x], [loop, 10 * x]) == pytest.approx([5.0 / 95.0, 0.0], abs=1e-9)


@pytest.mark.parametrize("way", [1, -1])
def test_places_count_by_their_samples_in_the_best_single_valued_curve(way):
    """Rising: 0 to the right of three samples, 1.75 for the mean of one 4 and three 1."""
    x, y = np.array([0, 0, 0, 1, 2, 2, 2.0]), np.array([0, 0, 0, 4, 1, 1, 1.0])
    error = np.sqrt((2.25**2 + 3 * 0.75**2) / 7)
    assert floors([x], [way * y]) == pytest.approx([error / 4])


ONE = np.interp(np.arange(80), [0, 10, 40, 80], [0, 0, 100, 0])
BEGIN = 11
"""The row of a cycle from which it counts: the last that is within 5 % of the rest."""


def record(cycles, drift=0.0, cuts=(), name="a"):
    """Pieces of a record in which each cycle lies `drift` above the one before; the later half of
    the cycles is held out.
    """
    pressure = np.tile(ONE, cycles)
    motion = 2 * pressure + drift * ((np.arange(len(pressure)) - BEGIN) // len(ONE))
    columns = {"pressure": pressure, "displacement": motion}
    parts = np.split(np.arange(len(pressure)), cuts)
    held = last_cycles(pressure, 0.5)
    names = (
        [f"{name}#{number}" for number in range(1, len(parts) + 1)] if len(parts) > 1 else [name]
    )
    return [
        curve_of({key: values[rows] for key, values in columns.items()}, held[rows], log)
        for log, rows in zip(names, parts, strict=True)
    ]


def again_of(curves):
    """The repeated cycles, where pieces are named `<log>#<number>`."""
    logs = {curve.recordings[0]: curve.recordings[0].partition("#")[0] for curve in curves}
    return repeated_cycles(curves, "displacement", "pressure", logs)


def again(pressure, motion, held, level=None):
    """The repeated cycles of one record."""
    found = again_of(
        [Curve("a", level, {"pressure": pressure, "displacement": motion}, held, ("a",))]
    )
    return found and found[0]


def beside_last_cycle(curves):
    found = again_of(curves)
    return np.concatenate(
        [
            values - curve.columns["displacement"]
            for values, curve in zip(found, curves, strict=True)
        ]
    )


@given(cuts=st.lists(st.integers(1, 319), max_size=4, unique=True).map(sorted))
def test_a_drift_from_cycle_to_cycle_is_what_they_differ_by_wherever_the_record_is_cut(cuts):
    found = beside_last_cycle(record(4, drift=3.0, cuts=cuts))
    held = 2 * len(ONE) + BEGIN
    assert np.isnan(found[:held]).all()
    np.testing.assert_allclose(found[held:], [-3.0] * 80 + [-6.0] * (80 - BEGIN))


def test_each_log_is_compared_with_itself():
    both = [*record(4, drift=1.0, name="a"), *record(2, drift=7.0, name="b")]
    alone = [beside_last_cycle(record(4, drift=1.0)), beside_last_cycle(record(2, drift=7.0))]
    np.testing.assert_array_equal(beside_last_cycle(both), np.concatenate(alone))


@pytest.mark.parametrize(
    "second", [np.concatenate([ONE, np.zeros(40)]), 1.3 * ONE], ids=["longer", "further"]
)
def test_a_cycle_that_lasts_longer_or_reaches_further_is_unknown_there(second):
    pressure = np.concatenate([ONE, second])
    held = last_cycles(pressure, 0.5)
    known = (
        held
        & (pressure <= 100)
        & (np.arange(len(pressure)) < 2 * len(ONE) + BEGIN * (len(second) > len(ONE)))
    )
    np.testing.assert_array_equal(np.isfinite(again(pressure, pressure, held)), known)


@pytest.mark.parametrize(("higher", "is_same"), [(1.08, True), (1.12, False)])
def test_a_course_within_a_twentieth_of_the_range_is_the_same(higher, is_same):
    """Then samples are compared one by one, also above the peak of the cycle before."""
    pressure = np.concatenate([ONE, higher * ONE])
    apart = np.sqrt(np.mean((higher * ONE - ONE)[BEGIN:] ** 2)) / (100 * higher)
    assert (apart <= 0.05) == is_same
    held = last_cycles(pressure, 0.5)
    known = np.isfinite(again(pressure, pressure, held))
    assert known[held][:-BEGIN].all() == is_same


def test_cycles_of_another_course_are_compared_on_the_same_stroke():
    slower = np.interp(np.arange(160), [0, 20, 80, 160], [0, 0, 99, 0])
    pressure = np.concatenate([ONE, slower])
    falling = np.concatenate([np.arange(80) > 40, np.arange(160) > 80])
    motion = 2 * pressure + 30 * falling + 4 * (np.arange(240) >= 80)
    held = last_cycles(pressure, 0.5)
    found = again(pressure, motion, held)
    inside = np.isfinite(found) & (pressure < 97.5)
    assert inside[held].mean() > 0.9
    np.testing.assert_allclose((found - motion)[inside & (pressure > 10)], -4.0)


def test_nothing_repeats_without_cycles_of_both_kinds():
    """Nor with levels, nor where what trains comes after the held-out cycle."""
    (curve,) = record(2)
    pressure, motion = curve.columns.values()
    for held in (np.zeros(160, bool), np.ones(160, bool), ~curve.held_out):
        assert again(pressure, motion, held) is None
    assert again(pressure, motion, curve.held_out, level=80.0) is None
    assert again_of([curve, replace(curve, level=80.0)]) is None


@pytest.mark.parametrize("short", [0, 20])
def test_a_held_out_cycle_between_training_ones_is_compared_with_the_one_before(short):
    """Only its held-out samples, if training goes on before it ends."""
    (whole,) = record(4, drift=3.0)
    starts = BEGIN + len(ONE) * np.arange(5)
    held = np.zeros(whole.size, bool)
    held[starts[2] : starts[3] - short] = True
    found = again(*whole.columns.values(), held)
    np.testing.assert_array_equal(np.isfinite(found), held)
    np.testing.assert_allclose((found - whole.columns["displacement"])[held][1:], -3.0)
