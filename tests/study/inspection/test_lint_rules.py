"""Every rule of `check`: a study that it speaks of, and the clean one of which none does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lint_studies import LEVELS, SPEC, Spoil, Table, found, inspected, merged, only, table

from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.modelling.validation.repeatability import monotone_floor
from mapmore_cli.spec.loader import load
from mapmore_cli.spec.yaml_loader import dump
from mapmore_cli.study.inspection.lint import inspect


def scaled(**factors: float) -> Spoil:
    return lambda _, columns: {name: values * factors.get(name, 1.0) for name, values in columns.items()}


def first_rows(level: float, rows: int) -> Spoil:
    return lambda at, columns: {name: values[:rows] for name, values in columns.items()} if at == level else columns


def copied(of: float, to: float) -> Spoil:
    """The recording of one level instead of another's: a file copied under a wrong name."""
    return lambda level, columns: table(of) if level == to else columns


def column(name: str, **changes: Any) -> dict[str, Any]:
    return {"data": {"columns": {name: changes}}}


def test_the_clean_study_has_no_issues(tmp_path: Path) -> None:
    inspection = inspected(tmp_path)
    assert inspection.issues == ()
    assert inspection.verdict is None
    assert inspection.dataset is not None


def test_a_clean_study_of_memory_has_no_issues(tmp_path: Path) -> None:
    assert inspected(tmp_path, **MEMORY).issues == ()


def longer(level: float, factor: float) -> Spoil:
    return lambda at, columns: scaled(eps=factor)(at, columns) if at == level else columns


def levels_times(factor: float) -> dict[str, Any]:
    """The spec for pressures in another unit."""
    return {"data": {"levels": {"at": [factor * level for level in LEVELS]}, "split": {"validate": {"pressure": [factor * 200]}}}}


def held_out(**condition: Any) -> dict[str, Any]:
    return {"data": {"split": {"validate": condition}}}


ONE_LEVEL = {"data": {"levels": {"at": [100.0], "within": 50.0}, "split": None}}
BY_FILE = {"data": {"levels": None, "split": {"validate": {"files": ["level_300.csv"]}}}}
THREE_LEVELS = {"data": {"levels": {"at": [100, 200, 400]}}}
MEMORY = {**BY_FILE, "segment": {}, "dictionary": [{"slow": {"of": ["strain"], "tau": [0.5]}}, {"terms": ["pressure"]}]}
FIRST_SAMPLES = {"data": {"keep": [{"quantity": "strain", "below": 0.008}]}, "segment": {}}


@pytest.mark.parametrize(
    ("id_", "severity", "spoil", "spec"),
    [
        ("strain-in-per-cent", "error", scaled(eps=100), {}),
        ("pressure-in-pascals", "error", scaled(P=1000), levels_times(1000)),
        ("pressure-in-bar", "warning", scaled(P=0.01), levels_times(0.01)),
        ("force-too-large", "warning", scaled(F=7), {}),
        ("time-in-milliseconds", "hint", lambda level, _: {**table(level, 1200), "t": 20.0 * np.arange(1200)}, {}),
        ("constant", "error", scaled(F=0), {}),
        ("constant", "warning", scaled(eps=0), {"segment": {}}),
        ("force-never-positive", "warning", lambda _, c: {**c, "F": -np.abs(c["F"]) - 1}, {}),
        ("recorded-twice", "warning", copied(100, 300), THREE_LEVELS),
        ("recorded-twice", "error", copied(100, 300), BY_FILE),
        ("few-samples", "warning", first_rows(200, 3), {}),
        ("short-segment", "error", first_rows(300, 5), {}),
        ("empty-segment", "error", lambda _, c: {**c, "eps": np.where(c["eps"] < 0.18, 0.0, 0.2)}, {"segment": {"strain": {"count": 3}}}),
        ("validation-outside", "warning", scaled(), held_out(pressure=[400])),
        ("validation-outside", "warning", longer(200, 1.5), held_out(pressure=[200], strain={"between": [[0.1, 0.4]]})),
        ("many-dropped", "warning", scaled(), ONE_LEVEL),
        ("few-kept", "hint", scaled(), FIRST_SAMPLES),
        ("memory-breaks", "warning", lambda _, c: {name: np.delete(values, slice(20, 25)) for name, values in c.items()}, MEMORY),
        ("uneven-steps", "error", lambda _, c: {**c, "t": c["t"] + 0.03 * (np.arange(60) % 2)}, MEMORY),
        ("uneven-steps", "error", lambda level, c: {**c, "t": c["t"] * (2 if level == 400 else 1)}, MEMORY),
    ],
)
def test_a_rule_speaks_of_what_it_is_made_for(tmp_path: Path, id_: str, severity: str, spoil: Spoil, spec: dict[str, Any]) -> None:
    inspection = inspected(tmp_path, spoil, **spec)
    issue = next(issue for issue in inspection.issues if issue.id == id_)
    assert issue.severity == severity
    assert issue.place
    assert issue.remedy
    assert (inspection.verdict is not None) == bool(found(inspection, "error"))


def test_a_column_named_after_another_unit(tmp_path: Path) -> None:
    names = {"P": "P_psi"}
    assert only(inspected(tmp_path, names=names, **column("pressure", column="P_psi")), "unit-in-name").severity == "warning"
    for unit in ({"unit": "psi"}, {"scale": 6.894757}):
        spec = {"columns": {"pressure": {"column": "P_psi", **unit}}, "levels": {"at": "auto"}, "split": {"validate": {"strain": [0.0]}}}
        assert "unit-in-name" not in found(inspected(tmp_path, names=names, data=spec))


WHOLE: dict[str, Any] = {"segment": {"strain": "levels"}, "dictionary": [{"polynomial": {"of": ["pressure"], "order": 3}}]}


def test_per_cent_is_reported_where_it_also_made_the_levels_impossible(tmp_path: Path) -> None:
    """The level that no sample is at is a consequence; the user is told the cause with it."""
    isometric = {"of": "strain", "at": [0.0, 0.1, 0.2]}
    inspection = inspected(tmp_path, scaled(eps=100), data={"levels": isometric, "split": {"validate": {"strain": [0.1]}}}, **WHOLE)
    assert inspection.dataset is None
    assert found(inspection, "error") == {"strain-in-per-cent", "no-curves"}
    assert isinstance(inspection.verdict, SpecError)
    line = (tmp_path / "clean.yaml").read_text().splitlines().index("    strain:") + 1
    assert only(inspection, "strain-in-per-cent").place.endswith(f"clean.yaml:{line}:5")


def test_curves_that_are_impossible_for_no_known_reason_are_an_error_as_before(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no sample is within"):
        inspected(tmp_path, data={"levels": {"at": [100, 200, 300, 400, 500]}})


def test_data_errors_end_as_such(tmp_path: Path) -> None:
    inspection = inspected(tmp_path, first_rows(300, 5))
    assert isinstance(inspection.verdict, DataError)
    assert "clean/" not in str(inspection.verdict)


def test_the_worst_comes_first(tmp_path: Path) -> None:
    spoilt = inspected(tmp_path, scaled(eps=100, F=7), data={"split": {"validate": {"pressure": [400]}}})
    severities = [issue.severity for issue in spoilt.issues]
    assert severities == sorted(severities, key=["error", "warning", "hint"].index)
    assert len(severities) >= 3


STRAINS = dict(zip(LEVELS, (0.0, 0.07, 0.14, 0.21), strict=True))
BY_STRAIN: dict[str, Any] = {
    "data": {"levels": {"of": "strain", "at": list(STRAINS.values())}, "split": {"validate": {"strain": [0.14]}}},
    "segment": {"strain": "levels", "pressure": {"method": "even", "count": 2}},
    "dictionary": [{"polynomial": {"of": ["pressure"], "order": 3}}],
}


def staircase(slack: bool) -> Spoil:
    """Isometric steps of pressure, one second of rest after a tenth of a second of change; with a slack foot or without."""

    def spoil(level: float, _: Table) -> Table:
        t = np.arange(0, 22, 0.02)
        pressure = 30 * (np.floor(t / 1.1) + np.clip((t % 1.1 - 1.0) / 0.1, 0, 1))
        taut = pressure - 1000 * STRAINS[level] - 100
        force = 0.5 * np.maximum(taut, 0) if slack else 0.5 * taut
        return {"t": t, "P": pressure, "eps": np.full(len(t), STRAINS[level]), "F": force}

    return spoil


def test_a_slack_foot_asks_for_a_hinge_once(tmp_path: Path) -> None:
    assert "slack-foot" in found(inspected(tmp_path, staircase(slack=True), **BY_STRAIN), "hint")
    assert "slack-foot" not in found(inspected(tmp_path, staircase(slack=False), **BY_STRAIN))
    hinged = {**BY_STRAIN, "model": {"type": "mapmore", "backbone": "sarosi_hinged"}}
    assert "slack-foot" not in found(inspected(tmp_path, staircase(slack=True), **hinged))


def test_unsettled_samples_ask_for_keep(tmp_path: Path) -> None:
    def sweep(level: float, columns: Table) -> Table:
        stairs = staircase(slack=False)(level, columns)
        return {**stairs, "P": 600 * (1 - np.abs(stairs["t"] / 11 - 1))}

    assert "unsettled" in found(inspected(tmp_path, sweep, **BY_STRAIN), "hint")
    settled = {
        "derive": {"pressure_rate": {"rate_of": "pressure", "window": 0.2, "order": 2}},
        "keep": [{"quantity": "pressure_rate", "abs_below": 24}],
    }
    kept = {**BY_STRAIN, "data": {**BY_STRAIN["data"], **settled}}
    assert "unsettled" not in found(inspected(tmp_path, staircase(slack=False), **kept))


# What the eye would see in a plot -----------------------------------------------------------------------------------------------------


def at_most(name: str, limit: float) -> Spoil:
    return lambda _, columns: {**columns, name: np.minimum(columns[name], limit)}


def test_a_clipped_force_is_seen(tmp_path: Path) -> None:
    issue = only(inspected(tmp_path, at_most("F", 900.0)), "clipped")
    assert "level_400.csv: 28 of 60 samples have force at exactly 900 N" in issue.message
    assert issue.severity == "warning"
    assert "below: 900" in issue.remedy


def test_a_tank_may_be_full(tmp_path: Path) -> None:
    """What is no sensor of a muscle may have a limit of its own: that is no mistake of anybody."""
    spec = {"data": {"columns": {"force": None, "volume": {"column": "F"}}}, "target": {"column": "volume"}, "validate": {"against": []}}
    issue = only(inspected(tmp_path, at_most("F", 900.0), **spec), "clipped")
    assert issue.severity == "hint"
    assert "a limit that it has" in issue.message
    assert "keep them" in issue.remedy


def test_slow_stamps_are_believed_where_their_name_tells_the_unit(tmp_path: Path) -> None:
    def slow(level: int, _: object) -> dict[str, np.ndarray]:
        columns = {**table(level, 1200), "t [s]": 4.0 * np.arange(1200)}
        del columns["t"]
        return columns

    named = {"data": {"columns": {"time": {"column": "t [s]", "unit": "s"}}}}
    assert "time-in-milliseconds" not in found(inspected(tmp_path, slow, **named))


def test_a_slack_muscle_is_not_clipped(tmp_path: Path) -> None:
    """Its force rests at the offset of the sensor."""
    slack = inspected(tmp_path, lambda _, columns: {**columns, "F": np.maximum(columns["F"] - 400, -8.7)})
    assert "clipped" not in found(slack)


def with_unit_line(folder: Path, units: str) -> Any:
    """The clean study with a line of units under the names, and a header of two lines."""
    inspected(folder)
    for path in folder.glob("level_*.csv"):
        names, *rows = path.read_text().splitlines()
        path.write_text("\n".join([names, units, *rows]) + "\n")
    spec = merged(SPEC, {"data": {"header": 2}})
    (folder / "clean.yaml").write_text(dump(spec))
    return inspect(load(folder / "clean.yaml"))


def test_a_line_of_units_is_read(tmp_path: Path) -> None:
    issue = only(with_unit_line(tmp_path, "s,kPa,-,[kN]"), "unit-line")
    assert "column 'F' is read in N, but the line under its name says kN" in issue.message
    assert found(with_unit_line(tmp_path, "s,kPa,-,N")) == set()


def wandering(level: float, columns: Table) -> Table:
    return {**columns, "P": level + np.sin(np.arange(60.0)), "eps": 0.1 * (1 - np.cos(np.linspace(0, 2 * np.pi, 60)))}


def test_cycles_of_a_held_pressure_are_cycles_of_its_noise(tmp_path: Path) -> None:
    issue = only(inspected(tmp_path, wandering, data={"cycles": {"over": "pressure", "samples": 20}}), "cycles-of-noise")
    assert "say `cycles: {over: strain}`, and `levels` of pressure" in issue.remedy
    assert "cycles-of-noise" not in found(inspected(tmp_path, wandering, data={"cycles": {"over": "strain", "samples": 20}}))


def looped(level: float, columns: Table) -> Table:
    """Loading and unloading, 10 % of the largest force apart at every level."""
    strain = np.concatenate([columns["eps"][::2], columns["eps"][::-2]])
    force = level * (2 - 8 * strain) + level**2 / 400 + np.repeat([60.0, -60.0], 30)
    return {**columns, "eps": strain, "F": force}


def test_the_floor_of_a_loop_is_told(tmp_path: Path) -> None:
    issue = only(inspected(tmp_path, looped), "not-single-valued")
    assert "does better than 4.6 % at pressure=100, 4.5 % at" in issue.message
    assert "cycles: {over: strain}" in issue.remedy
    assert "not-single-valued" not in found(inspected(tmp_path, looped, data={"cycles": {"over": "strain", "samples": 20}}))


def test_loops_that_do_not_follow_from_each_other_are_told(tmp_path: Path) -> None:
    def spoilt(level: float, columns: Table) -> Table:
        width = 60.0 if level in (100, 300) else 15.0
        columns = looped(level, columns)
        return {**columns, "F": columns["F"] - np.repeat([60.0, -60.0], 30) + np.repeat([-width, width], 30)}

    study = {"data": {"cycles": {"over": "strain", "samples": 20}}, "target": "hysteresis"}
    issue = only(inspected(tmp_path, spoilt, **study), "loops-apart")
    assert "a loop hardly follows from those at the next levels (an error of" in issue.message
    assert "segment: {pressure: none}" in issue.remedy
    growing = inspected(
        tmp_path, lambda level, columns: {**looped(level, columns), "F": columns["F"][0] - level * np.repeat([0.1, -0.1], 30)}, **study
    )
    assert "loops-apart" not in found(growing)


def set_force(level: float, columns: Table) -> Table:
    """The force in steps of 5 N, the strain as it was then."""
    force = 5.0 * np.arange(60, 0, -1)
    return {**columns, "F": force, "eps": 0.2 * (1 - force / 300) ** 1.5 + level / 4000}


def test_who_set_what_is_seen(tmp_path: Path) -> None:
    issue = only(inspected(tmp_path, set_force), "wrong-way-round")
    assert "force goes in even steps of 5 N and strain does not" in issue.message
    assert "target: {column: strain}" in issue.remedy


def test_extrapolation_along_an_input_is_seen(tmp_path: Path) -> None:
    """The held-out pressure lies between others, but its strains go on where theirs end."""
    issue = only(inspected(tmp_path, longer(200.0, 1.3)), "validation-outside")
    assert "of the validation samples have strain 0.2" in issue.message


def test_the_competitors_are_checked(tmp_path: Path) -> None:
    against = [{"set": {"segment.strain.count": 30}, "as": "fine"}]
    issues = [issue for issue in inspected(tmp_path, validate={"against": against}).issues if issue.id == "short-segment"]
    assert issues
    assert all(issue.message.startswith("in `fine`: ") for issue in issues)


def test_a_run_that_is_compared_with_is_checked(tmp_path: Path) -> None:
    """Its own units, on the same recordings: a strain in per cent read as a fraction."""
    wrong = merged(SPEC, {"name": "wrong", "data": {"columns": {"strain": {"scale": 100}}}})
    (tmp_path / "wrong.yaml").write_text(dump(wrong))
    inspection = inspected(tmp_path, validate={"against": [{"run": "wrong.yaml", "as": "old"}]})
    issue = only(inspection, "strain-in-per-cent")
    assert issue.message.startswith("in `wrong.yaml`: strain reaches 20")
    assert inspection.verdict is not None


def test_an_end_that_goes_beyond_the_rest_is_seen_with_memory(tmp_path: Path) -> None:
    """The second half of a steady pull is at strains that the first never saw."""
    issue = only(inspected(tmp_path, **{**MEMORY, "data": {**MEMORY["data"], "split": {"validate": {"last": 0.5}}}}), "validation-outside")
    assert "of the validation samples have strain" in issue.message


@given(st.lists(st.tuples(st.integers(0, 9), st.floats(-1, 1)), min_size=2, max_size=40))
def test_the_floor_is_below_every_monotone_curve(samples: list[tuple[int, float]]) -> None:
    """Any line is such a curve, and a monotone one through all points has none."""
    x, y = (np.array(values, dtype=float) for values in zip(*samples, strict=True))
    floor = monotone_floor(x, y)
    for slope in (-1.0, 0.0, 0.5):
        line = slope * (x - x.mean()) + y.mean()
        assert floor <= np.sqrt(np.mean((y - line) ** 2)) + 1e-12
    assert monotone_floor(x, 3 * x - 1) < 1e-12
