"""Every rule of `check`: a study that it speaks of, the clean one of which none does, and the page
that explains them.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recorded import workbook

from mapmore_cli.checking import applied, rules
from mapmore_cli.domain.errors import DataError, FitError, SpecError
from mapmore_cli.modelling.validation.repeatability import monotone_floor
from mapmore_cli.pipeline.inspection import inspect
from mapmore_cli.pipeline.runner import bring_up_to_date
from mapmore_cli.study.loader import load
from mapmore_cli.study.yaml_dumper import dump

LEVELS = (100.0, 200.0, 300.0, 400.0)
SPEC: dict[str, Any] = {
    "name": "clean",
    "muscle": {"diameter": 0.02},
    "data": {
        "files": ["level_*.csv"],
        "columns": {
            "time": {"column": "t", "unit": "s"},
            "pressure": {"column": "P", "unit": "kPa"},
            "strain": {"column": "eps"},
            "force": {"column": "F", "unit": "N"},
        },
        "levels": {"of": "pressure", "at": list(LEVELS)},
        "split": {"validate": {"pressure": [200]}},
    },
    "target": "static",
    "segment": {"strain": {"method": "even", "count": 2}},
    "dictionary": [{"polynomial": {"of": ["strain"], "order": 3}}],
    "fit": {"max_terms": 3},
}


def table(level):
    """A slow pull at constant pressure, in 60 samples."""
    strain = np.linspace(0, 0.2, 60)
    return {
        "t": 0.1 * np.arange(60),
        "P": np.full(60, level),
        "eps": strain,
        "F": level * (2 - 8 * strain) + level**2 / 400,
    }


def merged(base, over):
    """`over` on top of `base`, mappings merged deeply; a split and what is empty replace, None
    removes.
    """
    deep = [
        key
        for key, value in over.items()
        if isinstance(value, dict) and value and isinstance(base.get(key), dict) and key != "split"
    ]
    both = {**base, **over, **{key: merged(base[key], over[key]) for key in deep}}
    return {key: value for key, value in both.items() if value is not None}


def inspected(
    folder,
    spoil=lambda _, columns: columns,
    names=None,
    **spec,
):
    """What `check` finds in the clean study with spoilt recordings, other names of columns, and a
    spec that is merged over its own.
    """
    for level in LEVELS:
        columns = {
            (names or {}).get(name, name): values
            for name, values in spoil(level, table(level)).items()
        }
        rows = [
            ",".join(f"{value:.9g}" for value in row) for row in zip(*columns.values(), strict=True)
        ]
        (folder / f"level_{level:g}.csv").write_text("\n".join([",".join(columns), *rows]) + "\n")
    path = folder / "clean.yaml"
    path.write_text(dump(merged(SPEC, spec)))
    return inspect(load(path))


def found(inspection, severity=None):
    """Ids of the issues, of one severity where it is given."""
    return {issue.id for issue in inspection.issues if severity in (None, issue.severity)}


def only(inspection, id_):
    """The one issue of a rule."""
    (issue,) = [issue for issue in inspection.issues if issue.id == id_]
    return issue


# Ways to spoil the clean study
# --------------------------------------------------------------------------------------------------


def clean(_, columns):
    return columns


def scaled(**factors):
    return lambda _, columns: {
        name: values * factors.get(name, 1.0) for name, values in columns.items()
    }


def at(level, spoil):
    """One level alone is spoilt."""
    return lambda own, columns: spoil(own, columns) if own == level else columns


def first_rows(rows):
    return lambda _, columns: {name: values[:rows] for name, values in columns.items()}


def copied(of):
    """The recording of one level instead of another's: a file copied under a wrong name."""
    return lambda _level, _columns: table(of)


def at_most(name, limit):
    return lambda _, columns: {**columns, name: np.minimum(columns[name], limit)}


def staircase(level, _):
    """Isometric steps of pressure, one second of rest after a tenth of a second of change."""
    t = np.arange(0, 22, 0.02)
    pressure = 30 * (np.floor(t / 1.1) + np.clip((t % 1.1 - 1.0) / 0.1, 0, 1))
    force = 0.5 * (pressure - 1000 * STRAINS[level] - 100)
    return {"t": t, "P": pressure, "eps": np.full(len(t), STRAINS[level]), "F": force}


def sweep(level, columns):
    stairs = staircase(level, columns)
    return {**stairs, "P": 600 * (1 - np.abs(stairs["t"] / 11 - 1))}


def against_a_spring(_, columns):
    """A contraction by pressure, against a spring that pulls the more, the farther it goes."""
    pressure = 100 * columns["t"]
    strain = 0.008 * np.sqrt(pressure)
    return {**columns, "P": pressure, "eps": strain, "F": 900 * strain}


def looped(level, columns):
    """Loading and unloading, each 60 N off their mean."""
    strain = np.concatenate([columns["eps"][::2], columns["eps"][::-2]])
    force = level * (2 - 8 * strain) + level**2 / 400 + np.repeat([60.0, -60.0], 30)
    return {**columns, "eps": strain, "F": force}


def with_spike(place):
    return lambda _, columns: {
        **columns,
        "F": np.where(np.arange(len(columns["F"])) == place, 9000.0, columns["F"]),
    }


# Specs, merged over the clean one
# --------------------------------------------------------------------------------------------------


def column(name, **changes):
    return {"data": {"columns": {name: changes}}}


def jittered(noise):
    """The pressure is held, but for the noise of its sensor."""
    return lambda level, c: {
        **c,
        "P": level + np.random.default_rng(int(level)).normal(0, noise, 60),
    }


def cycles(over, **spec):
    return {"data": {"cycles": {"over": over, "samples": 20}}, **spec}


BY_FILE = {"data": {"levels": None, "split": {"validate": {"files": ["level_300.csv"]}}}}


def uneven(_, columns):
    return {**columns, "t": columns["t"] + 0.03 * (np.arange(60) % 2)}


BY_ORDER = [
    *({name: {"of": ["strain"]}} for name in ("play", "wen", "dahl", "coulomb")),
    {"terms": ["pressure*direction(strain)"]},
]
MEMORY = {
    **BY_FILE,
    "segment": {},
    "dictionary": [{"slow": {"of": ["strain"], "tau": [0.5]}}, {"terms": ["pressure"]}],
}
ONE_LEVEL: dict[str, Any] = {
    "data": {
        "files": ["level_200.csv"],
        "levels": {"of": "pressure", "at": [200]},
        "split": {"leave_one_level_out": True},
    }
}
STRAINS = dict(zip(LEVELS, (0.0, 0.07, 0.14, 0.21), strict=True))
BY_STRAIN: dict[str, Any] = {
    "data": {
        "levels": {"of": "strain", "at": list(STRAINS.values())},
        "split": {"validate": {"strain": [0.14]}},
    },
    "segment": {"strain": "levels", "pressure": {"method": "even", "count": 2}},
    "dictionary": [{"polynomial": {"of": ["pressure"], "order": 3}}],
}
SETTLED = {
    "derive": {"pressure_rate": {"rate_of": "pressure", "window": 0.2, "order": 2}},
    "keep": [{"quantity": "pressure_rate", "abs_below": 24}],
}
VOLUME = {
    "data": {"columns": {"force": None, "volume": {"column": "F"}}},
    "target": {"column": "volume"},
    "validate": {"against": []},
}
SAME_INPUTS = {"data": {"levels": None, "split": None}, "segment": {}}
ISOMETRIC_LINES = {"data": {"levels": None, "split": None}, "segment": {}}
OPTIMAL = {"method": "optimal", "count": 3}
FINE = [{"set": {"segment.strain.count": 30}, "as": "fine"}]


@pytest.mark.parametrize(
    ("id_", "severity", "spoil", "spec", "told"),
    [
        (
            "force-never-positive",
            "warning",
            lambda _, c: {**c, "F": -np.abs(c["F"]) - 1},
            {"data": {"columns": {"force": {"column": "F", "unit": "N", "scale": 2.0}}}},
            ["`scale: -2`"],
        ),
        (
            "strain-turned",
            "warning",
            lambda _, c: {**c, "eps": -c["eps"]},
            {"muscle": {"kind": "mckibben"}},
            ["the force rises with the strain at equal pressure", "`scale: -1`"],
        ),
        (
            "strain-turned",
            "warning",
            lambda _, c: {**c, "eps": -c["P"] / 1e4 - c["eps"] / 10},
            {
                "muscle": {"kind": "peano"},
                "data": {"columns": {"force": None}, "levels": None, "split": None},
                "target": {"column": "strain"},
                "segment": {},
                "dictionary": [{"polynomial": {"of": ["pressure"], "order": 2}}],
                "validate": {"against": []},
            },
            ["the strain falls where the pressure rises"],
        ),
        ("cycles-of-nothing", "error", jittered(0.3), cycles("pressure"), ["`cycles: {over: str"]),
        (
            "header-of-numbers",
            "warning",
            clean,
            {"data": {"header": 3}},
            ["2 of the 3", "header: 1"],
        ),
        (
            "short-segment",
            "error",
            first_rows(20),
            {"segment": {"strain": OPTIMAL}},
            ["3 segments of 10 need 30"],
        ),
        (
            "few-for-formula",
            "error",
            first_rows(6),
            {"segment": {}, "validate": {"against": ["polynomial_5"]}},
            ["polynomial_5 has 21 parameters, but there are only 18 training samples"],
        ),
        (
            "few-for-formula",
            "error",
            first_rows(4),
            {"segment": {}, "fit": {"max_terms": 1}, "model": {"backbone": "sarosi_hinged"}},
            ["there are only 12 training samples"],
        ),
        (
            "shape",
            "error",
            clean,
            {"fit": {"shape": {"pressure": "decreasing"}}},
            ["`pressure: decreasing`", "contradict"],
        ),
        ("one-fold", "error", clean, ONE_LEVEL, ["pressure is 200 in all curves"]),
        (
            "short-segment",
            "error",
            at(300, first_rows(7)),
            {},
            ["pressure=300/strain:2 has 3 training samples: too few for 3 terms"],
        ),
        (
            "short-segment",
            "error",
            at(300, first_rows(1)),
            {"segment": {"strain": OPTIMAL}},
            ["pressure=300 has 1 training sample: 3 segments of 10 need 30"],
        ),
        (
            "short-segment",
            "error",
            clean,
            {"validate": {"against": FINE}},
            ["in `fine`: "],
        ),  # competitors are checked as well
        (
            "empty-segment",
            "error",
            lambda _, c: {**c, "eps": 0.2 * (c["eps"] > 0.18)},
            {"segment": {"strain": {"count": 3}}},
            [],
        ),
        (
            "memory-breaks",
            "warning",
            at(100, lambda _, c: {key: np.delete(x, slice(20, 25)) for key, x in c.items()}),
            MEMORY,
            ["after 1 gap within", "have 60 samples or fewer", "`resample: 0.1 s`"],
        ),
        (
            "uneven-steps",
            "error",
            uneven,
            MEMORY,
            ["count samples or use the time between them: slow", "add `resample: "],
        ),
        ("uneven-steps", "error", at(400, scaled(t=2)), MEMORY, []),
        ("unsettled", "hint", sweep, BY_STRAIN, []),
        (
            "clipped",
            "warning",
            at_most("F", 900),
            {},
            ["level_400.csv: 28 of 60 samples have force at exactly 900 N", "below: 900"],
        ),
        (
            "not-single-valued",
            "hint",
            looped,
            {},
            ["can reach an error below 4.6 % at pressure=100, 4.5 % at", "cycles: {over: strain}"],
        ),
        (
            *("not-single-valued", "hint", looped, VOLUME),
            ["no model without memory can reach an error below 4.6 % at pressure=100"],
        ),
        (
            "spike",
            "warning",
            with_spike(30),
            {},
            ["level_100.csv:row 32 (time 3 s): force is 9000 in one sample only, between "],
        ),
        (
            "label",
            "error",
            clean,
            {"report": {"style": {"labels": {"force": "$x" + "^{x" * 60 + "}" * 60 + "$"}}}},
            ["nested 60 levels"],
        ),
        (
            "label",
            "error",
            clean,
            {"report": {"style": {"labels": {"force": r"$\nonsense{x}$"}}}},
            ["nonsense"],
        ),
        (
            *(
                "computed-from",
                "warning",
                lambda level, c: {**c, "F": 7 * c["eps"] + level},
                {"segment": {}},
            ),
            ["force equals 7 times strain plus a constant for each recording"],
        ),
        (
            *(
                "untold-difference",
                "warning",
                lambda level, _: {**table(200), "P": np.full(60, 200.0), "F": table(level)["F"]},
                SAME_INPUTS,
            ),
            ["level_400.csv has the same strain as level_100.csv, but force differs by 0.66 of "],
        ),
    ],
)
def test_a_rule_speaks_of_what_it_is_made_for(tmp_path, id_, severity, spoil, spec, told):
    inspection = inspected(tmp_path, spoil, **spec)
    issue = next(issue for issue in inspection.issues if issue.id == id_)
    assert issue.severity == severity
    assert issue.place
    assert issue.remedy
    assert all(words in f"{issue.message}; {issue.remedy}" for words in told)
    assert (inspection.verdict is not None) == bool(found(inspection, "error"))


@pytest.mark.parametrize(
    ("id_", "spoil", "spec"),
    [
        (
            "unsettled",
            staircase,
            {**BY_STRAIN, "data": {**BY_STRAIN["data"], **SETTLED}},
        ),
        (
            "spike",
            lambda _, c: {name: values[:20] for name, values in with_spike(10)(_, c).items()},
            {"segment": {}},
        ),  # a table
        ("short-segment", first_rows(8), {}),
        ("short-segment", first_rows(4), {"segment": {}}),
        ("short-segment", first_rows(30), {"segment": {"strain": OPTIMAL}}),
        ("untold-difference", at(200, copied(200)), {}),
        ("computed-from", clean, ISOMETRIC_LINES),
        (
            "not-single-valued",
            looped,
            {
                **VOLUME,
                "dictionary": [{"lags": {"of": ["strain"], "steps": [1]}}],
                "segment": {"pressure": "none", "strain": None},
            },
        ),
        ("not-single-valued", looped, cycles("strain")),
        ("shape", clean, {"fit": {"shape": {"pressure": "increasing"}}}),
        ("header-of-numbers", clean, {}),
        ("uneven-steps", uneven, {**MEMORY, "dictionary": BY_ORDER}),
        ("strain-turned", against_a_spring, {**ISOMETRIC_LINES, "muscle": {"kind": "mckibben"}}),
    ],
)
def test_a_rule_is_silent_where_nothing_is_wrong(tmp_path, id_, spoil, spec):
    assert id_ not in found(inspected(tmp_path, spoil, **spec))


@pytest.mark.parametrize(
    ("under", "swallowed"),
    [("kPa,s,-,N", 0), ("1,2,3,4", 0), ("0,1,2,3", 0), ("kPa;s;;", 0), ("5,100,0.01,20", 1)],
)
def test_units_and_numbers_of_columns_are_no_samples(tmp_path, under, swallowed):
    """What stands under the names of all files, where the header has two lines."""
    issues = found(with_unit_line(tmp_path, under))
    assert ("header-of-numbers" in issues) == bool(swallowed)


def test_without_curves_only_the_recordings_are_examined(tmp_path):
    """Of three samples each, at none of the levels: too few for a curve, which there is not."""
    far = {"levels": {"of": "pressure", "at": [900], "within": 1}, "split": {}}
    with pytest.raises(DataError, match="no sample is within 1 of"):
        inspected(tmp_path, lambda _, all_: {name: x[:3] for name, x in all_.items()}, data=far)


def test_check_says_of_a_shape_what_the_run_says(tmp_path):
    contradicting = {"fit": {"shape": {"pressure": "decreasing"}}}
    issue = only(inspected(tmp_path, **contradicting), "shape")
    with pytest.raises(FitError) as told:
        bring_up_to_date(load(tmp_path / "clean.yaml"), tmp_path / "runs", "fuse")
    assert told.value.message.partition(" differences")[0].rpartition(" ")[0] in issue.message


def test_every_rule_of_the_folder_is_applied_once():
    text = "".join(path.read_text() for path in Path(rules.__file__).parent.glob("*.py"))
    written = re.findall(r"^def ([a-z]\w*)\(.*\) -> Issues:", text, re.MULTILINE)
    lists = (*applied.OF_RECORDINGS, *applied.OF_CURVES, *applied.OF_CHECK)
    assert sorted(rule.__name__ for rule in lists) == sorted(written)


def test_every_issue_that_a_rule_can_raise_is_tried_and_on_the_page_and_no_other():
    project = Path(__file__).resolve().parents[2]
    sources = (project / "mapmore_cli").rglob("*.py")
    raised = {
        id_
        for path in sources
        for id_ in re.findall(r'Issue\(\s*[^,]*,\s*"([a-z-]+)"', path.read_text())
    }
    page = (project / "docs/messages.md").read_text()
    rows = [
        line.split("|")[1]
        for line in page.splitlines()
        if re.search(r"\| (?:error|warning|hint)\b", line)
    ]
    assert raised == {id_ for row in rows for id_ in re.findall(r"`([a-z-]+)`", row)}
    assert len(raised) > 10
    tests = "".join(path.read_text() for path in (project / "tests").rglob("test_*.py"))
    assert [id_ for id_ in raised if f'"{id_}"' not in tests and f"[{id_}]" not in tests] == []


def test_the_clean_study_has_no_issues(tmp_path):
    inspection = inspected(tmp_path)
    assert (inspection.issues, inspection.verdict) == ((), None)
    assert inspection.dataset is not None
    assert inspected(tmp_path, **MEMORY).issues == ()


def test_a_column_named_after_another_unit(tmp_path):
    names = {"P": "P_psi"}
    assert (
        only(
            inspected(tmp_path, names=names, **column("pressure", column="P_psi")), "unit-in-name"
        ).severity
        == "warning"
    )
    for unit in ({"unit": "psi"}, {"scale": 6.894757}):
        spec = {
            "columns": {"pressure": {"column": "P_psi", **unit}},
            "levels": {"at": "auto"},
            "split": {"validate": {"strain": [0.0]}},
        }
        assert "unit-in-name" not in found(inspected(tmp_path, names=names, data=spec))


def test_per_cent_is_reported_where_it_also_made_the_levels_impossible(tmp_path):
    """The level that no sample is at is a consequence; the user is told the cause with it."""
    isometric = {
        "levels": {"of": "strain", "at": [0.0, 0.1, 0.2]},
        "split": {"validate": {"strain": [0.1]}},
    }
    whole: dict[str, Any] = {
        "segment": {"strain": "levels"},
        "dictionary": [{"polynomial": {"of": ["pressure"], "order": 3}}],
    }
    inspection = inspected(tmp_path, scaled(eps=100), data=isometric, **whole)
    assert inspection.dataset is None
    assert found(inspection, "error") == {"strain-in-per-cent", "no-curves"}
    assert isinstance(inspection.verdict, SpecError)
    lines = (tmp_path / "clean.yaml").read_text().splitlines()
    line = next(number for number, text in enumerate(lines, 1) if text.startswith("    strain:"))
    assert only(inspection, "strain-in-per-cent").place.endswith(f"clean.yaml:{line}:5")


def test_curves_that_are_impossible_for_no_known_reason_are_an_error_as_before(
    tmp_path,
):
    with pytest.raises(DataError, match="no sample is within"):
        inspected(tmp_path, data={"levels": {"at": [100, 200, 300, 400, 500]}})


def test_data_errors_end_as_such(tmp_path):
    inspection = inspected(tmp_path, at(300, first_rows(5)))
    assert isinstance(inspection.verdict, DataError)
    assert "clean/" not in str(inspection.verdict)


def test_the_worst_comes_first(tmp_path):
    spoilt = inspected(
        tmp_path, scaled(eps=100, F=-7), data={"split": {"validate": {"pressure": [400]}}}
    )
    severities = [issue.severity for issue in spoilt.issues]
    assert severities == sorted(severities, key=["error", "warning", "hint"].index)
    assert len(severities) >= 3


def with_unit_line(folder, units):
    """The clean study with a line of units under the names, and a header of two lines."""
    inspected(folder)
    for path in folder.glob("level_*.csv"):
        names, *rows = path.read_text().splitlines()
        path.write_text("\n".join([names, units, *rows]) + "\n")
    spec = merged(SPEC, {"data": {"header": 2}})
    (folder / "clean.yaml").write_text(dump(spec))
    return inspect(load(folder / "clean.yaml"))


def test_a_line_of_units_is_read(tmp_path):
    issue = only(with_unit_line(tmp_path, "s,kPa,-,[kN]"), "unit-line")
    assert "column 'F' is read in N, but the line below its name gives the unit kN" in issue.message
    assert found(with_unit_line(tmp_path, "s,kPa,-,N")) == set()


def test_units_of_single_files_agree_with_their_own_lines(tmp_path):
    with_unit_line(tmp_path, "s,kPa,-,N")
    first, *_, last = sorted(tmp_path.glob("level_*.csv"))
    for path in (first, last):
        path.write_text(path.read_text().replace("kPa", "bar"))
    own = {"columns": {"pressure": {**SPEC["data"]["columns"]["pressure"], "unit": "bar"}}}

    def messages(*named):
        paths = sorted(path.name for path in tmp_path.glob("level_*.csv"))
        files = [{"path": one, **own} if tmp_path / one in named else one for one in paths]
        spec = merged(SPEC, {"data": {"header": 2, "files": files}})
        (tmp_path / "clean.yaml").write_text(dump(spec))
        issues = inspect(load(tmp_path / "clean.yaml")).issues
        return [one.message for one in issues if one.id == "unit-line"]

    assert messages(first, last) == []
    assert len(messages(first)) == len(messages(last)) == len(messages()) == 1


def test_a_run_that_is_compared_with_is_checked(tmp_path):
    """Its own units, on the same recordings: a strain in per cent read as a fraction."""
    wrong = merged(SPEC, {"name": "wrong", "data": {"columns": {"strain": {"scale": 100}}}})
    (tmp_path / "wrong.yaml").write_text(dump(wrong))
    inspection = inspected(tmp_path, validate={"against": [{"run": "wrong.yaml", "as": "old"}]})
    issue = only(inspection, "strain-in-per-cent")
    assert issue.message.startswith("in `wrong.yaml`: strain reaches 20")
    assert inspection.verdict is not None


@pytest.mark.parametrize(
    ("files", "names"),
    [
        (["rig.xlsx"], ["rig.xlsx (rig[run A])", "rig.xlsx (rig[run B])"]),
        (
            [
                {"path": "rig.xlsx", "sheet": "run A", "id": "a"},
                {"path": "rig.xlsx", "sheet": "run B", "id": "b"},
            ],
            ["rig.xlsx (a)", "rig.xlsx (b)"],
        ),
        (
            [{"path": "rig.xlsx", "sheet": "run A"}, {"path": "rig.xlsx", "sheet": "run B"}],
            ["rig.xlsx (rig[run A])", "rig.xlsx (rig[run B])"],
        ),
    ],
)
def test_copied_sheets_are_named(tmp_path, files, names):
    columns = table(100.0)
    rows = [[*columns], *np.column_stack([*columns.values()]).tolist()]
    workbook(tmp_path / "rig.xlsx", {"run A": rows, "run B": rows})
    data = {
        "files": files,
        "reader": "xlsx",
        "sheet": "run*" if len(files) == 1 else None,
        "levels": None,
        "split": {},
    }
    (tmp_path / "rig.yaml").write_text(dump(merged(SPEC, {"data": data})))
    issue = only(inspect(load(tmp_path / "rig.yaml")), "recorded-twice")
    assert [issue.place, issue.message] == [names[1], f"it has the same samples as {names[0]}"]


@given(st.lists(st.tuples(st.integers(0, 9), st.floats(-1, 1)), min_size=2, max_size=40))
def test_the_floor_is_below_every_monotone_curve(samples):
    """Any line is such a curve, and a monotone one through all points has none."""
    x, y = (np.array(values, dtype=float) for values in zip(*samples, strict=True))
    floor = monotone_floor(x, y)
    for slope in (-1.0, 0.0, 0.5):
        line = slope * (x - x.mean()) + y.mean()
        assert floor <= np.sqrt(np.mean((y - line) ** 2)) + 1e-12
    assert monotone_floor(x, 3 * x - 1) < 1e-12
