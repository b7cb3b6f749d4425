"""Repeat-to-repeat: each held-out cycle against the last training cycle."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.signals.cycles import last_cycles
from mapmore_cli.modelling.validation.repeatability import repeated_cycles

ONE = np.interp(np.arange(80), [0, 10, 40, 80], [0, 0, 100, 0])
BEGIN = 11
"""The row of a cycle from which it counts: the last that is within 5 % of the rest."""


def record(cycles, drift=0.0, cuts=(), name="a"):
    """Pieces of a record in which each cycle lies `drift` above the one before; the later half of the cycles is held out."""
    pressure = np.tile(ONE, cycles)
    motion = 2 * pressure + drift * ((np.arange(len(pressure)) - BEGIN) // len(ONE))
    columns = {"pressure": pressure, "displacement": motion}
    parts = np.split(np.arange(len(pressure)), cuts)
    held = last_cycles(pressure, 0.5)
    names = [f"{name}#{number}" for number in range(1, len(parts) + 1)] if len(parts) > 1 else [name]
    return [Curve(n, None, {k: v[rows] for k, v in columns.items()}, held[rows], (n,)) for n, rows in zip(names, parts, strict=True)]


def again_of(curves):
    """The repeated cycles, where pieces are named `<log>#<number>`."""
    logs = {curve.recordings[0]: curve.recordings[0].partition("#")[0] for curve in curves}
    return repeated_cycles(curves, "displacement", "pressure", logs)


def errors(curves):
    found = again_of(curves)
    return np.concatenate([again - curve.columns["displacement"] for again, curve in zip(found, curves, strict=True)])


@given(cuts=st.lists(st.integers(1, 319), max_size=4, unique=True).map(sorted))
def test_a_drift_from_cycle_to_cycle_is_what_they_differ_by_wherever_the_record_is_cut(cuts):
    found = errors(record(4, drift=3.0, cuts=cuts))
    held = 2 * len(ONE) + BEGIN
    assert np.isnan(found[:held]).all()
    np.testing.assert_allclose(found[held:], [-3.0] * 80 + [-6.0] * (80 - BEGIN))


def test_each_log_is_compared_with_itself():
    both = [*record(4, drift=1.0, name="a"), *record(2, drift=7.0, name="b")]
    alone = [errors(record(4, drift=1.0)), errors(record(2, drift=7.0))]
    np.testing.assert_array_equal(errors(both), np.concatenate(alone))


def test_a_longer_cycle_is_unknown_at_its_end():
    pressure = np.concatenate([ONE, ONE, np.zeros(40)])
    curve = Curve("a", None, {"pressure": pressure, "displacement": pressure}, last_cycles(pressure, 0.5), ("a",))
    (again,) = again_of([curve])
    begin = len(ONE) + BEGIN
    np.testing.assert_array_equal(np.flatnonzero(np.isfinite(again)), np.arange(begin, begin + len(ONE)))


def test_cycles_of_another_course_are_compared_on_the_same_stroke():
    slower = np.interp(np.arange(160), [0, 20, 80, 160], [0, 0, 90, 0])
    pressure = np.concatenate([ONE, slower])
    falling = np.concatenate([np.arange(80) > 40, np.arange(160) > 80])
    motion = 2 * pressure + 30 * falling + 4 * (np.arange(240) >= 80)
    held = last_cycles(pressure, 0.5)
    (again,) = again_of([Curve("a", None, {"pressure": pressure, "displacement": motion}, held, ("a",))])
    inside = np.isfinite(again) & (np.abs(pressure - 90) > 1)
    assert inside[held].mean() > 0.9
    np.testing.assert_allclose((again - motion)[inside & (pressure > 10)], -4.0)


def test_a_cycle_that_reaches_further_is_unknown_there():
    pressure = np.concatenate([ONE, 1.3 * ONE])
    curve = Curve("a", None, {"pressure": pressure, "displacement": pressure}, last_cycles(pressure, 0.5), ("a",))
    (again,) = again_of([curve])
    np.testing.assert_array_equal(np.isfinite(again), curve.held_out & (pressure <= 100))


def test_nothing_repeats_without_cycles_of_both_kinds():
    curve = record(2)[0]
    for held in (np.zeros(160, bool), np.ones(160, bool)):
        assert again_of([Curve("a", None, curve.columns, held, ("a",))]) is None
    levelled = Curve("pressure=80", 80.0, curve.columns, curve.held_out, ("a",))
    assert again_of([levelled]) is None


def test_a_held_out_cycle_between_training_ones_is_compared_with_the_one_before():
    (whole,) = record(4, drift=3.0)
    starts = BEGIN + len(ONE) * np.arange(5)
    held = np.zeros(whole.size, bool)
    held[starts[2] : starts[3]] = True
    (again,) = again_of([Curve("a", None, whole.columns, held, ("a",))])
    np.testing.assert_array_equal(np.isfinite(again), held)
    np.testing.assert_allclose((again - whole.columns["displacement"])[held][1:], -3.0)


def test_what_trains_after_a_held_out_cycle_is_nothing_to_compare_with():
    curve = record(2)[0]
    held = ~curve.held_out
    assert again_of([Curve("a", None, curve.columns, held, ("a",))]) is None
