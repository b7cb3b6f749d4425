"""Logs as programs and laboratories that nobody here had seen leave them: each is read, or told
what is wrong with it.
"""

import numpy as np
import pytest
import scipy.io
from hypothesis import given
from hypothesis import strategies as st
from reading import opaque_mat, refused, timetable_of_73, workbook

from mapmore_cli.annexes.drafting import start as drafting
from mapmore_cli.annexes.drafting.answers import Answers, read_names
from mapmore_cli.annexes.drafting.draft import Draft
from mapmore_cli.annexes.drafting.reading import read_draft
from mapmore_cli.domain.errors import DataError
from mapmore_cli.ingestion.reading import _in_model_units, unwrapped
from mapmore_cli.modelling.signals.sampling import longest_ascent
from mapmore_cli.pipeline.inspection import inspect
from mapmore_cli.storage.tables import RawTable
from mapmore_cli.study.loader import load
from mapmore_cli.study.sections.data import Data

T = 0.02 * np.arange(700)
PRESSURE = 200 + 100 * np.sin(T) + 50 * np.sin(2.3 * T)
POSITION = 0.05 * np.convolve(PRESSURE, np.exp(-np.arange(200) / 30) / 30)[: T.size]


def signal(values, label, block):
    return {"values": values[:, None], "dimensions": 1.0, "label": label, "blockName": block}


def taken(draft):
    return {name: (one["column"], one.get("unit")) for name, one in draft.data["columns"].items()}


def recordings(draft, folder):
    """The columns of the recordings that a draft reads."""
    path = folder / "spec.yaml"
    path.write_text(draft.text())
    found = inspect(load(path))
    return [dict(recording.columns) for recording in found.dataset.recordings]


SCOPE = np.zeros(
    (1, 2), dtype=[(name, object) for name in ("values", "dimensions", "label", "blockName")]
)
for _place, _one in enumerate(
    [signal(PRESSURE, "P [kPa]", "rig/Scope"), signal(POSITION, "x [mm]", "rig/Scope")]
):
    SCOPE[0, _place] = tuple(_one.values())
NAMED = {"pressure_kPa": PRESSURE, "position_mm": POSITION}
OF_SIMULINK = {  # what is saved, and the columns of time, pressure and displacement
    "a scope, by its labels": (
        {"ScopeData": {"time": T[:, None], "signals": SCOPE}, "tout": T[:, None]},
        ("ScopeData.time", "ScopeData.signals[0].values", "ScopeData.signals[1].values"),
    ),
    "structs with time of each variable, by their names": (
        {
            name: {"time": T[:, None], "signals": signal(values, "", f"rig/{name}")}
            for name, values in NAMED.items()
        },
        ("position_mm.time", "pressure_kPa.signals.values", "position_mm.signals.values"),
    ),
    "arrays to the workspace, with tout for a clock": (
        {"tout": T[:, None]} | {name: values[:, None] for name, values in NAMED.items()},
        ("tout", "pressure_kPa", "position_mm"),
    ),
}


@pytest.mark.parametrize("case", OF_SIMULINK)
def test_what_simulink_logs_is_one_log(tmp_path, case):
    content, columns = OF_SIMULINK[case]
    scipy.io.savemat(tmp_path / "log.mat", content)
    (draft,) = drafting.start(tmp_path, tmp_path).drafts
    expected = zip(("time", "pressure", "displacement"), columns, ("s", "kPa", "mm"), strict=True)
    assert taken(draft) == {name: (column, unit) for name, column, unit in expected}
    np.testing.assert_allclose(
        recordings(draft, tmp_path)[0]["displacement"], POSITION / 1000, rtol=1e-6
    )


def test_a_timetable_alone_is_refused_with_the_line_that_converts_it(tmp_path):
    timetable_of_73(tmp_path / "log.mat")
    with refused("'log' is an object of MATLAB (timetable)", "table2struct"):
        drafting.start(tmp_path, tmp_path)
    opaque_mat(tmp_path / "log.mat", "log", "timetable", T)
    with pytest.raises(DataError, match="no usable recording"):
        drafting.start(tmp_path, tmp_path)


def test_notes_in_a_workbook_hide_neither_titles_nor_numbers(tmp_path):
    head = [["Test 12"], [], ["Time [s]", "Pressure [kPa]", "Position [mm]", "Remarks"]]
    numbers = np.column_stack([T, PRESSURE, POSITION])[:300].tolist()
    numbers[50].append("valve opened")
    for place, note in ((4, "the sensor was replaced"), (5, 3.5)):
        numbers[place] += [None, None, None, note]
    about = [["Operator", "me"], ["length mm", 88]]
    workbook(tmp_path / "book.xlsx", Sheet=about, Data=[*head, *numbers])
    (draft,) = drafting.start(tmp_path, tmp_path).drafts
    assert {name: unit for name, (_, unit) in taken(draft).items()} == {
        "time": "s",
        "pressure": "kPa",
        "displacement": "mm",
    }
    np.testing.assert_allclose(
        recordings(draft, tmp_path)[0]["pressure"], PRESSURE[:300], rtol=1e-12
    )


@given(
    steps=st.lists(st.integers(-1500, 1500), min_size=1, max_size=60),
    first=st.integers(0, 4095),
    missing=st.sets(st.integers(0, 59), max_size=3),
)
def test_an_encoder_that_wraps_goes_on(steps, first, missing):
    """A gap may be two steps long, and its sum more than half a turn: then nothing can tell, and no
    gap is made there.
    """
    whole = first + np.cumsum([0, *steps]).astype(float)
    read_off = np.mod(whole, 4096)
    gaps = [
        place
        for place in missing
        if 0 < place < whole.size - 1 and abs(whole[place + 1] - whole[place - 1]) < 2048
    ]
    gaps = [place for place in gaps if place - 1 not in gaps and place + 1 not in gaps]
    read_off[gaps] = np.nan
    known = np.isfinite(read_off)
    np.testing.assert_allclose(unwrapped(read_off, 4096)[known], whole[known])


@pytest.mark.parametrize("unwrap", [True, 3600.0])
def test_a_quantity_that_goes_on_leaves_its_column_to_others(unwrap):
    raw = RawTable({"t": np.array([3598.0, 3599.0, 0.0, 1.0])}, np.arange(4), "a.csv")
    columns = {"time": {"column": "t", "unwrap": unwrap}, "second": {"column": "t"}}
    data = Data.model_validate({"files": ["a.csv"], "columns": columns})
    found = _in_model_units(raw, data, data, dict.fromkeys(columns, "s")).columns
    assert found["time"].tolist() == [3598, 3599, 3600, 3601]
    assert found["second"].tolist() == [3598, 3599, 0, 1]


COLUMNS = {"time": {"column": "t", "unit": "s"}, "force": {"column": "F", "unit": "N"}}


def table(path, rows):
    path.write_text("\n".join(rows) + "\n")


def test_a_joined_log_with_repeated_and_glitched_stamps_is_read(tmp_path):
    time = np.arange(300) * 0.01
    table(tmp_path / "force.csv", ["t,F", *(f"{t:.2f},{np.sin(t):.5f}" for t in time)])
    stamps = [f"{t:.2f}" for t in time for _ in (0, 1)]
    stamps[101] = "0.07"  # a glitch back, and one ahead
    stamps[301] = "9.99"
    table(
        tmp_path / "log.txt",
        ["t,P", *(f"{stamp},{100 + row / 10:.2f}" for row, stamp in enumerate(stamps))],
    )
    data = {
        "files": ["force.csv"],
        "columns": COLUMNS,
        "join": [
            {
                "files": ["log.txt"],
                "columns": {
                    "time": {"column": "t", "unit": "s"},
                    "pressure": {"column": "P", "unit": "kPa"},
                },
            }
        ],
        "repeated_time": "average",
    }
    with refused("runs backwards", "glitches: drop"):
        read_draft(Draft({"data": data}), tmp_path, "force")
    (recording,) = read_draft(
        Draft({"data": {**data, "glitches": "drop"}}), tmp_path, "force"
    ).recordings
    wanted = 100 + (2 * np.arange(300) + 0.5) / 10
    assert recording.rows_kept == 300
    assert np.abs(recording.columns["pressure"] - wanted).max() < 0.2


def test_a_clock_that_was_set_back_is_no_glitch(tmp_path):
    time = np.concatenate([np.arange(200), np.arange(200)]) * 0.01
    table(tmp_path / "force.csv", ["t,F", *(f"{t:.2f},{row}" for row, t in enumerate(time))])
    with pytest.raises(DataError, match="runs backwards"):
        read_draft(
            Draft({"data": {"files": ["force.csv"], "columns": COLUMNS, "glitches": "drop"}}),
            tmp_path,
            "force",
        )


def test_a_line_with_a_field_too_many_is_left_out_where_the_spec_says_so(tmp_path):
    rows = ["t,F", *(f"{row},{row * row}" for row in range(20))]
    rows[7] = "6,36,6.5,42"  # two lines run into one
    table(tmp_path / "force.csv", rows)
    data = {"files": ["force.csv"], "columns": COLUMNS}
    with refused("too many fields", "missing: drop"):
        read_draft(Draft({"data": data}), tmp_path, "force")
    (recording,) = read_draft(
        Draft({"data": {**data, "missing": "drop"}}), tmp_path, "force"
    ).recordings
    assert recording.rows_kept == 19


def test_bars_between_fields_and_a_readme_beside(tmp_path):
    time = np.arange(400) * 0.01
    drive = 100 + 50 * np.sin(2 * time)
    table(
        tmp_path / "run_1.txt",
        [f"{t:.2f}|  {p:.3e}|  {0.001 * p**1.5:.4e}" for t, p in zip(time, drive, strict=True)],
    )
    table(
        tmp_path / "ReadMe.txt",
        [
            "Date 1009",
            "Trail List",
            "1. single sine A=5, f=0.1Hz 0g load",
            "",
            "2. steps 200g load",
        ],
    )
    said = Answers(read_names("--columns", "time:s,pressure:kPa,angle"))
    found = drafting.start(tmp_path, tmp_path, answers=said)
    (draft,) = found.drafts
    assert draft.data["delimiter"] == "|"
    assert any("ReadMe" in remark for remark in found.remarks)


@given(st.lists(st.integers(-20, 20), max_size=40))
def test_the_longest_ascent_never_decreases_and_leaves_out_no_ordered_stamp(
    stamps,
):
    time = np.array(stamps, dtype=float)
    kept = longest_ascent(time)
    assert (np.diff(time[kept]) >= 0).all()
    lengths = [1] * len(stamps)  # by every earlier stamp: slow, and plainly right
    for i in range(len(stamps)):
        lengths[i] = 1 + max((lengths[j] for j in range(i) if stamps[j] <= stamps[i]), default=0)
    assert kept.sum() == max(lengths, default=0)
