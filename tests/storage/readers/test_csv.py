"""Text as loggers and spreadsheets write it: every dialect is read, block by block as record by
record, and what is wrong is told.
"""

import gzip
import math
from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from reading import csv_table, refusal

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.readers import READERS, TableRequest
from mapmore_cli.storage.readers.csv import below_csv, peek_csv
from mapmore_cli.storage.tables.fields import values_of_records

PATIENT = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
EXPECTED = np.array([[0.0, 1.5], [0.5, -2000.25], [1.0, np.nan]])
NAMES = ("t", "F")
PLACES = (0, 1)

DIALECTS = {
    "German spreadsheet": ("t;F\r\n0,0;1,5\r\n0,5;-2000,25\r\n1,0;\r\n", "utf-8", NAMES,
        {"delimiter": ";", "decimal": ","}),
    "its byte order mark": ("t;F\r\n0,0;1,5\r\n0,5;-2000,25\r\n1,0;\r\n", "utf-8-sig", NAMES,
        {"delimiter": ";", "decimal": ","}),
    "tabs": ("t\tF\n0\t1.5\n.5\t-2.00025e3\n1\t\n", "utf-8", NAMES, {"delimiter": "tab"}),
    "one tab": ("t\tF\n0\t1.5\n.5\t-2.00025e3\n1\t\n", "utf-8", NAMES, {"delimiter": "\t"}),
    "columns of blanks": ("   t      F\n 0.0    1.5\n 0.5  -2000.25\n 1.0  NaN\n", "utf-8", NAMES,
        {"delimiter": "whitespace"}),
    "blanks and commas": ("t F\n0,0 1,5\n0,5 -2000,25\n1,0 nan\n", "utf-8", NAMES,
        {"delimiter": "whitespace", "decimal": ","}),
    "tabs among blanks": ("\tt \t F\n0\t1.5\n\n.5 \t -2000.25\n1 n/a", "utf-8", NAMES,
        {"delimiter": "whitespace"}),
    "bars": ("t|F\n0|1.5\n.5|-2000.25\n1|NA\n", "utf-8", NAMES, {"delimiter": "|"}),
    "names and units": ("t,F\n(s),(N)\n0,1.5\n.5,-2000.25\n1,\n", "utf-8", NAMES, {"header": 2}),
    "names, units, blank": ("t,F\n(s),(N)\n\n0,1.5\n.5,-2000.25\n1,\n", "utf-8", NAMES,
        {"header": 3}),
    "preamble": ("Rig 7\n\nrun, by, hand, 4\nt,F\n0,1.5\n.5,-2000.25\n1,\n", "utf-8", NAMES,
        {"skip_rows": 3}),
    "preamble, no names": ("Rig 7\n#\n0,1.5\n.5,-2000.25\n1,\n", "utf-8", PLACES, {"skip_rows": 2,
        "header": 0}),
    "preamble, units": ("°µ\nt,F\ns,N\n0,1.5\n.5,-2000.25\n1,\n", "latin-1", NAMES, {"skip_rows": 1,
        "header": 2, "encoding": "latin-1"}),
    "old Mac": ("t,F\r0,1.5\r.5,-2000.25\r1,", "utf-8", NAMES, {}),
    "twice returned": ("t,F\r0,1.5\r\r.5,-2000.25\r\r1,\r\r", "utf-8", NAMES, {}),
    "returned and ended": ("t,F\r\r\n0,1.5\r\r\n.5,-2000.25\r\r\n1,\r\r\n", "utf-8", NAMES, {}),
    "quotation marks": ('"t","F"\n"0","1.5"\n"0.5","-2000.25"\n"1.0",""\n', "utf-8", NAMES, {}),
    "delimiter at the end": ("t,F\n0,1.5,\n.5,-2000.25,\n1,,\n", "utf-8", NAMES, {}),
    "UTF-16": ("t,F\n0,1.5\n.5,-2000.25\n1,\n", "utf-16", NAMES, {"encoding": "utf-16"}),
    "cp1252 header": ("t,F,°C – €\n0,1.5,\n.5,-2000.25,x\n1,,\n", "cp1252", NAMES,
        {"encoding": "cp1252"}),
    "header on the first record": ("t,F0,9\n0,1.5\n.5,-2000.25\n1,\n", "utf-8", PLACES,
        {"skip_rows": 1, "header": 0}),
    "closing remark": ("t,F\n0,1.5\n.5,-2000.25\n1,\nLogging end\n", "utf-8", NAMES,
        {"incomplete": True}),
    "half a record at the end": ("t,F\n0,1.5\n.5,-2000.25\n1,\n1.", "utf-8", NAMES,
        {"incomplete": True}),
}  # fmt: skip


@pytest.mark.parametrize("zipped", [False, True], ids=["plain", "gz"])
@pytest.mark.parametrize("name", DIALECTS)
def test_dialects(tmp_path, name, zipped):
    text, encoding, columns, dialect = DIALECTS[name]
    content = text.encode(encoding)
    table = csv_table(
        tmp_path / "a", gzip.compress(content) if zipped else content, *columns, **dialect
    )
    got = np.array([table.columns[column] for column in columns]).T
    np.testing.assert_array_equal(got[:3], EXPECTED)
    assert np.isnan(got[3:]).all()


def test_empty_cells_are_missing_and_blank_lines_keep_the_count(tmp_path):
    raw = csv_table(tmp_path / "a", b"t,F\n\n1,2\n \n3,\n4, nan \n5,inf", "F")
    np.testing.assert_array_equal(raw.columns["F"], [2, np.nan, np.nan, np.inf])
    np.testing.assert_array_equal(raw.rows, [3, 5, 6, 7])


PLAIN = [
    "0",
    "1.5",
    "-2e-3",
    ".5",
    "1.",
    "+7",
    "1e400",
    "1e-400",
    "9007199254740993",
    "0.1000000000000000055511151231257827",
    "nan",
    "-inf",
]
ODD = [
    "",
    " ",
    "1 5",
    "1\x0b",
    "\xa03\xa0",
    *[
        "1_5",
        "NA",
        "x",
        "1,5",
        "1.5.2",
        "0x1p3",
        "１",
        '"2"',
        '"2',
        '2"',
        '"a,b"',
        "1e",
        "#1",
        "1j",
        "Infinity",
    ],
]
CELLS = st.one_of(
    st.sampled_from(PLAIN),
    st.sampled_from(PLAIN),
    st.floats().map(repr),
    st.sampled_from(ODD),
    st.text(max_size=3),
)


def outcome(path, content, *columns, **request):
    try:
        table = csv_table(path, content, *columns, **request)
    except DataError as error:
        return str(error)
    return [
        [*table.rows],
        *(table.columns[column].view(np.int64).tolist() for column in columns),
    ]


@PATIENT
@given(
    lines=st.lists(
        st.one_of(
            st.lists(st.sampled_from(PLAIN), min_size=2, max_size=2), st.lists(CELLS, max_size=4)
        ),
        max_size=12,
    ),
    end=st.sampled_from(["\n", "\r\n", "\r", "\n\n", "\r\r\n"]),
    delimiter=st.sampled_from([",", ";", "tab", "whitespace", "|"]),
    decimal=st.sampled_from([".", ","]),
    header=st.integers(0, 2),
    incomplete=st.booleans(),
    size=st.integers(1, 25),
)
def test_blocks_give_what_records_give(
    tmp_path, lines, end, delimiter, decimal, header, incomplete, size
):
    """With the result, or the error, of reading record by record."""
    asked = {"delimiter": delimiter, "decimal": decimal, "header": header, "incomplete": incomplete}
    mark = {"tab": "\t", "whitespace": "  "}.get(delimiter, delimiter)
    rows = [mark.join(["a", "b"])] * header + [
        mark.join(cells).replace(".", decimal) for cells in lines
    ]
    content = end.join(rows).encode("utf-8", "ignore")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("mapmore_cli.storage.tables.lines.CHUNK", size)
        at_once = outcome(tmp_path / "a", content, 1, 0, **asked)
        patch.setattr("mapmore_cli.storage.readers.csv.values_of_text", lambda *_: [])
        one_by_one = outcome(tmp_path / "a", content, 1, 0, **asked)
    assert at_once == one_by_one


@pytest.mark.parametrize(
    ("text", "dialect"),
    [
        pytest.param("1,2,x\n3.5,-4e2,y\n", {}, id="text beside the wanted columns"),
        pytest.param('"1","2","x"\n"3.5","-4e2","y"\n', {}, id="quoted"),
        pytest.param(" 1 , 2 ,x\r\n3.5,-4e2,y\r\n", {}, id="blanks"),
        pytest.param("1,0;2,0;3\n3,5;-4e2;3\n", {"delimiter": ";", "decimal": ","}, id="commas"),
        pytest.param(" 1  2 3\n3.5\t-4e2 3\n", {"delimiter": "whitespace"}, id="whitespace"),
    ],
)
def test_ordinary_lines_are_read_at_once(tmp_path, monkeypatch, text, dialect):
    """Else nobody would notice that every file took twenty times as long."""
    monkeypatch.setattr("mapmore_cli.storage.readers.csv.values_of_records", None)
    content = (text.splitlines(keepends=True)[0] + text).encode()
    table = csv_table(tmp_path / "a", content, 1, 0, **dialect)
    assert [table.columns[place].tolist() for place in (0, 1)] == [[1, 3.5], [2, -400]]


def test_a_time_stamp_of_digits_is_no_number(tmp_path):
    """Although the other columns hold numbers only."""
    asked = {"clocks": frozenset({"t"}), "formats": {"t": "%M%S"}}
    table = csv_table(tmp_path / "a", b"t,F\n0130,1.5\n0200,2\n", "t", "F", **asked)
    assert [one.tolist() for one in table.columns.values()] == [[90, 120], [1.5, 2]]


def test_numbers_are_those_of_python_to_the_last_bit(tmp_path, monkeypatch):
    """With up to 770 digits: halfway between two neighbours, and among the smallest."""
    monkeypatch.setattr("mapmore_cli.storage.readers.csv.values_of_records", None)
    rng = np.random.default_rng(1)
    doubles = [*rng.uniform(0, 1e6, 300).tolist(), *rng.integers(1, 1 << 52, 300).view(float)]
    with localcontext(prec=1100):
        halves = [(Decimal(one) + Decimal(math.nextafter(one, 2e6))) / 2 for one in doubles]
    cells = [*map(str, halves), *map(repr, map(float, doubles))]
    table = csv_table(tmp_path / "a", "\n".join(["F", *cells, ""]).encode(), "F")
    assert table.columns["F"].tolist() == list(map(float, cells))


def test_one_odd_line_costs_its_chunk_alone(tmp_path, monkeypatch):
    monkeypatch.setattr("mapmore_cli.storage.tables.lines.CHUNK", 50)
    slow = []

    def noted(records, *rest):
        slow.extend(row for row, _ in records)
        return values_of_records(records, *rest)

    monkeypatch.setattr("mapmore_cli.storage.readers.csv.values_of_records", noted)
    cells = [f"{i}" for i in range(100)]
    cells[36:38] = ["", "n/a"]
    table = csv_table(
        tmp_path / "a",
        ("t,F\n" + "".join(f"{i},{cell}\n" for i, cell in enumerate(cells))).encode(),
        "F",
    )
    assert 39 in slow
    assert len(slow) < 15
    np.testing.assert_array_equal(
        table.columns["F"], [np.nan if i in (36, 37) else i for i in range(100)]
    )
    np.testing.assert_array_equal(table.rows, np.arange(2, 102))


def test_a_record_may_begin_with_an_empty_field(tmp_path):
    table = csv_table(tmp_path / "a", b"t,P\n1,2\n,5\n\n3,n/a\n", "P")
    np.testing.assert_array_equal(table.columns["P"], [2, 5, np.nan])
    assert [*table.rows] == [2, 3, 5]


def test_a_quoted_field_may_go_on_in_the_next_block(tmp_path, monkeypatch):
    monkeypatch.setattr("mapmore_cli.storage.tables.lines.CHUNK", 2)
    table = csv_table(tmp_path / "a", b't,note\n1,a\n2,"b\nb\nb"\n3,c\n4,d\n5,e\n', "t")
    assert table.columns["t"].tolist() == [1, 2, 3, 4, 5]
    assert [*table.rows] == [2, 5, 6, 7, 8]


@pytest.mark.parametrize("suffix", ["", ".gz"])
def test_progress_is_told_in_bytes_of_the_file(tmp_path, suffix):
    content = b"t\n" + b"".join(b"%07d\n" % i for i in range(500_000))
    told = []
    content = gzip.compress(content, mtime=0) if suffix else content
    csv_table(tmp_path / "a", content, "t", progress=told.append)
    assert len(told) > 2
    assert told == sorted(told)
    assert told[-1] == len(content)


GOOD = b"t,P,F\n0,80,1.5\n1,81,2.5\n"
ZIPPED = gzip.compress(GOOD * 200, mtime=0)
SEMICOLON = {"delimiter": ";"}

WRONG = {
    "text in a number column": (b"t,P\n0,80\n1,abc\n", ("P",), {},
        ["a.csv:row 3, column P: 'abc' is not a number"]),
    "text, no header": (b"0,80\n1,abc\n", (1,), {"header": 0},
        ["a.csv:row 2, column 1: 'abc' is not a number"]),
    "header taken for data": (GOOD, (0,), {"header": 0}, ["row 1, column 0: 't' is not a number",
        "header"]),
    "closing remark": (b"t,P\n0,80\n1\n", ("P",), {}, ["a.csv:row 3: too few fields: 1", "has 2",
        "cut off", "missing: drop"]),
    "too many fields": (b"t,P\n0,80,9\n", ("P",), {}, ["a.csv:row 2: too many fields: 3"]),
    "semicolons": (b"t;F\n1,5;2,0\n", ("t",), {}, ["no column 't'",
        "delimiter looks like a semicolon", 'delimiter: ";"']),
    "semicolons, no header": (b"1,5;2,0\n", (1,), {"header": 0}, ["'5;2' is not a number",
        "delimiter looks like a semicolon"]),
    "tabs": (b"t\tF\n1\t2\n", ("F",), {}, ["delimiter looks like a tab", "delimiter: tab"]),
    "thousands or decimals": (b"t;F\n0;1.500\n", NAMES, {**SEMICOLON, "decimal": ","},
        ["row 2, column F: '1.500'", 'decimal: "."']),
    "commas unannounced": (b"t;F\n0;1,5\n", NAMES, SEMICOLON,
        ["a.csv:row 2, column F: '1,5' is not a number", 'decimal: ","']),
    "misspelt column": (b"time,Pressure,20\n0,1,2\n", ("Presure",), {}, ["no column 'Presure'",
        "Did you mean 'Pressure'?", "time, Pressure"]),
    "other capitals": (b"T\n0\n", ("t",), {}, ["Did you mean 'T'?"]),
    "column twice": (b"F,F\n0,1\n", ("F",), {}, ["'F' occurs 2 times", "index"]),
    "no such index": (GOOD, (3,), {}, ["no column 3", "3 columns", "0 to 2"]),
    "name without header": (GOOD, ("t",), {"header": 0}, ["'t' is given by name",
        "header: true"]),
    "no header after all": (b"0,80\n1,81\n", ("t",), {}, ["no column 't'",
        "first line contains numbers", "header: false"]),
    "empty file": (b"", ("t",), {}, ["a.csv: the file is empty"]),
    "blank lines only": (b"\n\r\n  \n", ("t",), {}, ["the file is empty"]),
    "nothing after the skipped lines": (GOOD, ("t",), {"skip_rows": 5}, ["the file is empty"]),
    "nothing after the header lines": (GOOD, ("t",), {"header": 3}, ["header but no data"]),
    "gz with a wrong checksum": (ZIPPED[:-6] + bytes(6), ("t",), {},
        ["a.csv: the file is damaged", "get it again"]),
    "binary": (bytes(range(256)), (0,), {"header": 0}, ["is no text file"]),
    "not UTF-16": (GOOD, ("t",), {"encoding": "utf-16"}, ["not a text file in UTF-16"]),
    "latin-1 header": ("t,°C\n1,2\n".encode("latin-1"), ("t",), {}, ["not a text file in UTF-8",
        "0xb0"]),
    "zero bytes": (b"\0" * 64, (0,), {"header": 0}, ["the file is empty"]),
    "quotation mark never closed": (b't,F\n1,"2\n' + b"3,4\n" * 40_000, ("t",), {},
        ["quotation mark"]),
    "escape codes": (b"t\n\x1b[31mred\n", ("t",), {}, [r"'\x1b[31mred' is not a number"]),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_one_clear_message(tmp_path, case):
    content, columns, dialect, parts = WRONG[case]
    (tmp_path / "a").write_bytes(content)
    message = refusal(parts, "csv", tmp_path / "a", *columns, **dialect)
    assert message.startswith("a.csv")
    assert message.replace("\n", "").isprintable()
    assert len(message) < 300


@pytest.mark.parametrize(("count", "end"), [(12, "."), (13, ", ....")])
def test_of_the_columns_that_there_are_a_dozen_are_named(tmp_path, count, end):
    names = [f"x{number}" for number in range(count)]
    (tmp_path / "a.csv").write_text(f"{','.join(names)}\n{','.join('1' * count)}\n")
    told = refusal(("there is no column 'force'",), "csv", tmp_path / "a.csv", "force")
    assert told.endswith(f"The header has: {', '.join(names[:12])}{end}")


@pytest.mark.parametrize("line", [b"0,1\n", b"1\n"])
def test_a_packed_file_that_unpacks_to_hundreds_of_times_its_size_is_refused(
    tmp_path, monkeypatch, line
):
    """Lines with too few fields are read by themselves."""
    monkeypatch.setattr("mapmore_cli.storage.tables.lines.PACKED_TEXT", 40_000)
    path = tmp_path / "a.csv.gz"
    path.write_bytes(gzip.compress(b"strain,force\n" + line * 40_000))
    refusal(["unpacks from"], "csv", path, "strain", incomplete=True)


def test_every_cut_of_a_gz_file_is_noticed(tmp_path):
    whole = gzip.compress(GOOD, mtime=0)
    for end in range(2, len(whole)):
        with pytest.raises(DataError, match="damaged"):
            csv_table(tmp_path / "a", whole[:end], "t")


TABLES = {
    "below each other": ("run 1\nt,F\n{0}\n{1}\nrun 2\nt,F\n{0}\n{1}\n", 2, "F", 8),
    "side by side": ("t,F,t,F\n1,0,{0}\n2,0,{1}\n", 2, "F", 3),
    "a map": ("t,1,2\n{0},5\n{1},5\n", "map", "cell", 3),
}


@pytest.mark.parametrize("kind", TABLES)
def test_marks_between_thousands_are_sought_in_the_wanted_table(tmp_path, kind):
    """Not in the lines of the whole file, whose header names other columns or names them twice."""
    text, table, column, row = TABLES[kind]
    path = tmp_path / "a.csv"
    content = text.format("1,950", "2,1.50").encode()
    assert {950, 1.5} <= {*csv_table(path, content, column, table=table).columns[column]}
    path.write_text(text.format("1,950", "2,1.050"))
    refusal((f"a.csv:row {row}, column {column}", "may be 1050"), "csv", path, column, table=table)


ROWS = [f"{t},{t + 0.125:.3f}" for t in range(11)]
PAIRS = [f"{row},{row}" for row in ROWS]
ENDS = {  # the text, what is asked for, the wanted column, and its values in the last line
    "one table": (["t,F", *ROWS], {}, "F", 1),
    "below each other": (["run 1", "t,F", *ROWS[:3], "run 2", "t,F", *ROWS], {"table": 2}, "F", 1),
    "side by side": (["t,F,t,F", *PAIRS], {"table": 2}, "F", 1),
    "without titles": ([*ROWS[:3], "", *ROWS], {"table": 2, "header": 0}, 1, 1),
    "a map": (["t,1,2,3", *PAIRS], {"table": "map"}, "cell", 3),
}


@pytest.mark.parametrize("cut", [2, 5])
@pytest.mark.parametrize("kind", ENDS)
def test_a_last_line_that_was_cut_off_is_refused_in_every_table(tmp_path, kind, cut):
    """Within its last number (2), or before it (5); `missing: drop` leaves the line out."""
    lines, request, column, samples = ENDS[kind]
    path, text = tmp_path / "a.csv", "\n".join(lines)
    whole = csv_table(path, text.encode(), column, **request)
    assert whole.doubts == ()
    path.write_text(text[:-cut])
    # a line of two tables that lacks its last cell is a line with an empty cell
    if (kind, cut) != ("side by side", 5):
        refusal((f"a.csv:row {len(lines)}", "cut off"), "csv", path, column, **request)
    (table,) = READERS["csv"].read(
        path, TableRequest("a.csv", (column,), incomplete=True, **request)
    )
    found = table.columns[column]
    np.testing.assert_array_equal(found[np.isfinite(found)], whole.columns[column][:-samples])


def test_a_text_is_split_in_the_same_order_of_ways_in_every_process(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text('t,F\n"1,5","2,5"\n')
    ways = [(top.settings, [*map(len, top.rows)]) for top in peek_csv(path, 9)]
    assert ({"decimal": ","}, [2, 2]) in ways  # a comma is both delimiter and decimal mark
    path.write_text("t F\n1 234\n1'234\n1,234.5\n1.234,5\n")
    marks = dict.fromkeys(top.settings.get("thousands") for top in peek_csv(path, 9))
    assert [*marks] == [None, " ", "'", ",", "."]
    for way in (top.settings for top in peek_csv(path, 9)):
        delimiter = way.get("delimiter", ",").replace("whitespace", " ")
        others = way.get("decimal", "."), delimiter
        assert others != (",", ",")
        assert way.get("thousands") not in others


@pytest.mark.parametrize(("header", "between"), [(1, "run 2\nt,F\n"), (0, "\n")])
def test_a_long_text_is_read_to_its_end_only_if_a_table_may_stand_below(tmp_path, header, between):
    path, half = tmp_path / "a.csv", "1,2\n" * 150
    for text, count in ((half * 2, 200 - header), (f"{half}{between}{half}", 300)):
        path.write_text("t,F\n" * header + text)
        tables = below_csv(path, TableRequest("a.csv", (), header=header))
        assert sum(len(table.rows) for table in tables) == count


def test_a_last_line_whose_last_cell_is_empty_is_refused_in_words_that_say_so(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["t,F", *ROWS[:-1], "10,"]))
    refusal(("a.csv:row 12", "in its last cell, which is empty, than"), "csv", path, "t", "F")
