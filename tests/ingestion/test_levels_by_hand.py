"""Levels, their parts, and the curves that are made of them, by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Recording
from mapmore_cli.ingestion import curves, held_out
from mapmore_cli.ingestion.curves import (
    LevelPart,
    LevelSet,
    cut_by_level,
    joined_curves,
    level_set,
    with_damping,
    with_plateau,
)
from mapmore_cli.study.sections.split import Between, Holdout

LEVELS = LevelSet("P", np.array([100.0, 200.0, 400.0]), 5.0)


@pytest.mark.parametrize(
    ("value", "level"),
    [
        *((100, 100), (125, 100), (126, None), (75, 100), (74, None), (180, 200), (375, 400)),
        *((374, None), (425, 400), (426, None), (125 * (1 + 1e-13), 100), (125 + 1e-9, None)),
    ],
)
def test_a_level_is_meant_within_a_quarter_of_the_smallest_distance(value, level):
    assert LEVELS.named(value) == level


def test_a_note_says_which_level_a_rounded_value_means():
    levels = LevelSet("P", np.array([149.73, 200.0]), 5.0)
    held = Holdout.model_validate({"P": [150.0, 200.0]})
    note = "split.validate: for P 150, the level 149.73 is held out"
    assert held_out.meant_levels(held, levels) == [note]
    for choice, some in ((None, levels), (held, None), (Holdout(last=0.5), levels)):
        assert held_out.meant_levels(choice, some) == []


def test_a_single_level_is_meant_within_a_quarter_of_itself():
    one = LevelSet("P", np.array([-100.0]), 5.0)
    assert [one.named(value) for value in (-75, -74, -125, -126)] == [-100, None, -100, None]
    zero = LevelSet("P", np.array([0.0]), 5.0)
    assert [zero.named(value) for value in (0, 1e-6)] == [0, None]


def test_of_two_levels_their_distance_counts():
    two = LevelSet("P", np.array([100.0, 120.0]), 5.0)
    assert [two.named(value) for value in (105, 106, 114, 115)] == [100, None, None, 120]


def test_samples_belong_to_the_level_within_its_reach():
    found = LEVELS.match(np.array([95.0, 105.0, 94.9, 105.1, 200.0, 400.0, 900.0]))
    np.testing.assert_array_equal(found, [100, 100, np.nan, np.nan, 200, 400, np.nan])
    assert LEVELS.describe() == "levels of P: 100, 200, 400 (within 5)"
    assert LevelSet("P", np.array([100.0]), np.inf).describe() == "levels of P: 100 (all samples)"


def test_held_out_values_are_met_up_to_rounding_and_intervals_with_their_ends():
    """By a relative 1e-9, and an absolute 1e-12 next to zero."""
    beyond = np.array([-1.1, -0.9, 0.9, 1.1])
    ranges = (1e-12 * beyond, 200 + 2e-7 * beyond, -200 + 2e-7 * beyond)
    near = [SimpleNamespace(columns={"P": part}) for part in ranges]
    found = held_out._within(near, "P", [0.0, 200.0, -200.0])
    assert found.tolist() == 3 * [False, True, True, False]
    parts = [SimpleNamespace(columns={"P": np.array([1.0, 2.0, 3.0, 4.0, 5.0])})]
    between = Between(between=[(2.0, 3.0), (4.5, 9.0)])
    assert held_out._within(parts, "P", between).tolist() == [False, True, True, False, True]
    with pytest.raises(DataError, match="P is never 6") as caught:
        held_out._within(parts, "P", [5.0, 6.0])
    assert "P goes from 1 to 5" in caught.value.remedy


def recording(name, pressure):
    columns = {"P": np.array(pressure), "F": np.arange(float(len(pressure)))}
    return Recording(name, f"{name}.csv", columns, len(pressure), {"other": 1}, first_row=2)


ONE, TWO = recording("a", [100.0, 200.0, 150.0]), recording("b", [400.0, 101.0])
MORE = recording("c", [200.0, 200.0])


def step(**columns):
    """Five samples, 10 ms apart, of a step of the pressure."""
    whole = {"time": 10.0 * np.arange(5), "pressure": np.array([0.0, 1, 3, 5, 9]), **columns}
    return Recording("a", "a.csv", whole, 5, {})


def test_a_plateau_has_both_its_ends_and_the_mean_pressure(monkeypatch):
    units = {"time": "ms"}
    found = with_plateau(step(), (0.01, 0.03), units)
    assert found.columns["plateau"].tolist() == [0, 1, 1, 1, 0]
    assert found.columns["step_pressure"].tolist() == [3] * 5
    with pytest.raises(DataError, match=r"no sample from 0.05 s to 1 s.* 0 s to 0.04 s"):
        with_plateau(step(), (0.05, 1.0), units)
    asked = []

    def find(seconds, pressure, others):
        asked.append((seconds.tolist(), pressure.tolist(), [*others]))
        return 0.03, 0.04

    monkeypatch.setattr(curves, "find_plateau", find)
    own = step(strain=np.zeros(5), force=np.zeros(5))
    assert with_plateau(own, "auto", units).columns["plateau"].tolist() == [0, 0, 0, 1, 1]
    assert asked == [([0, 0.01, 0.02, 0.03, 0.04], [0, 1, 3, 5, 9], ["strain"])]


def test_damping_is_what_the_static_model_leaves_beside_its_mean_on_the_plateau(monkeypatch):
    warnings, static = [], SimpleNamespace(name="static")
    outside = np.array([1, 0, 0, 0, 1], dtype=bool)
    monkeypatch.setattr(curves, "predict", lambda _model, columns: columns["pressure"])
    monkeypatch.setattr(curves, "outside_range", lambda _model, _columns: outside)
    force = np.array([9.0, 2, 4, 9, 9])
    own = step(force=force, plateau=np.array([0, 1, 1, 0, 0.0]))
    found = with_damping(own, "force", static, warnings.append)
    assert found.columns["static_force"].tolist() == [0, 1, 3, 5, 9]
    assert found.columns["damping"].tolist() == [8, 0, 0, 3, -1]
    assert warnings == []
    ten = np.arange(20.0)
    for beyond, told in ((9, False), (10, True)):
        outside = ten < beyond
        own = Recording(
            "a", "a.csv", {"force": ten, "pressure": ten, "plateau": 1.0 * (ten < 10)}, 20, {}
        )
        with_damping(own, "force", static, warnings.append)
        assert bool(warnings) == told


def test_parts_know_their_places_in_their_log():
    recordings, parts = cut_by_level([[ONE, TWO], [MORE]], LEVELS)
    assert [(part.recording.id, part.level) for part in parts] == [
        *(("a", 100), ("a", 200), ("b", 100), ("b", 400), ("c", 200)),
    ]
    assert [list(part.places) for part in parts] == [[0], [1], [4], [3], [0, 1]]
    assert [part.whole for part in parts] == [5, 5, 5, 5, 2]
    assert [part.log for part in parts] == [0, 0, 0, 0, 1]
    assert [part.columns["F"].tolist() for part in parts] == [[0], [1], [1], [0], [0, 1]]
    assert [one.dropped for one in recordings] == [
        {"other": 1, "not within 5 of any level of P": 1},
        {"other": 1},
        {"other": 1},
    ]
    assert [one.first_row for one in recordings] == [0, 2, 2]
    with pytest.raises(DataError, match="no sample is within 5 of P=400") as error:
        cut_by_level([[ONE], [MORE]], LEVELS)
    assert "P goes from 100 to 200" in error.value.remedy
    whole, parts = cut_by_level([[ONE, TWO]], None)
    assert [list(part.places) for part in parts] == [[0, 1, 2], [3, 4]]
    assert whole == [ONE, TWO]


def test_the_last_part_of_a_log_begins_after_a_share_of_its_samples():
    part = LevelPart(ONE, None, ONE.columns, range(2, 5), 10, 0)
    # the middles of the samples are at 25, 35 and 45 % of the log
    assert part.behind(0.25).tolist() == [False, True, True]
    assert part.behind(0.24).tolist() == [True, True, True]
    assert part.behind(0.45).tolist() == [False] * 3


@pytest.mark.parametrize("nominal", [False, True])
def test_curves_are_joined_from_parts_of_one_level(nominal):
    levels = replace(LEVELS, nominal=True) if nominal else LEVELS
    _, parts = cut_by_level([[ONE, TWO], [MORE]], levels)
    parts = [replace(part, measured={"P": (99.0, 101.0), "F": (0.0, 7.0)}) for part in parts]
    held_out = [np.full(part.size, part.recording.id == "c") for part in parts]
    low, middle, high = joined_curves(parts, held_out, levels)
    assert [one.id for one in (low, middle, high)] == ["P=100", "P=200", "P=400"]
    assert low.columns["P"].tolist() == [100, 100 if nominal else 101]
    assert (low.recordings, low.origin.tolist()) == (("a", "b"), [0, 1])
    assert middle.origin.tolist() == [0, 1, 1]
    assert middle.held_out.tolist() == [False, True, True]
    assert high.origin is None
    assert [*high.measured] == (["F"] if nominal else ["P", "F"])
    assert high.at_rest is None
    _, parts = cut_by_level([[MORE, ONE]], None)
    curves = joined_curves(parts, [np.zeros(part.size, dtype=bool) for part in parts], None)
    assert [(one.id, one.level) for one in curves] == [("c", None), ("a", None)]


def test_levels_of_a_spec_ascend_and_have_no_negative_zero():
    asked = SimpleNamespace(of="P", at=[200.0, -0.0, 100.0], within=None, value="nominal")
    found = level_set(asked, [ONE])
    assert found.at.tolist() == [0, 100, 200]
    assert not np.signbit(found.at[0])
    assert (found.nominal, found.within) == (True, 50)
    asked.within, asked.value = 3.0, "measured"
    found = level_set(asked, [ONE])
    assert (found.nominal, found.within) == (False, 3)
    asked.at = "auto"
    with pytest.raises(DataError, match="P is never held constant"):
        level_set(asked, [recording("a", np.linspace(0.0, 100.0, 400))])
