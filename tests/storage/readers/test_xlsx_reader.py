import subprocess
import zipfile
from datetime import datetime, time, timedelta
from functools import partial

import numpy as np
import pytest
from reading import other_workbook, refusal, table_of, workbook

from mapmore_cli.annexes.drafting.preview import preview
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.readers import TableRequest, xlsx
from mapmore_cli.study.sections.logs import Logs

TABLE = [["t", "F", "note"], [0, 1.5, "a"], [0.5, -2, None], [], [1.0, None, "b"]]


@pytest.fixture
def book(tmp_path):
    """A workbook with sheets `About` and `Run1`."""
    path = tmp_path / "book.xlsx"
    workbook(path, About=[["Rig", "7"]], Run1=TABLE)
    return path


read = partial(table_of, "xlsx")


def test_named_sheet_with_rows_as_the_sheet_counts_them(book):
    table = read(book, "F", "t", sheet="Run1")
    np.testing.assert_array_equal(table.columns["t"], [0, 0.5, 1])
    np.testing.assert_array_equal(table.columns["F"], [1.5, -2, np.nan])
    np.testing.assert_array_equal(table.rows, [2, 3, 5])
    assert table.at(2) == "a.xlsx:Run1:row 5"


@pytest.mark.parametrize("suffix", [".xls", ".ods"])
def test_workbooks_of_other_programs(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    other_workbook(path, [["t", 2026, "note"], [0, 1.5, "a"], [0.5, -2, "b"]])
    table = read(path, "t", "2026")
    np.testing.assert_array_equal(table.columns["2026"], [1.5, -2])
    assert table.at(1) == "a.xlsx:a:row 3"
    refusal(["a.xlsx:a:row 2, column note: 'a' is not a number"], "xlsx", path, "note")
    whole = path.read_bytes()
    for end in range(0, len(whole), 499):
        path.write_bytes(whole[:end])
        refusal(["a.xlsx: the file is damaged, or is no workbook"], "xlsx", path, "t")
    path.write_text("t\tF\n1\t2\n")
    refusal(["a.xlsx: is a text file with the name of a workbook", ".txt"], "xlsx", path, "t")


TEXTS = [["t", "F"], ["s", "N"], ["0", "1.000,5"], ["0,5", "-2,25"], ["1,0", " "]]


@pytest.mark.parametrize("suffix", [".xlsx", ".xls", ".ods"])
def test_texts_with_decimal_commas_are_read_as_the_message_recommends(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    workbook(path, a=TEXTS) if suffix == ".xlsx" else other_workbook(path, TEXTS)
    refusal(
        ["row 4, column t: '0,5'", 'give the right ones, for example `decimal: ","`'],
        "xlsx",
        path,
        "t",
        header=2,
    )
    table = read(path, "t", "F", header=2, decimal=",", thousands=".")
    np.testing.assert_array_equal(table.columns["t"], [0, 0.5, 1])
    np.testing.assert_array_equal(table.columns["F"], [1000.5, -2.25, np.nan])
    plain = [[cell.replace("1.000", "1000") for cell in row] for row in TEXTS]
    twice = [*plain, [], *plain]
    workbook(path, a=twice) if suffix == ".xlsx" else other_workbook(path, twice)
    second = read(path, "t", header=2, decimal=",", table=2)
    np.testing.assert_array_equal(second.columns["t"], [0, 0.5, 1])
    columns = {name: {"column": name} for name in ("t", "F")}
    keys = {"decimal": ",", "thousands": "."}
    Logs.model_validate({"files": [path.name], "reader": "xlsx", "columns": columns, **keys})


@pytest.mark.parametrize(("mark", "settings"), [(",", {"decimal": ","}), (".", {})])
def test_texts_with_decimal_marks_are_numbers_for_a_draft(tmp_path, mark, settings):
    rows = [[text.replace(".", mark) for text in (f"{k / 10}", f"{k}.5")] for k in range(9)]
    workbook(tmp_path / "a.xlsx", a=[["t [s]", "Force [N]"], *rows])
    layout = preview(tmp_path / "a.xlsx")
    assert layout.columns == ("t [s]", "Force [N]")
    assert layout.numeric == (0, 1)
    assert {key: layout.settings[key] for key in layout.settings if key == "decimal"} == settings
    workbook(tmp_path / "b.xlsx", a=[["time", "2026"], *([k, k / 3] for k in range(9))])
    assert preview(tmp_path / "b.xlsx").columns == ("time", "2026")


def test_without_header_after_skipped_rows(book):
    np.testing.assert_array_equal(
        read(book, 1, sheet="Run1", header=0, skip_rows=1).columns[1], [1.5, -2, np.nan]
    )
    units = book.with_name("b.xlsx")
    workbook(units, a=[["made by hand"], ["t", "F"], ["s", "N"], [1, 2]])
    np.testing.assert_array_equal(read(units, "F", skip_rows=1, header=2).columns["F"], [2])


def test_dates_count_as_seconds_in_the_column_of_the_time(tmp_path):
    path = tmp_path / "a.xlsx"
    cells = [datetime(1970, 1, 2, 0, 0, 1), time(0, 1, 0, 500_000), timedelta(hours=1)]
    workbook(path, a=[[*cells, " 2.5 ", "#N/A"]])
    table = read(path, *range(5), header=0, clocks=frozenset(range(5)))
    np.testing.assert_allclose(
        [table.columns[i][0] for i in range(5)], [86_401, 60.5, 3600, 2.5, np.nan], atol=1e-3
    )
    told = [
        ["row 1, column 0", "it is a date", "format the cells as numbers"],
        ["it is a time"],
        ["it is a time"],
    ]
    for column, parts in enumerate(told):
        refusal(parts, "xlsx", path, column, header=0)


@pytest.mark.parametrize("year", [1900, 1904])
def test_dates_count_from_the_year_of_the_workbook(tmp_path, year):
    made = workbook(tmp_path / "a.xlsx", a=[])
    made.epoch = datetime(year, 1, 1) if year == 1904 else made.epoch
    for second in (0, 1):
        made["a"].append([datetime(2026, 3, 1, 12, 0, second)])
    made.save(tmp_path / "a.xlsx")
    table = read(tmp_path / "a.xlsx", 0, header=0, clocks=frozenset({0}))
    np.testing.assert_allclose(table.columns[0], [1772366400, 1772366401], atol=1e-3)


def test_wrong_dimensions_of_other_software_do_not_cut_the_sheet(book, tmp_path):
    patched = tmp_path / "patched.xlsx"
    with zipfile.ZipFile(book) as old, zipfile.ZipFile(patched, "w") as new:
        for member in old.infolist():
            content = old.read(member)
            new.writestr(
                member, content.replace(b'<dimension ref="A1:C5"', b'<dimension ref="A1:A1"')
            )
            assert member.filename != "xl/worksheets/sheet2.xml" or b'ref="A1:C5"' in content
    np.testing.assert_array_equal(read(patched, "t", sheet="Run1").columns["t"], [0, 0.5, 1])


@pytest.mark.parametrize(
    ("columns", "request_", "parts"),
    [
        (
            ("t",),
            {"sheet": "Run 1"},
            ["a.xlsx: there is no sheet 'Run 1'", "Did you mean 'Run1'?", "About, Run1"],
        ),
        (("force",), {"sheet": "Run1"}, ["no column 'force'", "t, F, note"]),
        ((3,), {"sheet": "Run1"}, ["no column 3", "0 to 2"]),
        (("note",), {"sheet": "Run1"}, ["a.xlsx:Run1:row 2, column note: 'a' is not a number"]),
        (
            (0,),
            {"sheet": "Run1", "header": 0},
            ["a.xlsx:Run1:row 1, column 0: 't' is not a number"],
        ),
        (("t",), {"sheet": "Run1", "skip_rows": 9}, ["a.xlsx:Run1: the sheet is empty"]),
        (("Rig",), {}, ["a.xlsx:About: the sheet has a header but no data"]),
    ],
)
def test_what_a_workbook_lacks(book, columns, request_, parts):
    refusal(parts, "xlsx", book, *columns, **request_)


def test_sheet_with_broken_bytes_inside_is_noticed(book, tmp_path):
    whole = bytearray(book.read_bytes())
    place = whole.find(b"xl/worksheets/sheet2.xml") + 30
    whole[place : place + 40] = bytes(40)
    broken = tmp_path / "broken.xlsx"
    broken.write_bytes(whole)
    with pytest.raises(DataError, match=r"a\.xlsx: the file is damaged") as told:
        read(broken, "t", sheet="Run1")
    assert "memory" not in told.value.message  # the reading process says what is wrong


def test_bombs_are_not_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr("mapmore_cli.storage.tables.BOMB_SIZE", 1_000_000)
    bomb = tmp_path / "bomb.xlsx"
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/sharedStrings.xml", b" " * 5_000_000)
    with pytest.raises(DataError, match=r"sharedStrings\.xml unpacks from 0\.0\d+ MB to 5 MB"):
        read(bomb, 0)


def test_a_large_workbook_may_take_more_memory_and_time(tmp_path, monkeypatch):
    given = []

    def run(line, **_):
        given.append([int(number) for number in line[-2:]])
        return subprocess.CompletedProcess(line, 0, b"[]")

    monkeypatch.setattr(xlsx.subprocess, "run", run)
    for size in (1, 3_000_000):
        (tmp_path / "a.xls").write_bytes(bytes(size))
        xlsx._sheets_in(tmp_path / "a.xls", "a.xls")
    assert given == [[10**9 + 200, 10], [10**9 + 200 * 3_000_000, 13]]


def test_of_empty_sheets_only_the_first_is_shown(tmp_path, monkeypatch):
    filled = {"a": [], "b": [["t"], [1]], "c": [], "d": [["F"], [2]]}
    sheets = [xlsx.SheetCells(title, True, rows, [], []) for title, rows in filled.items()]
    monkeypatch.setattr(xlsx, "_sheets_in", lambda *_: sheets)
    tops = [(top.sheet, top.settings) for top in xlsx.peek_xlsx(tmp_path / "a.xlsx", 9)]
    assert tops == [("a", {}), ("b", {"sheet": "b"}), ("d", {"sheet": "d"})]


def test_tables_in_a_sheet_begin_at_its_first_row(tmp_path, monkeypatch):
    sheet = xlsx.SheetCells("a", True, [["t", "F"], [1, 2], [3, 4]], [], [])
    monkeypatch.setattr(xlsx, "_sheets_in", lambda *_: [sheet])
    (table,) = xlsx.below_xlsx(tmp_path / "a.xlsx", TableRequest("a", ()))
    assert (table.begin, table.header) == (1, [(1, ["t", "F"])])


def test_a_single_text_says_nothing_about_the_decimal_mark_of_a_sheet():
    """Because a title can look like a number."""
    for texts, mark in ((["1,5"], None), (["1,5", "2,25"], ","), (["1,5", "2.5", "3.5"], ".")):
        assert xlsx._decimal_in_texts([["t", 0.5], texts]) == mark


def test_a_column_with_a_cell_in_per_cent_is_a_ratio():
    for cells, units in (((xlsx.Percentage(0.5), 2.0), ("1", "")), ((0.5, 2.0), ())):
        sheet = xlsx.SheetCells("a", True, [["x", "F"], [*cells]], [], [])
        assert xlsx._ratios_in(sheet) == units
