"""Files that a logger did not finish, lines that are no records, numbers that look like others."""

import gzip

import h5py
import numpy as np
import pytest
from reading import csv_table, refused, table_of

from mapmore_cli.storage.readers.csv import peek_csv

ROWS = b"t,P\n" + b"".join(b"%d,%d.5\n" % (i, i) for i in range(30))
SEMICOLON = {"delimiter": ";", "decimal": ","}


@pytest.mark.parametrize(
    ("content", "count", "request_"),
    [
        (ROWS + b"\0" * 4096, 4096, {}),
        (ROWS + b"\x1a", 1, {}),
        (ROWS.replace(b"\n", b"\r\n") + b"\x1a\r\n\0\0", 3, {}),
        (gzip.compress(ROWS + b"\0" * 5000), 5000, {}),
        (ROWS.decode().encode("utf-16") + b"\0" * 4096, 2048, {"encoding": "utf-16"}),
        (ROWS.replace(b",", b";").replace(b".", b",") + b"\0" * 99, 99, SEMICOLON),
    ],
    ids=["NUL", "Ctrl-Z", "both, CR LF", "gzip", "UTF-16", "semicolons"],
)
def test_what_fills_a_file_behind_its_text_is_told(tmp_path, content, count, request_):
    table = csv_table(tmp_path / "a", content, "t", "P", **request_)
    np.testing.assert_array_equal(table.columns["P"], np.arange(30) + 0.5)
    assert f"ends with {count} characters of padding" in table.doubts[0]
    assert any(len(top.rows) == 31 for top in peek_csv(tmp_path / "a", 50))


@pytest.mark.parametrize("line", [b"\0" * 4096 + b"40,1.5,4", b"\0\0,1.5,4", b"1,1.5\0\0,4"])
def test_a_line_with_nul_in_it_is_lost_whatever_columns_are_wanted(tmp_path, line):
    content = b"x,t,P\n1,2,3\n" + line + b"\n4,5,6\n"
    with refused("a.csv:row 3: the line contains NUL bytes", "`missing: drop`"):
        csv_table(tmp_path / "a", content, "P")
    kept = csv_table(tmp_path / "a", content, "P", incomplete=True)
    np.testing.assert_array_equal(kept.columns["P"], [3, np.nan, 6])


@pytest.mark.parametrize("end", [b"\0\n", b"\0\0\r\n", b"\0 \n\0\0"])
def test_a_nul_in_the_last_cell_is_no_padding(tmp_path, end):
    content = b"t,P\n1,2\n2," + end
    with refused("a.csv:row 3: the line contains NUL bytes", "`missing: drop`"):
        csv_table(tmp_path / "a", content, "P")


def test_comments_are_left_out_and_counted(tmp_path):
    content = b'# head\nt,P\n1,2\n# valve "open,3\n  #4,5\n3,4\n#end'
    table = csv_table(tmp_path / "a", content, "t", "P", comment="#")
    np.testing.assert_array_equal([*table.columns.values()], [[1, 3], [2, 4]])
    assert table.rows.tolist() == [3, 6]
    blanks = content.replace(b"#", b"%").replace(b",", b" ").replace(b'"', b"")
    table = csv_table(tmp_path / "a", blanks, "P", comment="%", delimiter="whitespace")
    assert table.columns["P"].tolist() == [2, 4]


@pytest.mark.parametrize(
    ("line", "mark"), [("# valve", "#"), ("# valve,open", "#"), ("// valve", "//"), ("% x,y", "%")]
)
def test_a_line_that_looks_like_a_comment_is_called_so(tmp_path, line, mark):
    with refused("a.csv:row 3", f'write `comment: "{mark}"`'):
        csv_table(tmp_path / "a", f"t,P\n1,2\n{line}\n3,4\n".encode(), "t", "P")


def test_numbers_of_microsofts_library(tmp_path):
    cells = ["-1.#IND", "1.#INF00", "1.#QNAN0", "-1.#J", "-nan(ind)", "4.5"]
    meant = [np.nan, np.inf, np.nan, -np.inf, np.nan, 4.5]
    content = "\n".join(["P;t", *(f"{cell};1" for cell in cells), ""])
    for text, request in ((content, {"delimiter": ";"}), (content.replace(".", ","), SEMICOLON)):
        table = csv_table(tmp_path / "a", text.encode(), "P", **request)
        np.testing.assert_array_equal(table.columns["P"], meant)


def written_in_part(file, parts, **how):
    array = file.create_dataset("P", (40,), **how)
    for part in parts:
        array[part] = np.arange(1, 41)[part]
    file["t"] = np.arange(40.0)


CHUNKS = {"chunks": (10,), "dtype": "f8"}


@pytest.mark.parametrize(
    ("parts", "how", "absent"),
    [
        ([slice(0, 10)], CHUNKS, slice(10, 40)),
        ([slice(0, 15)], CHUNKS, slice(15, 40)),
        ([slice(0, 10), slice(20, 40)], CHUNKS, slice(10, 20)),
        ([slice(0, 25)], {**CHUNKS, "compression": "gzip", "dtype": "i2"}, slice(25, 40)),
        ([], {"dtype": "f4"}, slice(0, 40)),
        ([slice(0, 40)], CHUNKS, slice(0, 0)),
    ],
)
def test_chunks_that_were_never_written_are_missing(tmp_path, parts, how, absent):
    with h5py.File(tmp_path / "a", "w") as file:
        written_in_part(file, parts, **how)
    expected = np.arange(1.0, 41.0)
    expected[absent] = np.nan
    table = table_of("hdf5", tmp_path / "a", "t", "P", incomplete=True)
    np.testing.assert_array_equal(table.columns["P"], expected)
    if absent.stop:
        assert "values of 'P' were never written" in table.doubts[0]
        with refused("values of 'P' were never written", "`missing: drop`"):
            table_of("hdf5", tmp_path / "a", "t", "P")


def test_values_beyond_the_end_of_an_axis_are_not_counted(tmp_path):
    with h5py.File(tmp_path / "a", "w") as file:
        written_in_part(file, [slice(36, 40)], chunks=(12,), dtype="f8")
    with refused("36 values of 'P' were never written"):
        table_of("hdf5", tmp_path / "a", "t", "P")


def test_fields_of_records_that_were_never_written(tmp_path):
    with h5py.File(tmp_path / "a", "w") as file:
        fields = [("t", "f8"), ("P", "f8")]
        file.create_dataset("log", (40,), chunks=(10,), dtype=fields)[:10] = (1.0, 2.0)
    with refused("30 values of 'log/t' were never written"):
        table_of("hdf5", tmp_path / "a", "log/t", "log/P")


def test_rows_of_a_matrix_that_were_never_written_are_missing(tmp_path):
    with h5py.File(tmp_path / "a", "w") as file:
        file.create_dataset("log", (40, 2), "f8", chunks=(10, 2))[:15] = 1.0
    table = table_of("hdf5", tmp_path / "a", "log[:,1]", incomplete=True)
    expected = np.where(np.arange(40) < 15, 1.0, np.nan)
    np.testing.assert_array_equal(table.columns["log[:,1]"], expected)
    with h5py.File(tmp_path / "b", "w") as file:  # zeros, of which the first chunk is complete
        file.create_dataset("log", (40, 64), "f8", chunks=(10, 32))[:20] = 0.0
    table = table_of("hdf5", tmp_path / "b", "log[:,1]", incomplete=True)
    expected = np.where(np.arange(40) < 10, 0.0, np.nan)
    np.testing.assert_array_equal(table.columns["log[:,1]"], expected)
    with h5py.File(tmp_path / "c", "w") as file:  # other columns are complete
        log = file.create_dataset("log", (40, 64), "f8", chunks=(10, 32))
        log[:20, :32] = log[:, 32:] = 1.0
    table = table_of("hdf5", tmp_path / "c", "log[:,1]", incomplete=True)
    expected = np.where(np.arange(40) < 20, 1.0, np.nan)
    np.testing.assert_array_equal(table.columns["log[:,1]"], expected)


def test_durations_are_seconds_in_the_column_of_the_time(tmp_path):
    pa, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    for kind, one in (("s", 1), ("ms", 1000), ("us", 10**6), ("ns", 10**9)):
        times = pa.array([0, 2 * one, None], pa.duration(kind))
        parquet.write_table(pa.table({"t": times, "P": [1.0, 2.0, 3.0]}), tmp_path / "a")
        table = table_of("parquet", tmp_path / "a", "t", "P", clocks=frozenset({"t"}), second=1e3)
        np.testing.assert_array_equal(table.columns["t"], [0, 2000, np.nan])
    with refused("'t': a duration, not a number"):
        table_of("parquet", tmp_path / "a", "t")


@pytest.mark.parametrize("mark", [".", ","])
def test_a_last_number_that_alone_ends_with_its_decimal_point_was_cut(tmp_path, mark):
    """The number of digits varies, so that it is no evidence by itself."""
    rows = "t;F\n" + "".join(f"{i};{1.25 * i}\n" for i in range(20)).replace(".", mark)

    def table(text, **request):
        return csv_table(
            *(tmp_path / "a", text.encode(), "F"), delimiter=";", decimal=mark, **request
        )

    with refused("fewer digits in its last cell, 31", "it was cut off"):
        table(f"{rows}25;31{mark}")
    assert table(f"{rows}25;31{mark}", incomplete=True).size == 20
    assert table(f"{rows}25;31").size == 21
    assert table(f"{rows}24;7{mark}\n25;31{mark}").size == 22
