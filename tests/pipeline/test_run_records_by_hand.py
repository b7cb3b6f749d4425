"""Rows for a prediction: where recordings end and have gaps, and what is read."""

from types import SimpleNamespace

import numpy as np
import pytest

from mapmore_cli.domain.errors import DataError
from mapmore_cli.pipeline import records
from mapmore_cli.pipeline.records import Sheet, between_gaps, by_recording, reading_of


def blocks(names, text, most=100):
    """The cells of each block without its commas, and whether a recording begins with it."""
    rows = Sheet(f"{','.join(names)}\n{text}".splitlines(keepends=True), "t", "columns").rows
    found = by_recording(rows, names, most)
    return [(" ".join(row.text.replace(",", "") for row in block), new) for block, new in found]


def test_a_recording_ends_where_its_name_changes_or_time_goes_back():
    names = ["recording", "time"]
    assert blocks(names, "a,1\na,2\na,2\na,3\nb,4\nb,3\nb,5") == [
        ("a1 a2 a2 a3", True),
        ("b4", True),
        ("b3 b5", True),
    ]
    assert blocks(["time", "x"], "1,a\n2,b\n0,c") == [("1a 2b", True), ("0c", True)]


def test_long_recordings_come_in_blocks():
    names = ["recording", "time"]
    assert blocks(names, "a,1\na,2\na,3\nb,1\nb,2", most=2) == [
        ("a1 a2", True),
        ("a3", False),
        ("b1 b2", True),
    ]


def test_rows_whose_time_cannot_be_read_belong_to_the_recording_around():
    assert blocks(["time", "x"], "1,a\n?,b\n2,c\n1,d") == [("1a ?b 2c", True), ("1d", True)]
    # the time before the unreadable one counts
    assert blocks(["time", "x"], "5,a\n?,b\n2,c") == [("5a ?b", True), ("2c", True)]
    assert blocks(["time", "x"], "0:00:59,a\n0:01:00,b\n0:00:01,c") == [
        ("0:00:59a 0:01:00b", True),
        ("0:00:01c", True),
    ]
    # a record of another length is in the block and is refused when it is read
    assert blocks(["time", "x"], "5,a\n1\n6,c") == [("5a 1 6c", True)]


def test_a_step_of_more_than_ten_usual_ones_is_a_gap():
    assert between_gaps(np.array([3.0])) == [slice(0, 1)]
    assert between_gaps(np.array([])) == [slice(0, 0)]
    assert between_gaps(np.array([0, 2.0])) == [slice(0, 2)]
    even = np.arange(5.0)
    assert between_gaps(np.append(even, 14.0)) == [slice(0, 6)]
    for step in (0.2, 1, 5):
        gap = np.append(even, [14.1, 15]) * step
        assert between_gaps(gap) == [slice(0, 5), slice(5, 7)]


@pytest.mark.parametrize("over_time", [False, True])
def test_what_is_read_of_a_table(over_time, monkeypatch):
    monkeypatch.setattr(records, "runs_over_time", lambda _model: over_time)
    monkeypatch.setattr(records, "fed_back", lambda _model: ("y",))
    rate = SimpleNamespace(name="rate", of="strain")
    model = SimpleNamespace(signals=(rate,), input_names=("pressure", "strain", "rate"))
    there = reading_of(model, {"rate", "pressure"})
    columns = ("pressure", "strain", "rate")
    assert there.columns == (("time", *columns) if over_time else columns)
    assert (there.signals, there.outputs, there.over_time) == ((), ("y",), over_time)
    assert there.turned_for is None
    derived = reading_of(model, {"pressure"})
    assert (derived.columns, derived.signals) == (("time", "pressure", "strain"), (rate,))
    assert derived.over_time


def test_a_table_has_numbers_empty_fields_and_blank_lines():
    sheet = Sheet(["x, y\n", "1,2\n", "\n", ",3\n", '"4",5'], "t.csv", "x", {"z": 0.5})
    assert sheet.names == ["x", "y", "z"]
    assert sheet.places(["y", "z"]) == {"y": 1, "z": 2}
    rows = [*sheet.rows]
    values = sheet.values(rows, {"x": 0, "z": 2})
    np.testing.assert_array_equal(values["x"], [1, np.nan, np.nan, 4])
    np.testing.assert_array_equal(values["z"], [0.5, np.nan, 0.5, 0.5])
    assert [*sheet.extended(rows, "abcd")] == ["1,2,0.5,a\n", "\n", ",3,0.5,c\n", '"4",5,0.5,d']
    one = Sheet(["x\n", "1\n", "\n"], "t.csv", "x")
    rows = [*one.rows]
    np.testing.assert_array_equal(one.values(rows, {"x": 0})["x"], [1, np.nan])
    assert [*one.extended(rows, "ab")] == ["1,a\n", ",b\n"]


def test_constants_are_no_fields_of_the_table():
    with pytest.raises(DataError, match="already has a column z"):
        Sheet(["z\n"], "t.csv", "x", {"z": 1.0})
    sheet = Sheet(["x,y\n", "1\n"], "t.csv", "x", {"z": 1.0})
    with pytest.raises(DataError, match="row 2: has 1 fields, but the header has 2"):
        sheet.values([*sheet.rows], {"x": 0})
