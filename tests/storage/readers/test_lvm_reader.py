"""LabVIEW's text files, as its manual describes them."""

from contextlib import suppress

import numpy as np
import pytest
from reading import refusal, table_of, tables_of

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.readers import reader_of

HEAD = """LabVIEW Measurement
Separator	Tab
Decimal_Separator	.
X_Columns	One
Time_Pref	Relative
***End_of_Header***
"""
FIRST = """
Channels	2
Samples	3	3
Date	2026/03/01	2026/03/01
Time	12:00:00.5	12:00:00.5
Y_Unit_Label	kPa	N
X_Dimension	Time	Time
X0	0.0E+0	0.0E+0
Delta_X	0.1	0.1
***End_of_Header***
X_Value	P	F	Comment
0.0	100.5	1.25
0.1	101.5	2.25	valve opened
0.2	102.5	3.25
"""
NO_COLUMN = FIRST.replace("\n0.0", "\n").replace("\n0.1", "\n").replace("\n0.2", "\n")
EVERY = """
Channels	2
Y_Unit_Label	kPa	N
Delta_X	0.1	0.1
***End_of_Header***
X_Value	P	X_Value	F	Comment
0.0	100.5	0.0	1.25
0.1	101.5	0.1	2.25
0.2	102.5	0.2	3.25
"""


def written(path, text):
    path.write_text(text, encoding="cp1252", newline="")
    return path


@pytest.mark.parametrize(
    "text",
    [
        HEAD + FIRST,
        (HEAD + FIRST).replace(".", ","),
        (HEAD + FIRST).replace("Tab", "Comma").replace("\t", ","),
        HEAD.replace("One", "No") + NO_COLUMN,
        (HEAD + FIRST).replace("Channels\t2\n", "").replace("\n", "\r\n"),
        HEAD.replace("One", "Multi") + EVERY,
    ],
)
def test_separators_and_times_are_those_that_the_file_says(tmp_path, text):
    path = written(tmp_path / "a.lvm", text)
    table = table_of("lvm", path, 0, "P", "F")
    np.testing.assert_allclose(table.columns[0], [0, 0.1, 0.2], atol=1e-12)
    np.testing.assert_array_equal(table.columns["P"], [100.5, 101.5, 102.5])
    np.testing.assert_array_equal(table.columns["F"], [1.25, 2.25, 3.25])
    assert [table.noted[name].unit for name in (0, "P", "F")] == ["s", "kPa", "N"]
    assert (table.noted["F"].step, table.doubts) == (0.1, ())
    assert not table.noted["F"].is_scaled
    refusal(["a.lvm: there is no column 'p'", "Did you mean 'P'?"], "lvm", path, "p")


def test_what_is_refused(tmp_path):
    path = written(tmp_path / "a.lvm", HEAD + FIRST)
    assert table_of("lvm", path, "P").at(1) == "a.lvm:row 19"
    refusal(["a.lvm:row 19, column Comment: 'valve opened' is not a"], "lvm", path, "Comment")
    written(path, HEAD + FIRST.replace("Delta_X	0.1	0.1", "Delta_X	0.1	0.2"))
    refusal(["'F' every 0.2 s", "`sample_time: 0.2 s`"], "lvm", path, "P", "F")


LATER = FIRST.replace("12:00:00", "12:00:01")


@pytest.mark.parametrize(
    ("text", "times"),
    [
        (FIRST + LATER, [[0, 0.1, 0.2, 1, 1.1, 1.2]]),
        (FIRST + FIRST.replace("\n0.", "\n7."), [[0, 0.1, 0.2, 7, 7.1, 7.2]]),
        (LATER + FIRST, [[0, 0.1, 0.2], [-1, -0.9, -0.8]]),
        (FIRST + LATER.replace("P\tF", "P\tx"), [[0, 0.1, 0.2], [1, 1.1, 1.2]]),
        (FIRST + LATER.partition("X_Value")[0], [[0, 0.1, 0.2]]),
        # a time that occurs twice does not go on
        (FIRST + FIRST.replace("\n0.0", "\n0.2"), [[0, 0.1, 0.2], [0.2, 0.1, 0.2]]),
    ],
)
def test_segments_of_the_same_titles_whose_time_goes_on_are_one_recording(tmp_path, text, times):
    tables = tables_of("lvm", written(tmp_path / "a.lvm", HEAD + text), "X_Value")
    for table, expected in zip(tables, times, strict=True):
        np.testing.assert_allclose(table.columns["X_Value"], expected, atol=1e-9)
    assert [table.element for table in tables] == ([None] if len(tables) == 1 else [0, 1])


def test_a_row_that_ends_before_a_column_of_times_lacks_this_time(tmp_path):
    path = written(tmp_path / "a.lvm", HEAD.replace("One", "Multi") + EVERY + "0.3\t103.5\n")
    table = table_of("lvm", path, 2, "P")
    np.testing.assert_array_equal(table.columns[2], [0, 0.1, 0.2, np.nan])
    np.testing.assert_array_equal(table.columns["P"], [100.5, 101.5, 102.5, 103.5])


def test_only_the_last_segment_of_a_file_can_have_a_line_without_its_end(tmp_path):
    for text, is_open in ((LATER + FIRST, False), ((LATER + FIRST)[:-1], True)):
        first, last = tables_of("lvm", written(tmp_path / "a.lvm", HEAD + text), "P")
        assert (first.open_end is None, last.open_end is None) == (True, not is_open)


def test_a_file_that_is_cut_off_anywhere_is_refused_or_told(tmp_path):
    whole = HEAD + FIRST
    assert reader_of(written(tmp_path / "b.txt", whole)).name == "lvm"
    for end in range(len(whole) - 5):
        with suppress(DataError):
            table = table_of("lvm", written(tmp_path / "a", whole[:end]), "X_Value", "F")
            assert table.doubts or np.isnan(table.columns["F"][-1]), end
