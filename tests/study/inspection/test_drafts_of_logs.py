"""Records that say little: without a clock, without a pressure or with it in a log of its own, with
an end beyond the rest.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recorded import drafted, drafts, write

from mapmore_cli.annexes.drafting.answers import Answers
from mapmore_cli.annexes.drafting.draft import Draft, Guess
from mapmore_cli.annexes.drafting.proof import Trial, proven
from mapmore_cli.checking.evidence import remembered
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.scores import Score

K = np.arange(600)
DRIVE = 3 + 2 * np.sin(0.031 * K) * np.cos(0.012 * K)
NOISE = np.random.default_rng(0).normal(size=len(K))


def followed(drive: Array, lag: float = 20.0) -> Array:
    state, found = drive[0], []
    for value in drive:
        state += (value - state) / lag
        found.append(state)
    return np.array(found)


@pytest.fixture
def untried(tmp_path: Path) -> Any:
    """Drafts of a folder as they were before their trials."""

    def of(**tables: dict[str, Array]) -> list[Draft]:
        for name, columns in tables.items():
            write(tmp_path / f"{name}.csv", columns)
        return drafts(tmp_path)

    return of


def has_memory(draft: Draft) -> bool:
    return "resample" in draft.data  # even steps, without which a search tries no memory


# Memory without a clock
# --------------------------------------------------------------------------------------------------


def test_a_record_without_a_clock_that_remembers_is_a_model_with_memory(untried: Any) -> None:
    """Two tanks: the level follows the pump slowly, and nobody wrote down the time."""
    (draft,) = untried(tanks={"u_V": DRIVE, "y_V": followed(followed(DRIVE))})
    assert has_memory(draft)
    assert draft.data["sample_time"] == 1
    assert "# CHECK: s: no column is a clock, and the response remembers" in draft.text()


@pytest.mark.parametrize("response", [np.maximum(DRIVE - 3, 0) + 0.01 * NOISE, NOISE])
def test_a_curve_or_noise_without_a_clock_is_static(untried: Any, response: Array) -> None:
    (draft,) = untried(table={"u": DRIVE, "y": response})
    assert not has_memory(draft)
    assert "sample_time" not in draft.data


def test_memory_is_seen_where_the_input_goes_there_and_back() -> None:
    found = remembered([DRIVE], [followed(DRIVE)])
    assert found.before < 0.5 * found.now
    static = remembered([DRIVE], [DRIVE**2])
    assert static.now < 0.05
    assert remembered([np.sort(DRIVE)], [followed(np.sort(DRIVE))]) is None


# What is held out
# --------------------------------------------------------------------------------------------------


def grown(sizes: tuple[float, ...]) -> dict[str, Array]:
    place = np.repeat(sizes, 200) * np.tile(np.sin(np.linspace(0, np.pi, 200)), len(sizes))
    return {"t_s": 0.1 * np.arange(len(place)), "P_kPa": 100 * place, "x_mm": followed(place, 5.0)}


def test_the_second_half_is_held_out_where_it_stays_within_the_first(untried: Any) -> None:
    (draft,) = untried(lift=grown((4, 3, 2, 4)))
    assert draft.data["split"] == {"validate": {"last": 0.5}}


def test_an_end_that_goes_beyond_the_rest_trains(untried: Any) -> None:
    """Strokes that grow: a stretch from their middle is held out, and reaches nowhere new."""
    (draft,) = untried(lift=grown((1, 2, 3, 4)))
    ((first, last),) = draft.data["split"]["validate"]["time"]["between"]
    assert 0 < first < last < 60
    assert (
        "of the second half lies beyond the first one, and this stretch moves within the others"
        in draft.text()
    )


def test_an_extrapolation_that_cannot_be_helped_is_told(untried: Any) -> None:
    """One pulse: whatever is held out rests, or goes where nothing else does."""
    pulse = np.exp(-(((np.arange(800) - 500) / 14) ** 2))
    (draft,) = untried(
        pulse={"t_s": 0.1 * np.arange(800), "P_kPa": 300 * pulse, "x_mm": 5 * followed(pulse, 2.0)}
    )
    assert draft.data["split"] == {"validate": {"last": 0.5}}
    assert "that of an extrapolation" in str(draft.notes["data", "split"])
    assert not draft.notes["data", "split"].sure


# The pressure
# --------------------------------------------------------------------------------------------------


def two_logs(late: float) -> dict[str, dict[str, Array]]:
    """A tester that holds four strains, and a logger of the pressure that was switched on later and
    rests now and then.
    """
    t = 0.02 * np.arange(2400)
    strain = 0.05 * np.floor(t / 12)
    pressure = 200 * np.abs(np.sin(0.5 * t))
    logged = (t > 2) & (t % 12 < 11)
    return {
        "tester": {"Time_ms": 1000 * t, "strain": strain, "F_N": pressure * (2 - 8 * strain)},
        "gauge": {"Time_s": t[logged] + late, "Pressure_kPa": pressure[logged]},
    }


@pytest.mark.parametrize(("late", "shift"), [(0.0, 0.0), (5000.0, -5002.02)])
def test_the_pressure_of_a_second_log_is_joined(
    untried: Any, tmp_path: Path, late: float, shift: float
) -> None:
    draft, *_ = untried(**two_logs(late))
    (join,) = draft.data["join"]
    assert join["files"] == ["gauge.csv"]
    assert join["columns"]["pressure"] == {"column": "Pressure_kPa", "unit": "kPa"}
    assert (join["shift"], join["max_gap"]) == (pytest.approx(shift, abs=0.01), 0.4)
    assert not draft.notes["data", "join"].sure
    assert draft.data["levels"]["of"] == "strain"


def test_a_second_log_with_many_rows_of_one_stamp_has_no_gaps(untried: Any) -> None:
    logs = two_logs(0.0)
    draft, *_ = untried(
        **logs | {"gauge": logs["gauge"] | {"Time_s": np.floor(logs["gauge"]["Time_s"])}}
    )
    assert draft.data["join"][0]["files"] == ["gauge.csv"]
    assert "max_gap" not in draft.data["join"][0]


@pytest.mark.parametrize(
    ("log", "stamps", "told"),
    [
        ("gauge", "Time_s", "gauge.csv: its time never goes on"),
        ("tester", "Time_ms", "time runs backwards"),
    ],
)
def test_a_log_whose_clock_is_none_cannot_be_joined(
    untried: Any, log: str, stamps: str, told: str
) -> None:
    logs = two_logs(0.0)
    with pytest.raises(DataError) as caught:
        untried(**logs | {log: logs[log] | {stamps: -logs[log][stamps]}})
    assert told in (caught.value.remedy or "")


def test_two_logs_of_pressure_are_no_pair(untried: Any) -> None:
    logs = two_logs(0.0)
    names = {
        draft.name
        for draft in untried(
            **logs, second=logs["gauge"] | {"extra_C": 20 + 0 * logs["gauge"]["Time_s"]}
        )
    }
    assert "tester" in names


def test_a_force_that_never_changes_is_no_target(untried: Any) -> None:
    """The load cell was off, or a dead load hung there."""
    (draft,) = untried(
        lift={"t_s": 0.1 * K, "P_kPa": 100 * DRIVE, "F_N": 0 * DRIVE, "x_mm": followed(DRIVE)}
    )
    assert draft.spec["target"] == {"column": "displacement"}
    assert "force" not in draft.data["columns"]


def test_a_force_without_a_pressure_follows_the_position(untried: Any) -> None:
    (draft,) = untried(spring={"x_mm": 10 * DRIVE, "F_N": 30 - 4 * DRIVE + 0.01 * NOISE})
    assert list(draft.data["columns"]) == ["displacement", "force"]
    assert draft.spec["target"] == {"column": "force"}
    assert not has_memory(draft)
    assert (
        "no pressure was found: name its column, `set` it beside the files, or `join` its log"
        in draft.text()
    )


def test_a_static_response_keeps_the_unit_that_was_told(tmp_path: Path) -> None:
    write(tmp_path / "bend.csv", {"P": 100 * DRIVE[:150], "b": np.tanh(DRIVE[:150])})
    draft = drafted(
        tmp_path,
        answers=Answers({"pressure": Guess("P", "kPa"), "bend": Guess("b", "mm")}, target="bend"),
    )
    assert draft.spec["units"] == {"bend": "mm"}
    assert draft.text().count("made plain") == 0
    assert list(draft.data["split"]["validate"]) == ["pressure"]


# One column a file
# --------------------------------------------------------------------------------------------------


def test_two_files_of_one_column_are_one_record(untried: Any) -> None:
    (draft,) = untried(u_motor={"u": DRIVE}, y_motor={"y": followed(DRIVE)})
    assert list(draft.data["columns"]) == ["u_motor"]
    assert draft.data["join"] == [
        {
            "files": ["y_motor.csv"],
            "reader": "csv",
            "columns": {"y_motor": {"column": "y"}},
            "on": "row",
        }
    ]
    assert draft.spec["target"] == {"column": "y_motor"}
    assert has_memory(draft)
    assert draft.text().count("CHECK: taken as what drives") == 1


def test_single_columns_of_other_lengths_are_told(untried: Any) -> None:
    with pytest.raises(DataError) as refusal:
        untried(u={"u": DRIVE}, y={"y": DRIVE[:-1]})
    for name in ("u.csv", "y.csv"):
        assert f"{name}: a single column, and no other of as many rows" in str(refusal.value)


# What moves
# --------------------------------------------------------------------------------------------------


def test_a_response_to_a_step_is_not_static(untried: Any) -> None:
    """The pressure jumps and rests, the muscle swings and creeps long after: force, strain and
    pressure, but nothing was held.
    """
    t = 0.01 * np.arange(900)
    pressure = 300 * np.clip((t - 1) / 0.2, 0, 1) * np.exp(-0.05 * t)
    strain = 0.2 * followed(pressure, 40.0) / 300
    (draft,) = untried(
        step={
            "t_s": t,
            "P_kPa": pressure,
            "eps": strain,
            "F_N": pressure * (2 - 6 * strain) + 50 * np.gradient(strain, t),
        }
    )
    assert draft.spec["target"] == {"column": "force"}
    assert has_memory(draft)


@pytest.mark.parametrize(
    ("title", "values", "rule"),
    [
        ("L_mm", 88 - 0.1 * K, "(0.088 - length)/0.088"),
        ("x_mm", -0.1 * K / 6, "-displacement/0.088"),
    ],
)
def test_a_known_length_makes_a_strain(
    tmp_path: Path, title: str, values: Array, rule: str
) -> None:
    pressure = np.repeat([100.0, 200.0, 300.0], 200)
    write(tmp_path / "pull.csv", {"P_kPa": pressure, title: values, "F_N": pressure - 0.1 * values})
    draft = drafted(tmp_path, answers=Answers(length=0.088))
    assert draft.data["derive"] == {"strain": rule}
    assert draft.spec["muscle"]["length"] == 0.088


# A weight that hangs there
# --------------------------------------------------------------------------------------------------


def hanging(place: Path, word: str) -> Draft:
    """Strokes under a dead load, without titles: time, pressure, and a position."""
    time = 0.01 * np.arange(400)
    pressure = 200 * np.sin(3 * time) ** 2
    for mass in (100, 200):
        write(
            place / f"Sample 1 {mass} {word}.csv", [time, pressure, -5 * followed(pressure) / mass]
        )
    return drafted(place)


def test_a_mass_in_the_names_tells_a_position_from_a_force(tmp_path: Path) -> None:
    draft = hanging(tmp_path, "grams")
    assert draft.spec["target"] == {"column": "displacement"}
    assert [entry["set"]["load"] for entry in draft.data["files"]] == [0.980665, 1.96133]
    assert (
        "CHECK: it is what is left, and a position where the names of the files tell a load; mm"
        in draft.text()
    )
    assert "CHECK: N: '100 grams' taken as the mass of a load that hangs there" in draft.text()


def test_what_values_do_not_tell_is_said(tmp_path: Path) -> None:
    draft = hanging(tmp_path, "turns")
    assert "force" in draft.data["columns"]
    assert re.search(
        r"CHECK: it is what is left: a force, or a position\s+(# )?\(`displacement`\)\?",
        draft.text(),
    )


# Both components
# --------------------------------------------------------------------------------------------------


def cycles(*apart: float) -> dict[str, dict[str, Array]]:
    """Loading and unloading at as many pressures, the branches so many newtons apart in the
    middle.
    """
    strain = 0.15 * np.concatenate([np.linspace(0, 1, 60), np.linspace(1, 0, 60)])
    side = np.repeat([0.5, -0.5], 60) * np.sin(np.pi * strain / 0.15)
    levels = {100 * (number + 1): width for number, width in enumerate(apart)}
    forces = {level: level * (2 - 9 * strain) + width * side for level, width in levels.items()}
    return {
        f"cycle_{level}": {"t_s": 0.1 * np.arange(120), "P_kPa": level, "eps": strain, "F_N": force}
        for level, force in forces.items()
    }


def test_branches_that_lie_apart_are_two_studies(untried: Any, tmp_path: Path) -> None:
    static, hysteresis = untried(**cycles(60, 60, 60))
    assert (static.spec["target"], hysteresis.spec["target"]) == ("static", "hysteresis")
    assert hysteresis.name == f"{static.name}-hysteresis"
    assert hysteresis.data == static.data
    assert "model" not in hysteresis.spec
    assert (
        "of the largest force: the component that the static study leaves out" in hysteresis.text()
    )
    assert len(drafts(tmp_path, single=True)) == 1
    tried = proven(hysteresis, tmp_path)
    assert tried.spec == hysteresis.spec
    assert tried.notes["target",].sure
    assert re.search(r"tried: NRMSE [01]\.\d+ % on held-out data$", tried.notes["target",].why)


def test_branches_that_are_one_are_one_study(untried: Any) -> None:
    (static,) = untried(**cycles(5, 5, 5))
    assert static.data["cycles"] == {"over": "strain", "samples": 200}


def test_loops_that_differ_from_level_to_level_are_one_surface(untried: Any) -> None:
    """Every second loop is four times as wide: no loop lies between its neighbours."""
    _, hysteresis = untried(**cycles(60, 240, 60, 240, 60, 240, 60))
    assert hysteresis.spec["segment"] == {
        "pressure": "none",
        "strain": {"method": "even", "count": 4},
    }
    assert hysteresis.spec["dictionary"] == [
        {"polynomial": {"of": ["strain", "pressure"], "order": 2}}
    ]
    assert (
        "CHECK: a loop hardly follows from those at the next levels (an error of"
        in hysteresis.text()
    )


def test_loops_that_grow_with_the_level_are_an_arch_each(untried: Any) -> None:
    _, hysteresis = untried(**cycles(*range(30, 240, 30)))
    assert "segment" not in hysteresis.spec
    assert hysteresis.spec["dictionary"] == [{"polynomial": {"of": ["strain"], "order": 2}}]


# What a trial tells
# --------------------------------------------------------------------------------------------------


def test_a_model_worse_than_the_mean_is_marked(untried: Any, tmp_path: Path) -> None:
    """Forces at inner pressures that have nothing to do with those beside them."""
    levels = {100: 50.0, 200: 400.0, 300: -300.0, 400: 50.0}
    tables = {
        f"p_{level}": {"P_kPa": np.full(20, level), "eps": K[:20] / 100, "F_N": f + NOISE[:20]}
        for level, f in levels.items()
    }
    (draft,) = (proven(one, tmp_path) for one in untried(**tables))
    note = draft.notes["target",]
    assert not note.sure
    assert re.search(r"tried: NRMSE \d+ % on held-out data, worse than their mean", note.why)


def score(rmse: float, model: str = "mapmore", r2: float = 0.5) -> Score:
    return Score(
        model,
        "force",
        "validate",
        "all",
        10,
        rmse,
        rmse / 100,
        100.0,
        "max|force| over validate",
        rmse,
        rmse / 100,
        r2,
    )


@pytest.mark.parametrize(
    ("trial", "bad", "told"),
    [
        (Trial(score(3.0)), False, "NRMSE 3 % on held-out data"),
        (Trial(score(3.0), score(2.99, "polynomial_5")), False, "NRMSE 3 % on held-out data"),
        (
            Trial(score(3.0), score(2.7, "polynomial_5")),
            False,
            "NRMSE 3 % on held-out data; polynomial_5 has 2.7 % there",
        ),
        (
            Trial(score(3.0), score(2.4, "polynomial_5")),
            True,
            "NRMSE 3 % on held-out data; polynomial_5 has 2.4 % there",
        ),
        (Trial(score(90.0, r2=-0.1)), True, "NRMSE 90 % on held-out data, worse than their mean"),
        (Trial(score(np.inf, r2=-np.inf)), True, "no finite error on held-out data"),
        (
            Trial(replace(score(3.0), nrmse=np.nan)),
            True,
            "no NRMSE on held-out data: the measured values are zero, or all alike",
        ),
    ],
)
def test_what_a_trial_tells(trial: Trial, bad: bool, told: str) -> None:
    assert (trial.bad, str(trial)) == (bad, told)
