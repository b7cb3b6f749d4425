"""Every constant of the rule for cells, of thousands and of tables below each other, by hand."""

import math
from decimal import Decimal

import numpy as np
import pytest

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import OpenEnd, TableRequest
from mapmore_cli.storage.tables import thousands as module
from mapmore_cli.storage.tables.below import chosen_table, tables_below
from mapmore_cli.storage.tables.cells import (
    CellReader,
    Lacking,
    NotANumber,
    holds_number,
    number_of,
    shortened,
    stamp_of,
)
from mapmore_cli.storage.tables.gate import _cut_in
from mapmore_cli.storage.tables.rows import table_of_records, table_of_rows, values_of_rows
from mapmore_cli.storage.tables.thousands import may_be_grouped, refuse_grouped


@pytest.mark.parametrize(
    ("cell", "number"),
    [
        *((" 1.5 ", 1.5), (Decimal("1.5"), 1.5), (np.float32(0.5), 0.5), ("-1.#INF", -math.inf)),
        *(("1.#INF00", math.inf), ("1.#J", math.inf), ("-1.#IND", math.nan)),
        *(("1.#QNAN", math.nan), ("nan(snan)", math.nan), ("nan(ind)", math.nan)),
        *(("", math.nan), (None, math.nan), (np.datetime64("NaT", "s"), math.nan)),
        *(("1_5", None), ("\uff11", None), (True, None), (10**400, None), ("1.#X", None)),
        *(("-1.5D+02", -150.0), (".5d-1", 0.05), ("1d5", None), ("1.5D2", None)),
        *(("1\u202f234.5", 1234.5), ("1\u00a0234\u00a0567", 1234567.0), ("1\u00a023", None)),
    ],
)
def test_what_a_cell_is(cell, number):
    found = number_of(cell)
    assert found is None if number is None else np.array_equal(found, number, equal_nan=True)


@pytest.mark.parametrize(
    ("decimal", "thousands", "cell"),
    [(".", ".", "1.234,5"), (",", ",", "1,234.5"), (".", ",", "1,234.5"), (".", "'", "1'234.5")],
)
def test_one_of_point_and_comma_is_the_decimal_mark_if_the_other_separates_thousands(
    decimal, thousands, cell
):
    request = TableRequest("a", ("x",), decimal=decimal, thousands=thousands)
    assert request.cells("x")(cell) == 1234.5


def test_stamps_are_in_the_unit_of_the_column_from_their_epoch():
    def read(cell, layout=None, second=1000.0):
        return CellReader(clock=True, format=layout, second=second)(cell)

    assert read("0:00:02.5") == 2500.0
    assert CellReader(clock=True)("0:00:02.5") == TableRequest("", ("t",)).second * 2.5 == 2.5
    assert read("2 days 01:01:01", second=1.0) == 2 * 86400 + 3661
    assert read("01.01.1970 00:00:01") == 1000.0
    # a format without a year counts from 1900, and one with a year from 1970
    assert read("00:00:02", "%H:%M:%S") == 2000.0
    assert read("1970 00:00:02", "%Y %H:%M:%S") == 2000.0
    assert read("1901 00:00:02", "%Y %H:%M:%S", 1.0) == -69 * 365 * 86400 - 17 * 86400 + 2
    assert read("02 +0100", "%S %z", 1.0) == -3598.0
    with pytest.raises(NotANumber):
        read("\uff10\uff12", "%S")


def test_a_stamp_has_at_most_forty_characters():
    for form in ("2026/03/01{}12:00:00", "01.03.2026{}12:00:00"):
        fits = form.format(" " * 22)
        assert len(fits) == 40
        assert stamp_of(fits)[1] == 1772366400
        assert stamp_of(form.format(" " * 23)) is None


def test_a_date_alone_is_no_stamp():
    for date in ("2026-03-01", "20260301T120000", "2026/03/01", "01.03.2026"):
        assert stamp_of(date) is None


def test_messages_show_forty_characters_in_ascii():
    assert shortened("x" * 40) == "x" * 40
    assert shortened("x" * 41) == "x" * 37 + "..."
    assert shortened("Grüße") == "Grüße"
    assert shortened("a\x01é") == r"a\x01\xe9"


def test_texts_are_numbered_from_one_in_their_order():
    texts = {}
    read = CellReader(missing=frozenset({"?"}), texts=texts)
    assert [read(cell) for cell in ("b", " a ", "b", 1.0, "1", b"a")] == [1, 2, 1, 3, 3, 2]
    assert np.isnan([read(cell) for cell in ("NA", "?", "")]).all()
    assert np.isnan(read(Lacking("is one of the merged cells A1:A2", "")))
    for lacking, reader in (
        (Lacking("is odd", "", "="), read),
        (Lacking("is odd", ""), CellReader()),
    ):
        with pytest.raises(NotANumber, match="is odd"):
            reader(lacking)
    assert texts == {"b": 1, "a": 2, "1": 3}


@pytest.mark.parametrize(
    ("reader", "more"),
    [
        (CellReader(), False),
        (CellReader(texts={}), True),
        (CellReader(format="%S"), False),
        (CellReader(clock=True), False),
        (CellReader(clock=True, form="a number"), False),
        (CellReader(clock=True, form="a time as `mm:ss.s`"), True),
        (CellReader(clock=True, format="%S"), True),
    ],
)
def test_which_columns_hold_more_than_numbers(reader, more):
    assert reader.reads_more_than_numbers is more


def test_an_unknown_cell_is_told_from_one_of_a_known_kind():
    for cell, known in (("abc", False), ("20 N", True), ("#DIV/0!", True), ("Err:502", True)):
        with pytest.raises(NotANumber) as error:
            CellReader()(cell)
        assert error.value.known is known
    error = NotANumber("a", "is odd", "mend it")
    assert (error.known, error.message, error.at("here").remedy) == (True, "'a' is odd", "mend it")
    assert (error.message, error.at("", "so").remedy) == ("here: 'a' is odd", "so")
    assert NotANumber("", "is odd", "").message == "is odd"
    with pytest.raises(NotANumber) as error:
        CellReader(clock=True)("3/1/2026")
    assert "%H" not in error.value.remedy
    assert "%I" in error.value.remedy


def test_words_and_empty_cells_hold_no_number():
    cells = ("5", "-1.5", "12:00:00", "nan", "", " ", "NA", "abc")
    assert [holds_number(cell) for cell in cells] == [True] * 4 + [False] * 4
    assert [holds_number("1,5", mark) for mark in ",."] == [True, False]


@pytest.mark.parametrize(
    ("values", "may_be"),
    [
        *(([950, 1.05, 1.999], True), ([950, -1.001, np.nan], True), ([999, 1.05], True)),
        *(([1000, 1.05], False), ([950, 940], False), ([1.05, 1.07], False)),
        *(
            ([950, 0.999], False),
            ([950, 1.0505], False),
            ([950, 1.000000005], False),
            ([], False),
            ([0, 1.001], True),
        ),
    ],
)
def test_numbers_that_may_have_thousands(values, may_be, monkeypatch):
    for block in (10_000, 1):
        monkeypatch.setattr(module, "BLOCK", block)
        assert may_be_grouped(np.array(values, dtype=float)) is may_be


ZEROS = ["23.000"] * 100


@pytest.mark.parametrize(
    ("cells", "row"),
    [
        *((["950", "1.050"], 1), ([b"950", " 1.051 "], 1), (["1.051", "NA", "", "11"], 0)),
        *((["10", "1.051"], None), (["10", "1.050"], 1), (["-950", "-1.051"], 1)),
        *((["950", "0.051"], None), (["950", "1.05"], None), (["950", "1.0501"], None)),
        *((["1000", "1.050"], None), (["950", 1.05], None), ([950.0, "1.050"], 1)),
        *((["950"], None), (["1.050"], None), (["0", "1.050"], None)),
        # a program that keeps zeros at the end is known after a hundred of them
        *(([*ZEROS, "950"], 0), ([*ZEROS, "23.000", "950"], None), (["950", *ZEROS * 2], 1)),
        ([*ZEROS, "23.100", "950"], 0),
    ],
)
def test_columns_that_are_refused_for_thousands(cells, row):
    if row is None:
        refuse_grouped(enumerate(cells), ".", "")
        return
    with pytest.raises(NotANumber, match=f"row {row}: .*may be ") as error:
        refuse_grouped(enumerate(cells), ".", "row {row}")
    assert "." not in str(error.value.message).partition("may be ")[2].partition(":")[0]


@pytest.mark.parametrize(("decimal", "other"), [(".", ","), (",", ".")])
def test_the_remedy_for_thousands_names_both_marks(decimal, other):
    cells = [(1, "950"), (2, f"1{decimal}050")]
    with pytest.raises(NotANumber, match=r"may be 1050: the column has .* up to 950") as error:
        refuse_grouped(cells, decimal, "")
    assert f'`decimal: "{other}"` and `thousands: "{decimal}"`' in error.value.remedy


def rows(text):
    """Rows by lines; an empty line is a blank row, which readers leave out."""
    lines = enumerate(text.strip().splitlines(), 1)
    return [(number, line.split(";")) for number, line in lines if line]


BELOW = """
a log;of two
x;y
1;2
3;4

second
7
p;q
5;6
7;
8;9
u;v;w
1;2;3
1;2;3;4
1;2;3;4
"""


def test_tables_below_each_other():
    """A row of one number among empty cells is of the table; a table has two rows at least."""
    first, second, third = tables_below(rows(BELOW), 1, holds_number)
    assert (first.title, first.header) == ("a log of two", [(2, ["x", "y"])])
    assert [number for number, _ in first.rows] == [3, 4]
    assert (second.title, second.header) == ("second 7", [(8, ["p", "q"])])
    assert [number for number, _ in second.rows] == [9, 10, 11]
    assert third.title == "u v w"
    assert (third.header, len(third.rows)) == ([(13, ["1", "2", "3"])], 2)
    (mixed,) = tables_below(rows("a;b;c\nx;1;2\ny;3;4"), 1, holds_number)
    assert len(mixed.rows) == 2  # two numbers make a row of a table, also beside a word
    # a single row of another width ends no table; after a blank line, it is no row of the table
    for text, count in (("1;2\n3;4\n5;6;7", 3), ("1;2\n3;4\n\n5;6;7", 2)):
        (one,) = tables_below(rows(text), 0, holds_number)
        assert len(one.rows) == count
    (labelled,) = tables_below(rows("t;x;y\nMaximum:;5;6\n1;2;3\n4;5;6"), 2, holds_number)
    assert [number for number, _ in (*labelled.header, *labelled.rows)] == [1, 2, 3, 4]
    parts = tables_below(rows("1;2\n3;4\n\n5;6\n7;8\nF;1\n1;2\n3;4"), 0, holds_number)
    assert [[number for number, _ in part.rows] for part in parts] == [[1, 2], [4, 5], [7, 8]]
    # a row of another width stays in a table with titles, so that the reader refuses the row
    (titled,) = tables_below(rows("x;y\n1;2\n3;4\n5;6;7"), 1, holds_number)
    assert [number for number, _ in titled.rows] == [2, 3, 4]
    # the name of the logger and the date are no title of the first table
    text = "logger 7\n1 March\nrun 1\nx;y\n1;2\n3;4\nrun 2\nx;y\n5;6\n7;8"
    assert [one.title for one in tables_below(rows(text), 1, holds_number)] == ["run 1", "run 2"]


def test_a_table_is_chosen_by_its_number_from_one():
    of = {number: TableRequest("a", (), table=number) for number in (1, 3, 4)}
    assert chosen_table(rows(BELOW), of[1], holds_number).header == [(2, ["x", "y"])]
    assert chosen_table(rows(BELOW), of[3], holds_number).title == "u v w"
    with pytest.raises(DataError, match="3 tables were found"):
        chosen_table(rows(BELOW), of[4], holds_number)
    for text in ("", "a;1;2", "a\n3;4"):
        with pytest.raises(DataError, match="contains no map"):
            chosen_table(rows(text), TableRequest("a", (), table="map"), holds_number)
    short = chosen_table(rows("a;1;2\n3;4"), TableRequest("a", (), table="map"), holds_number)
    assert [cells for _, cells in short.rows] == [["3", "1", "4"], ["3", "2", ""]]
    assert short.begin == 1


def test_cells_that_a_row_or_a_record_lacks_are_missing():
    wanted = [("y", 1, CellReader()), ("x", 0, CellReader())]
    numbers, values = values_of_rows([(3, ["1", "2"]), (5, ["3"])], wanted, "a")
    assert numbers.tolist() == [3, 5]
    np.testing.assert_array_equal(values, [[2, np.nan], [1, 3]])
    records = [(1, [("x", 1.0), ("note", "a")]), (4, [("x", None), ("y", "5")])]
    table = table_of_records(records, TableRequest("a", ()))
    assert [*table.columns] == ["x", "y"]
    assert table.rows.tolist() == [1, 4]
    np.testing.assert_array_equal([*table.columns.values()], [[1, np.nan], [np.nan, 5]])


def test_columns_of_rows_are_called_by_their_titles_or_their_places():
    cells = [(3, ["950", "1"]), (5, ["1.050"]), (6, ["1.060", "2"])]
    with pytest.raises(NotANumber, match=r"a:row 5, column F: .*may be 1050"):
        table_of_rows(cells, {"force": 0}, ["F", "x"], TableRequest("a", ("force",)), "a")
    with pytest.raises(NotANumber, match=r"a:row 5, column force: .*may be 1050"):
        table_of_rows(cells, {"force": 0}, None, TableRequest("a", ("force",)), "a")
    table = table_of_rows(cells, {"n": 1}, ["F", "x"], TableRequest("a", ("n",)), "a")
    assert table.rows.tolist() == [3, 5, 6]
    np.testing.assert_array_equal(table.columns["n"], [1, np.nan, 2])
    short = [(3, ["x", "950"]), (4, ["x"]), (5, ["x", "1.050"])]
    with pytest.raises(NotANumber, match=r"a:row 5, column F"):
        table_of_rows(short, {"force": 1}, ["x", "F"], TableRequest("a", ("force",)), "a")
    said = TableRequest("a", ("force",), thousands_of={"force": "."})
    table = table_of_rows(cells, {"force": 0}, None, said, "a")
    assert table.columns["force"].tolist() == [950, 1050, 1060]


@pytest.mark.parametrize(
    ("before", "last", "cut"),
    [
        *((["1,20.5"] * 10, "1,2", True), (["1,20.5"] * 9, "1,2", False)),
        *((["1,20.5"] * 10, "1,20.7", False), (["1,20.5"] * 9 + ["1,20.55"], "1,2", False)),
        *((["1,20.5"] * 2, "1", True), (["1,20.5", "1"], "1", False), ([], "1", False)),
        *((["1,20.5"] * 10, "1,2000.75", False), (["1,20"] * 10, "1,2", False)),
    ],
)
def test_a_last_line_without_end_that_was_cut(before, last, cut):
    lines = [line.split(",") for line in [*before, last]]
    found = _cut_in(OpenEnd(90, lines, "."), range(1, 91))
    assert (found is not None) is cut
    assert found is None or found.rows == 1


def test_digits_that_were_cut_stand_behind_the_decimal_mark_of_the_file():
    lines = [["1", "20,5"]] * 10 + [["1", "2"]]
    assert [_cut_in(OpenEnd(90, lines, mark), range(1, 91)) is not None for mark in ",."] == [
        True,
        False,
    ]
