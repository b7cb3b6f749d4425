"""One rule says what a cell is, whatever file it comes from: a number in ASCII digits, nothing, a
stamp of time, or refused.
"""

import csv
import math
import re
from datetime import datetime, time, timedelta

import numpy as np
import pytest
import scipy.io
from common import parts, rows_of
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from reading import csv_table, refusal, table_of, workbook

from mapmore_cli.domain.errors import DataError
from mapmore_cli.pipeline.records import Sheet
from mapmore_cli.pipeline.tables_in_memory import column_of
from mapmore_cli.storage.tables.cells import CellReader, NotANumber

h5py = pytest.importorskip("h5py")
nptdms = pytest.importorskip("nptdms")
pytest.importorskip("openpyxl")

ASCII_NUMBER = re.compile(r"[+-]?([0-9]+[.]?[0-9]*|[.][0-9]+)([eE][+-]?[0-9]+)?")
STAMPS = [
    *(
        "12:00:00",
        "0:03:20",
        "11:59:59 PM",
        "12:00:00:250",
        "03:20.5",
        "25:00:00",
        "12:00:00,250",
        "2026-03-01T12:00:00Z",
    ),
    *("2026-03-01 12:00:00", "01.03.2026 12:00:00", "0 days 00:00:01.5"),
]
ODD = [
    *(
        "01/02/2026",
        "2026-03-01",
        "1.5.26",
        "12:30",
        "TRUE",
        "false",
        "1_5",
        "0x1f",
        "1e5 N",
        "20 N",
        "5%",
        "1+2j",
        "2j",
        "1,5",
        "1,234.5",
    ),
    *(
        "1 234",
        "1'234",
        "\u0661\u0662",
        "\uff11\uff12",
        "1\u066b5",
        "\u00b2",
        "\u2212" + "5",
        "1.2.3",
        "--",
        "e5",
        "1e",
        "5-3",
        "infinit",
    ),
    *(
        '"20"1.2',
        '20"',
        "nan",
        "inf",
        "-inf",
        "1e999",
        "na",
        "NULL",
        "1d5",
        "#DIV/0!",
        "+",
        ".",
        "abc",
    ),
]
NUMBERS = ["1", "-2.5", "+3", ".5", "5.", "1e5", "1E-3", "007", "-0"]
cells = st.one_of(
    st.sampled_from([*STAMPS, *ODD, *NUMBERS]),
    st.from_regex(ASCII_NUMBER, fullmatch=True),
    st.text("0123456789.:,-+eE_ /N\u0661\uff12", min_size=1, max_size=10),
).filter(lambda cell: cell.strip() != "" and not cell.startswith(("=", "\0")) and len(cell) < 100)


def of_csv(path, cell, **request):
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, delimiter=";").writerows([["x", "y"], [cell, 1]])
    return float(table_of("csv", path, "x", delimiter=";", **request).columns["x"][0])


def of_xlsx(path, cell, **request):
    workbook(path, a=[["x"], [cell]])
    return float(table_of("xlsx", path, "x", **request).columns["x"][0])


def of_mat(path, cell, **request):
    scipy.io.savemat(path, {"x": np.array([cell])})
    return float(table_of("mat", path, "x", **request).columns["x"][0])


def of_hdf5(path, cell, **request):
    with h5py.File(path, "w") as file:
        file.create_dataset("x", data=[cell], dtype=h5py.string_dtype())
    return float(table_of("hdf5", path, "x", **request).columns["x"][0])


def of_tdms(path, cell, **request):
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.ChannelObject("g", "x", [cell])])
    return float(table_of("tdms", path, "x", root="g", **request).columns["x"][0])


def of_predict(_path, cell, clocks=frozenset()):
    name = "time" if clocks else "x"
    quoted = cell.replace('"', '""')
    sheet = Sheet([f"{name},y\n", f'"{quoted}",1\n'], "table", "x")
    return float(sheet.values(list(sheet.rows), sheet.places([name]))[name][0])


def of_frame(_path, cell, clocks=frozenset(), dtype=object):
    quantity = ("time", "s") if clocks else ("force", "N")
    return float(column_of({"x": np.array([cell], dtype)}, "x", "the frame", *quantity)[0])


def of_texts(path, cell, **asked):
    return of_frame(path, cell, dtype=None, **asked)


EVERY = (of_csv, of_xlsx, of_mat, of_hdf5, of_tdms, of_predict, of_frame, of_texts)


def verdict(read, path, cell, clock):
    """The number; what is no number as the same word, and `refused`."""
    try:
        value = read(path, cell, clocks=frozenset({"x"} if clock else ()))
    except DataError as error:
        return "refused" if error.remedy else "without a remedy"
    return value if math.isfinite(value) else "nothing"


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cell=cells, clock=st.booleans())
@example("0:03:20", False)
@example("\u0661\u0662", False)
def test_all_readers_are_of_one_opinion(tmp_path, cell, clock):
    found = {
        read.__name__: verdict(read, tmp_path / f"a.{read.__name__}", cell, clock) for read in EVERY
    }
    assert len(set(found.values())) == 1, found
    if not clock:
        (said,) = set(found.values())
        assert isinstance(said, str) or (
            ASCII_NUMBER.fullmatch(cell.strip()) and said == float(cell)
        )


@pytest.mark.parametrize(
    "cell",
    [*STAMPS, *(cell for cell in ODD if cell not in ("nan", "inf", "-inf", "1e999", "na", "NULL"))],
)
def test_what_is_no_number_is_refused(cell):
    with pytest.raises(NotANumber):
        CellReader()(cell)


@pytest.mark.parametrize("cell", [True, False, datetime(2026, 3, 1), time(12), timedelta(hours=1)])
def test_typed_cells_are_of_one_opinion(tmp_path, cell):
    for clock in (False, True):
        found = {verdict(read, tmp_path / "a.xlsx", cell, clock) for read in (of_xlsx, of_frame)}
        assert len(found) == 1
        assert clock or found == {"refused"}


def numbers(cell):
    return [*map(float, cell.split())]


def content_of(cells):
    """A log with such stamps."""
    stamps = parts(cells.replace("(empty)", ""))
    return "\n".join(["t;P", *(f"{cell};1" for cell in stamps)]).encode()


@pytest.mark.parametrize(
    ("cells", "seconds"),
    rows_of(
        """
11:59:59 AM | 12:00:00 PM | 1:00:00 pm                43199 43200 46800
12:00:01 AM | 12:59:59 AM | 01:00:00AM                1 3599 3600
12:00:00:250 | 12:00:00:500                           43200.25 43200.5
12:00:00,250 | 12:00:00,500                           43200.25 43200.5
00:59.9 | 01:00.0 | 61:00.5                           59.9 60 3660.5
59:59.9 | 1:00:00.0 | 1:00:00.1                       3599.9 3600 3600.1
23:59:59 | 24:00:00 | 101:00:00                       86399 86400 363600
0 days 23:59:59.5 | 1 days 00:00:00                   86399.5 86400
2026-03-01 12:00 | 2026-03-01 12:01                   1772366400 1772366460
2026-03-01T12:00:00+02:00 | 2026-03-01T12:00:00.5+02  1772359200 1772359200.5
2026-03-01T12:00:00Z | 2026-03-01 12:00:00            1772366400 1772366400
1.3.2026 1:00:00 PM | 01.03.2026 01:00:00,5 PM        1772370000 1772370000.5
2026/03/01 12:00:01.500000                            1772366401.5
1969-12-31 23:59:59.25 | 1970-01-01 00:00:00          -0.75 0
12:00:00 | (empty) | nan | 12:00:01                    43200 nan nan 43201
""",
        numbers,
    ),
)
def test_stamps_that_need_no_format(tmp_path, cells, seconds):
    for decimal in ".,":
        table = csv_table(
            tmp_path / "a",
            content_of(cells),
            "t",
            delimiter=";",
            decimal=decimal,
            clocks=frozenset({"t"}),
        )
        np.testing.assert_array_equal(table.columns["t"], seconds)
        refusal(
            ["row 2, column t", "not a number: it is a", "column `time` only"],
            "csv",
            tmp_path / "a",
            "t",
            delimiter=";",
            decimal=decimal,
        )


@pytest.mark.parametrize(
    ("cells", "told"),
    [
        *rows_of(
            """
12:00:00 | 5  \
    row 3 | '5' is a number, but the cells above are a time as `hh:mm:ss`
5 | 12:00:00  \
    row 3 | '12:00:00' is a time as `hh:mm:ss`, but the cells above are a number
1:00:00.0 | 59:59.9  \
    row 3 | `mm:ss.s`, but the cells above are a time as `hh:mm:ss`
12:00:00 | 01:00:00 PM                           row 3 | with AM and PM
2026-03-01 12:00:00 | 2026-03-01T12:00:00+01:00  row 3 | a zone
2026-03-01 12:00:00 | 12:00:01                   row 3
01/02/2026 12:00:00                              row 2 | it is a date | format:
13/02/26 12:00:00                                row 2 | it is a date | format:
12:30                                            row 2 | it is a time | format:
2026-13-01 12:00:00                              row 2 | format:
noon                                             row 2 | is not a number
13:00:00 PM                                      row 2 | format:
12:60:00                                         row 2 | format:
2026-02-30 12:00:00                              row 2 | format:
2026-03-01 24:30:00                              row 2 | format:
""",
            parts,
        ),
        ("9" * 5000 + ":", ["row 2", "is not a number"]),
    ],
)
def test_stamps_that_are_refused(tmp_path, cells, told):
    (tmp_path / "a").write_bytes(content_of(cells))
    refusal(["column t", *told], "csv", tmp_path / "a", "t", delimiter=";", clocks=frozenset({"t"}))


def test_the_form_of_stamps_is_known_from_block_to_block(tmp_path, monkeypatch):
    monkeypatch.setattr("mapmore_cli.storage.tables.lines.CHUNK", 3)
    for first, then in (("{}.5", "0:00:{:02}"), ("0:00:{:02}", "{}.5")):
        content = "\n".join(
            ["t,P", *(f"{(first if i < 6 else then).format(i)},1" for i in range(12))]
        ).encode()
        (tmp_path / "a").write_bytes(content)
        refusal(
            ["row 8, column t", "the cells above"],
            "csv",
            tmp_path / "a",
            "t",
            clocks=frozenset({"t"}),
        )


@pytest.mark.parametrize(
    ("layout", "cells", "seconds"),
    [
        (
            "%m/%d/%Y %I:%M:%S.%f %p",
            ["03/01/2026 12:00:00.250 PM", "03/01/2026 01:00:00.5 PM"],
            [1772366400.25, 1772370000.5],
        ),
        ("%d/%m/%y %H:%M:%S", ["01/03/26 12:00:00"], [1772366400]),
        ("%H:%M", ["12:30", "12:31"], [45000, 45060]),
        ("%Y%m%d%H%M%S", ["20260301120000", "20260301120001"], [1772366400, 1772366401]),
    ],
)
def test_a_format_says_how_stamps_are_read(tmp_path, layout, cells, seconds):
    asked = {"clocks": frozenset({"x"}), "formats": {"x": layout}}
    content = "\n".join(["x,P", *(f"{cell},1" for cell in cells)]).encode()
    assert csv_table(tmp_path / "a", content, "x", **asked).columns["x"].tolist() == seconds
    for read in (of_xlsx, of_hdf5, of_mat, of_tdms):
        assert read(tmp_path / "b", cells[0], **asked) == seconds[0]
    csv_table(tmp_path / "a", b"x,P\n12:00:00,1\n", "P", **asked)
    refusal(["row 2, column x", "format"], "csv", tmp_path / "a", "x", **asked)


@pytest.mark.parametrize(
    ("decimal", "thousands", "cell", "number"),
    [
        *rows_of(
            """
.  ,  1,234.5     1234.5
.  ,  -1,234,567  -1234567
.  ,  950.25      950.25
,  .  1.234,5     1234.5
,  .  1.500       1500
.  '  1'234.5     1234.5
.  ,  1,23.4      nan
.  ,  1,2345      nan
.  ,  1234,567    nan
.  ,  ,234        nan
.  ,  1.234,567   nan
,  .  1.50        nan
""",
            float,
        ),
        (",", " ", "1 234,5", 1234.5),
        (",", "\u202f", "1\u202f234,5", 1234.5),
    ],
)
def test_thousands_stand_in_groups_of_three(tmp_path, decimal, thousands, cell, number):
    """NaN where the cell is refused."""
    asked = {"delimiter": ";", "decimal": decimal, "thousands": thousands}
    content = f"F;x\n{cell};1\n2;2\n".encode()
    if math.isnan(number):
        (tmp_path / "a").write_bytes(content)
        refusal(["row 2, column F"], "csv", tmp_path / "a", "F", **asked)
    else:
        assert csv_table(tmp_path / "a", content, "F", **asked).columns["F"].tolist() == [number, 2]


def test_one_column_may_have_thousands_and_another_decimals(tmp_path):
    """The error about such a column names the key."""
    content = b"t,F\n0.02,950\n0.04,1.050\n0.06,1.070\n"
    (tmp_path / "a").write_bytes(content)
    refusal(["row 3, column F", '`thousands: "."` at the column'], "csv", tmp_path / "a", "F")
    table = csv_table(tmp_path / "a", content, "t", "F", thousands_of={"F": "."})
    assert table.columns["t"].tolist() == [0.02, 0.04, 0.06]
    assert table.columns["F"].tolist() == [950, 1050, 1070]


@pytest.mark.parametrize(
    ("cell", "told"),
    rows_of(
        """
1,234.5     `thousands: ","` | `decimal: ","`
1.234,5     `thousands: ","` | `decimal: ","`
1,234       `thousands: ","` | `decimal: ","`
1,5         `thousands: ","` | `decimal: ","`
1'234       `thousands: ","` | `decimal: ","`
1 234,5     `thousands: ","` | `decimal: ","`
20 N        it is followed by a unit | unit:
1e5 N       it is followed by a unit
TRUE        it is TRUE or FALSE
\uff11      its digits are of another script
2026-03-01  it is a date
""",
        parts,
    ),
)
def test_remedies_keep_the_sample(tmp_path, cell, told):
    """Tokens for missing values would lose it."""
    (tmp_path / "a").write_bytes(f"F;x\n{cell};1\n".encode())
    assert "tokens" not in refusal(
        ["a.csv:row 2, column F", *told], "csv", tmp_path / "a", "F", delimiter=";"
    )


@pytest.mark.parametrize("cell", ['"20"1.2', '2"0', '"20""1.2"', '2"0"', '"20"1"2"', ' "20"'])
def test_damaged_quotes_do_not_join(tmp_path, cell):
    (tmp_path / "a").write_bytes(f"F,x\n1,1\n{cell},1\n".encode())
    refusal(["a.csv:row 3, column F", "quotation mark"], "csv", tmp_path / "a", "F")
    sheet = Sheet(["F,x\n", "1,1\n", f"{cell},1\n"], "table", "x")
    with pytest.raises(NotANumber, match=r"table:row 3, column F.*quotation mark"):
        sheet.values(list(sheet.rows), sheet.places(["F"]))
    assert csv_table(tmp_path / "a", f"F,x\n{cell},1\n".encode(), "x").columns["x"].tolist() == [1]


def test_quoted_fields_are_as_rfc_4180_has_them(tmp_path):
    content = b'"F","x ""y"", z"\r\n"20.5","1"\r\n1,"a ""b"" c\r\nd"\r\n'
    table = csv_table(tmp_path / "a", content, "F")
    assert table.columns["F"].tolist() == [20.5, 1]
    assert [*table.rows] == [2, 4]
