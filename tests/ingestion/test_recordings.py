from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ingest_samples import COLUMNS, csv_text, steps
from reading import refused

from mapmore_cli.domain.errors import DataError, SpecError


def test_value_times_scale_plus_offset_then_the_unit_of_the_model(ingest):
    columns = {
        **COLUMNS,
        "pressure": {"column": "P", "unit": "psi"},
        "force": {"column": "F", "unit": "kN", "scale": 0.25, "offset": 0.009},
        "strain": {"column": "eps", "scale": 10.0},
    }
    dataset = ingest(
        {"a.csv": csv_text(t=[0, 1], P=[10, 20], eps=[0.01, 0.02], F=[0.4, 0.8])},
        columns=columns,
        units={"strain": "%"},
    )
    (curve,) = dataset.curves
    np.testing.assert_allclose(curve.columns["pressure"], [68.94757293168, 137.89514586336])
    np.testing.assert_allclose(curve.columns["force"], [109.0, 209.0])
    np.testing.assert_allclose(curve.columns["strain"], [0.1, 0.2])
    assert {name: dataset.unit(name) for name in dataset.quantities} == {
        "time": "s",
        "pressure": "kPa",
        "strain": "%",
        "force": "N",
    }


def test_without_levels_every_recording_is_a_curve(ingest):
    dataset = ingest({"b.csv": steps(80), "a.csv": steps(150)})
    assert [(c.id, c.level, c.recordings, c.size) for c in dataset.curves] == [
        ("a", None, ("a",), 20),
        ("b", None, ("b",), 20),
    ]
    assert dataset.level is None
    assert (dataset.target, dataset.recordings[0].source) == ("force", "a.csv")


def test_every_recording_counts_from_where_it_rests(ingest):
    """The mean over the first seconds is taken off, in the model's unit; values that are missing do
    no harm.
    """
    columns = {
        **COLUMNS,
        "force": {"column": "F", "unit": "kN", "scale": 2.0, "offset": 1.0, "rest": 0.25},
    }
    first = csv_text(t=[5, 5.125, 5.25, 5.375, 5.5], P=80, eps=0, F=[0.1, np.nan, 0.3, 0.7, 0.2])
    second = csv_text(t=[0, 0.1, 0.2, 0.3], P=80, eps=0, F=[9, 9, 9, 8])
    one, other = ingest(
        {"a.csv": first, "b.csv": second}, columns=columns, missing="drop", units={"time": "ms"}
    ).curves
    np.testing.assert_allclose(one.columns["force"], [-200, 200, 1000, 0], atol=1e-9)
    np.testing.assert_allclose(other.columns["force"], [0, 0, 0, -2000], atol=1e-9)


def test_a_recording_without_values_at_rest_is_refused(ingest):
    columns = {**COLUMNS, "force": {"column": "F", "rest": 0.15}}
    with refused("a.csv: force has no value in the first 0.15 s", "rest"):
        ingest(
            {"a.csv": csv_text(t=[0, 0.1, 0.2], P=80, eps=0, F=[np.nan, np.nan, 1])},
            columns=columns,
            missing="drop",
        )


@given(every=st.integers(1, 7), samples=st.integers(1, 30))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_of_so_many_samples_the_first_is_read(ingest, every, samples):
    """Their time stays that of the file, made or measured; a second log is thinned by itself and
    paired row by row.
    """
    force = np.arange(samples) ** 2.0
    made = {
        "columns": {"pressure": {"column": "P"}, "strain": {"column": "eps"}},
        "sample_time": 0.5,
        "every": every,
    }
    join = [
        {"files": ["b.csv"], "columns": {"force": {"column": "F"}}, "on": "row", "every": every}
    ]
    logs = {"a.csv": csv_text(P=np.full(samples, 80.0), eps=0), "b.csv": csv_text(F=force)}
    dataset = ingest(logs, files=["a.csv"], join=join, **made)
    (curve,) = dataset.curves
    np.testing.assert_array_equal(curve.columns["time"], 0.5 * np.arange(samples)[::every])
    np.testing.assert_array_equal(curve.columns["force"], force[::every])
    assert dict(dataset.recordings[0].dropped) == {}


def test_time_is_not_needed(ingest):
    columns = {name: column for name, column in COLUMNS.items() if name != "time"}
    assert "time" not in ingest({"a.csv": steps(80)}, columns=columns).curves[0].columns


def test_derived_quantities_follow_their_needs_whatever_their_order(ingest):
    derive = {
        "strain_rate": {"rate_of": "strain", "window": 0.4, "order": 2},
        "strain": "(0.083 - length)/0.083",
        "work": "force*strain",
    }
    columns = {name: column for name, column in COLUMNS.items() if name != "strain"}
    t = np.arange(30) * 0.1
    text = csv_text(t=t, P=80, eps=0, F=5 * t)
    dataset = ingest(
        {"a.csv": text}, columns={**columns, "length": {"column": "t", "unit": "mm"}}, derive=derive
    )
    got = dataset.curves[0].columns
    np.testing.assert_allclose(got["strain"], (0.083 - t / 1000) / 0.083)
    np.testing.assert_allclose(got["work"], 5 * t * got["strain"])
    np.testing.assert_allclose(got["strain_rate"], -1 / 83, rtol=1e-9)
    assert dataset.unit("strain_rate") == "1/s"


def test_rate_in_a_unit_of_its_own(ingest):
    t = np.arange(30) * 10.0
    columns = {
        **COLUMNS,
        "time": {"column": "t", "unit": "ms"},
        "pressure": {"column": "P", "unit": "bar"},
    }
    derive = {"pressure_rate": {"rate_of": "pressure", "window": 0.1, "order": 1}}
    text = csv_text(t=t, P=2 * t / 1000, eps=0, F=0)
    for units, unit, value in (
        ({}, "kPa/s", 200.0),
        ({"pressure": "bar"}, "bar/s", 2.0),
        ({"time": "ms"}, "kPa/ms", 0.2),
    ):
        dataset = ingest({"a.csv": text}, columns=columns, derive=derive, units=units)
        assert dataset.unit("pressure_rate") == unit
        np.testing.assert_allclose(dataset.curves[0].columns["pressure_rate"], value)


def test_samples_are_left_out_in_order_and_counted_by_reason(ingest):
    text = csv_text(t=np.arange(10), P=[80] * 10, eps=0, F=[np.nan, 5, -5, 1, 1, 30, -30, 1, 1, 1])
    keep = [
        {"quantity": "force", "abs_below": 25.0},
        {"quantity": "time", "between": (2.0, 8.0)},
        {"quantity": "force", "above": -5.0},
        {"quantity": "time", "below": 8.0},
    ]
    (recording,) = ingest({"a.csv": text}, keep=keep, missing="drop").recordings
    assert dict(recording.dropped) == {
        "missing value": 1,
        "|force| >= 25 N": 2,
        "time outside 2 to 8 s": 2,
        "force <= -5 N": 1,
        "time >= 8 s": 1,
    }
    np.testing.assert_array_equal(recording.columns["time"], [3, 4, 7])


@pytest.mark.parametrize(
    ("condition", "kept"),
    [
        ({"below": 5.0}, [-5, 4]),
        ({"above": 5.0}, [6]),
        ({"abs_below": 5.0}, [4]),
        ({"between": [4.0, 5.0]}, [4, 5]),
        ({"outside": [4.0, 5.0]}, [-5, 6]),
    ],
)
def test_the_limits_of_what_is_kept(ingest, condition, kept):
    text = csv_text(t=[0, 1, 2, 3], P=80, eps=0, F=[-5, 4, 5, 6])
    (curve,) = ingest({"a.csv": text}, keep=[{"quantity": "force", **condition}]).curves
    assert curve.columns["force"].tolist() == kept


def test_repeated_stamps(ingest):
    text = csv_text(t=[0, 1, 1, 2], P=80, eps=0, F=[0, 1, 3, 5])
    for way, time, force, dropped in (
        ("average", [0, 1, 2], [0, 2, 5], {"repeated time": 1}),
        ("spread", [0, 1, 1.5, 2], [0, 1, 3, 5], {}),
    ):
        (found,) = ingest({"a.csv": text}, repeated_time=way).recordings
        assert (found.columns["time"].tolist(), found.columns["force"].tolist()) == (time, force)
        assert dict(found.dropped) == dropped


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    force=st.lists(st.one_of(st.floats(-50, 50), st.just(np.nan)), min_size=5, max_size=40),
    pressure=st.lists(st.floats(0, 400), min_size=5, max_size=40),
    stamps=st.lists(st.sampled_from([-1.0, 0.0, 0.1, 0.1, 0.1, 2.0]), min_size=5, max_size=40),
    within=st.one_of(st.none(), st.floats(1, 80)),
)
def test_every_row_is_kept_or_counted_in_one_piece(
    ingest,
    force,
    pressure,
    stamps,
    within,
):
    n = min(len(force), len(pressure), len(stamps))
    text = csv_text(t=np.cumsum(stamps[:n]), P=pressure[:n], eps=0, F=force[:n])
    try:
        dataset = ingest(
            {"a.csv": text},
            missing="drop",
            repeated_time="average",
            gaps={"longer_than": 0.15, "action": "split"},
            keep=[{"quantity": "force", "abs_below": 30.0}],
            levels=within and {"of": "pressure", "at": [80.0, 250.0], "within": within},
        )
    except DataError:
        return
    assert sum(recording.rows_read for recording in dataset.recordings) <= n
    for recording in dataset.recordings:
        assert recording.rows_kept + sum(recording.dropped.values()) == recording.rows_read
        assert (np.diff(recording.columns["time"]) > 0).all()
    kept = sum(recording.rows_kept for recording in dataset.recordings)
    assert sum(curve.size for curve in dataset.curves) == kept
    for curve in dataset.curves if within else ():
        assert (np.abs(curve.columns["pressure"] - curve.level) <= within * (1 + 1e-6)).all()


def test_losses_are_warned_of(ingest):
    """More than half of the samples, or all but nine."""
    warnings = []
    ingest(
        {f"{'abcdef'[at]}.csv": steps(80, n) for at, n in enumerate((40, 5, 20, 21, 18, 9))},
        warnings=warnings,
        keep=[{"quantity": "time", "below": 0.95}],
        files=["[a-d].csv", {"path": "[ef].csv", "keep": [{"quantity": "time", "below": 0.85}]}],
    )
    assert warnings == [
        "a.csv: 75% of 40 samples left out (30: time >= 0.95 s)",
        "b.csv: holds only 5 samples",
        "d.csv: 52% of 21 samples left out (11: time >= 0.95 s)",
        "e.csv: only 9 of 18 samples are left (8: time >= 0.95 s; 1: time >= 0.85 s)",
        "f.csv: holds only 9 samples",
    ]


@pytest.mark.parametrize("sign", [1, -1])
def test_sizes_that_would_overflow_are_refused(ingest, sign):
    for size in (0.0, 1e-30, 1e30):
        ingest({"a.csv": steps(80, F=sign * size)})
    for size in (0.9e-30, 1.1e30):
        with refused(
            f"a.csv: the largest force is {size:g} N, but", "0 or between 1e-30 and 1e+30"
        ):
            ingest({"a.csv": steps(80, F=np.append(np.zeros(19), sign * size))})


ROW = "0,80,0,1\n"
HEAD = "t,P,eps,F\n"
MILLIMETRES = {**COLUMNS, "force": {"column": "F", "unit": "mm"}}
RATE = {"force_rate": {"rate_of": "force", "window": 0.5}}

BROKEN = {
    "missing value": (
        ROW + "1,80,0,\n",
        {},
        ["a.csv:row 3, column F", "force is missing", "missing: drop", "1 of 2"],
    ),
    "infinite value": ("0,inf,0,1\n", {}, ["a.csv:row 2, column P", "pressure is missing"]),
    "all missing": (
        ",,,\n,,,\n",
        {"missing": "drop"},
        ["a.csv: no sample is left (2: missing value)"],
    ),
    "all left out": (
        ROW,
        {"keep": [{"quantity": "force", "above": 9.0}]},
        ["no sample is left (1: force <= 9 N)"],
    ),
    "time backwards": (
        ROW + "2,80,0,1\n1.5,80,0,1\n",
        {},
        ["a.csv:row 4: time runs backwards, from 2 to 1.5"],
    ),
    "backwards after a gap": (
        ROW + "9,,0,1\n2,80,0,1\n1,80,0,1\n",
        {"missing": "drop"},
        ["a.csv:row 5: time runs backwards"],
    ),
    "repeated time": (
        ROW + ROW,
        {},
        [
            "a.csv:row 3: the time 0 occurs twice (1 repeated time stamps in all)",
            "repeated_time: average",
        ],
    ),
    "division by zero": (ROW, {"derive": {"x": "force/time"}}, ["a.csv:row 2: derive.x gives inf"]),
    "narrow window": (
        ROW + "1,80,0,1\n",
        {"derive": RATE},
        ["a.csv: the window of 0.5 s", "wider `window`"],
    ),
}
WRONG_SPECS = {
    "given twice": (
        ROW,
        {"files": [{"path": "a.csv", "set": {"strain": 0.1}}]},
        ["'strain' is set for a file, and is also measured"],
    ),
    "set for some": (
        ROW,
        {"files": ["a.csv", {"path": "b.csv", "set": {"load": 2.0}}]},
        ["'load' is set for some entries only"],
    ),
    "set for one of two": (
        ROW,
        {"files": [{"path": "a.csv", "set": {"load": 2.0}}, {"path": "b.csv"}]},
        ["'load' is set for some entries only"],
    ),
    "derived and set": (
        ROW,
        {"files": [{"path": "a.csv", "set": {"x": 0.1}}], "derive": {"x": "force"}},
        ["'x' is set for a file, and is also measured or derived"],
    ),
    "a column in some files": (
        ROW,
        {"files": [{"path": "a.csv", "columns": {"load": {"column": "F"}}}]},
        ["'load' has a column in some files only"],
    ),
    "wrong dimension": (ROW, {"columns": MILLIMETRES}, ["mm", "cannot be converted to 'N'"]),
}


@pytest.mark.parametrize("case", [*BROKEN, *WRONG_SPECS])
def test_broken_data_and_specs_say_where_and_what(ingest, case):
    rows, data, parts = (BROKEN | WRONG_SPECS)[case]
    with refused(*parts, error=DataError if case in BROKEN else SpecError):
        ingest({"a.csv": HEAD + rows}, **data)


@pytest.mark.parametrize(
    ("unit", "own_unit", "wanted"),
    [("K", "K", 0.5), ("degF", "degF", 0.5 / 1.8), ("degF", "degC", 0.5 / 1.8), ("degC", "K", 0.5)],
)
def test_a_column_of_standard_deviations_holds_differences(ingest, unit, own_unit, wanted):
    """Whatever units the study gives to the column, and to the quantity that it is about."""
    dataset = ingest(
        {"a.csv": csv_text(T=np.linspace(20, 30, 9), s=0.5, eps=np.linspace(0, 0.1, 9), F=1.0)},
        columns={"force": {"column": "F"}, "strain": {"column": "eps"}}
        | {"heat": {"column": "T", "unit": "degC"}, "sd": {"column": "s", "unit": unit}},
        units={"heat": "degC", "sd": own_unit},
        uncertainty={"heat": "sd"},
        target={"column": "force"},
    )
    (curve,) = dataset.curves
    assert curve.columns["heat"] == pytest.approx(np.linspace(20, 30, 9))
    assert curve.columns["heat_uncertainty"] == pytest.approx(wanted, rel=1e-12)


def test_the_row_of_the_first_sample_is_kept_where_the_others_follow_it(ingest):
    """Row 2 is the first under a header; where one is left out between, no row can be reckoned."""
    t = np.arange(6.0)
    for force, first in (
        ([1, 2, 3, 4, 5, 6], 2),
        ([np.nan, 2, 3, 4, 5, 6], 3),
        ([1, 2, np.nan, 4, 5, 6], 0),
    ):
        dataset = ingest({"a.csv": csv_text(t=t, P=80, eps=0, F=force)}, missing="drop")
        assert dataset.recordings[0].first_row == first


def test_effects_of_groups_are_taken_off_all_that_is_measured(ingest, monkeypatch):
    asked = []

    def without(curves, grouping):
        asked.append(grouping)
        return curves, SimpleNamespace(describe=lambda target, unit: [f"{target} in {unit}"])

    monkeypatch.setattr("mapmore_cli.ingestion.dataset.without_effects", without)
    derive = {"work": "force*strain", "double": "2*work", "other": "2*strain"}
    derive |= dict.fromkeys("hgfe", "force/2")
    groups = {"of": "day", "gain": True}
    columns = {**COLUMNS, "day": {"column": "day"}}
    text = csv_text(t=[0, 1], P=80, eps=0, F=[1, 2], day=[1, 2])
    made = ingest({"a.csv": text}, columns=columns, groups=groups, derive=derive)
    assert made.notes == ("force in N",)
    assert made.grouping == asked[0]
    assert (asked[0].target, asked[0].of, asked[0].offset, asked[0].gain) == (
        *("force", "day", False, True),
    )
    assert asked[0].outputs == (
        *("force", "double", "e", "f", "g", "h", "work", "hysteresis", "static_force", "damping"),
    )


GOOD, WORDS = steps(80), HEAD + 20 * "a,b,c,d\n"


@pytest.mark.parametrize(("bad", "names"), [(True, ["a", "c"]), (["b.csv"], ["a", "c"])])
def test_bad_files_are_left_out_and_a_warning_gives_the_fault(ingest, bad, names):
    warnings = []
    files = {"a.csv": GOOD, "b.csv": WORDS, "c.csv": GOOD}
    dataset = ingest(files, skip_bad_files=bad, warnings=warnings)
    assert [one.id for one in dataset.recordings] == names
    assert [one.partition(":")[0] for one in warnings] == (["b.csv"] if bad is True else [])


def test_a_study_needs_one_file_that_is_not_bad(ingest):
    for bad in (False, ["a.csv"]):
        with refused("b.csv:row 2"):
            ingest({"a.csv": GOOD, "b.csv": WORDS}, skip_bad_files=bad)
    with refused("a.csv:row 2"):
        ingest({"a.csv": WORDS, "b.csv": WORDS}, skip_bad_files=True)
    with refused("every file is left out"):
        ingest({"a.csv": WORDS, "b.csv": GOOD}, skip_bad_files=["*.csv"])
