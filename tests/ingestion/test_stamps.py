"""Stamps of time in whole studies: formats, clocks that begin anew, thousands; and numbers where a
stamp stands among them.
"""

import numpy as np
import pytest

from mapmore_cli import fit
from mapmore_cli.domain.errors import DataError

COLUMNS = {
    "pressure": {"column": "P"},
    "strain": {"column": "eps"},
    "force": {"column": "F"},
}


def log(*cells, mark=","):
    rows = [mark.join([cell, "80", "0.1", str(i)]) for i, cell in enumerate(cells)]
    return "\n".join([mark.join(["t", "P", "eps", "F"]), *rows, ""])


def times(dataset):
    (recording,) = dataset.recordings
    return recording.columns["time"].tolist()


def test_stamps_count_in_the_unit_of_their_column(ingest):
    content = {"a.csv": log("0:00:01", "0:00:02.5")}
    assert times(ingest(content, columns={**COLUMNS, "time": {"column": "t", "unit": "ms"}})) == [
        1.0,
        2.5,
    ]


@pytest.mark.parametrize(
    ("cells", "unit", "expected"),
    [
        (
            ("23:59:59", "23:59:59.5", "00:00:00.5", "", "00:00:01.5"),
            "s",
            [86399, 86399.5, 86400.5, 86401.5],
        ),
        (("11:59:59 PM", "12:00:01 AM"), "s", [86399, 86401]),
        (("59:59.5", "00:00.5", "59:59.5", "00:00.5"), "s", [3599.5, 3600.5, 7199.5, 7200.5]),
        (
            ("4294967000", "4294967290", "4", "100"),
            "ms",
            [4294967.0, 4294967.29, 4294967.3, 4294967.396],
        ),
        (("4294967000", "4294967290", "4"), "us", [4294.967, 4294.96729, 4294.9673]),
        (("86399900", "50"), "ms", [86399.9, 86400.05]),
    ],
)
def test_a_clock_that_begins_anew_goes_on(ingest, cells, unit, expected):
    content = {"a.csv": log(*cells)}
    time = {"column": "t", "unit": unit}
    with pytest.raises(DataError, match=r"time runs backwards[^`]*\n[^`]*`unwrap: true` at `time`"):
        ingest(content, columns={**COLUMNS, "time": time}, missing="drop")
    dataset = ingest(content, columns={**COLUMNS, "time": {**time, "unwrap": True}}, missing="drop")
    np.testing.assert_allclose(times(dataset), expected, rtol=0, atol=1e-6)


def test_a_clock_in_several_columns_goes_on_at_midnight(ingest):
    rows = ("23,58,80,0,1", "23,59,80,0,2", "0,0,80,0,3", "0,1,80,0,4", "")
    time = {"columns": ["hour", "minute"], "format": "h min", "unwrap": True}
    content = "\n".join(["hour,minute,P,eps,F", *rows])
    for unit, second in (("s", 1), ("ms", 1000)):
        dataset = ingest(
            {"a.csv": content}, columns={**COLUMNS, "time": time}, units={"time": unit}
        )
        minutes = np.array([1438, 1439, 1440, 1441])
        np.testing.assert_allclose(times(dataset), second * 60 * minutes)


@pytest.mark.parametrize("cells", [("5000", "0"), ("23:00:00", "12:00:00"), ("3000000", "0")])
def test_a_clock_that_was_set_back_is_none_that_begins_anew(ingest, cells):
    for more in ({}, {"unwrap": True}):
        with pytest.raises(DataError, match="time runs backwards") as told:
            ingest(
                {"a.csv": log(*cells)},
                columns={**COLUMNS, "time": {"column": "t", "unit": "ms", **more}},
            )
        assert "unwrap" not in str(told.value)


@pytest.mark.parametrize(("mark", "delimiter"), [(";", ";"), ("  ", "whitespace"), ("\t", "tab")])
def test_thousands_of_a_whole_file(ingest, mark, delimiter):
    content = log("0", "1", mark=mark).replace(f"{mark}80{mark}", f"{mark}1,080.5{mark}")
    dataset = ingest({"a.csv": content}, columns=COLUMNS, thousands=",", delimiter=delimiter)
    assert dataset.recordings[0].columns["pressure"].tolist() == [1080.5, 1080.5]


@pytest.mark.parametrize("cell", ["0:03:20", '"20"1.2', "1_5"])
def test_a_force_that_is_no_number_ends_the_study(ingest, cell):
    content = log(*map(str, range(9))).replace(",4\n", f",{cell}\n", 1)
    for missing in ("error", "drop"):
        with pytest.raises(DataError, match=r"a\.csv:row 6, column F: .* is not a number") as told:
            ingest({"a.csv": content}, columns=COLUMNS, missing=missing)
        assert "tokens" not in str(told.value) or cell == "1_5"


def test_a_column_that_two_quantities_have_holds_no_stamps(ingest):
    both = {**COLUMNS, "time": {"column": "t"}, "voltage": {"column": "t"}}
    with pytest.raises(DataError, match=r"row 2, column t.*it is a time"):
        ingest({"a.csv": log("0:00:01", "0:00:02")}, columns=both)


FRAME = {
    "P": 200.0 + np.sin(np.arange(40.0)),
    "eps": np.linspace(0, 0.2, 40),
    "F": 300 * (1 - np.linspace(0, 1, 40)) ** 2,
}
STUDY = {
    "target": "static",
    "columns": COLUMNS,
    "dictionary": [{"polynomial": {"of": ["strain"], "order": 2}}],
}


def test_a_frame_with_stamps_in_a_format():
    stamps = [f"03/01/2026 11:59:{i:02d} PM" for i in range(40)]
    time = {"column": "t", "format": "%m/%d/%Y %I:%M:%S %p"}
    asked = {**STUDY, "columns": {**COLUMNS, "time": time}}
    found = fit({**FRAME, "t": stamps}, **asked)
    assert found.spec.data.columns["time"].format is None
    with pytest.raises(DataError, match=r"row 0: .* it is a date"):
        fit(
            {**FRAME, "t": stamps},
            **{**asked, "columns": {**COLUMNS, "time": {**time, "format": "%I:%M"}}},
        )
