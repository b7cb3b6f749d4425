"""What workbooks say of cells besides values: formats, letters of columns, marks, hidden rows."""

from contextlib import nullcontext
from datetime import date, datetime, time
from struct import pack
from types import SimpleNamespace
from zipfile import ZipFile

import pytest
from reading import workbook, xlsb_record

from mapmore_cli.storage.workbooks import __main__ as program
from mapmore_cli.storage.workbooks import binary, markup, xlsb
from mapmore_cli.storage.workbooks.__main__ import _hidden, _mark, _plain
from mapmore_cli.storage.workbooks.facts import (
    ERRORS,
    MOST,
    NEVER_COMPUTED,
    PERCENT,
    PERCENT_BUILT_IN,
    hidden_columns,
    hidden_rows,
    is_percent,
    letters,
    never_computed,
    number_of_letters,
)


def test_letters_of_columns():
    names = {0: "A", 25: "Z", 26: "AA", 51: "AZ", 52: "BA", 701: "ZZ", 702: "AAA"}
    for number, name in names.items():
        assert (letters(number), number_of_letters(name)) == (name, number)


def test_formats_that_show_per_cent():
    shown = ("0%", "0.00 %", '0"a"%', "[Red]0%", '0\\"%')
    plain = ('0"%"', "0\\%", "[%]0", "General", '0"a%b"')
    assert [*map(is_percent, (*shown, *plain))] == [True] * 5 + [False] * 5
    assert ({9, 10}, 1_048_576) == (PERCENT_BUILT_IN, MOST)


def test_errors_by_their_numbers():
    """[MS-XLS] 2.5.10."""
    assert {*ERRORS.items()} == {
        *((0, "#NULL!"), (7, "#DIV/0!"), (15, "#VALUE!"), (23, "#REF!")),
        *((29, "#NAME?"), (36, "#NUM!"), (42, "#N/A")),
    }


def test_empty_texts_of_formulas_are_values_where_another_formula_has_one():
    assert [*never_computed([(2, 3)], computed=True)] == []
    assert [*never_computed([(2, 3)], computed=False)] == [(2, 3, 2, 3, NEVER_COMPUTED)]


def test_marks_replace_the_cells_that_they_are_about():
    cells = [[1.0, "a", ""], [0.5, "", 2]]
    facts = [(0, 0, 0, 0, NEVER_COMPUTED), (0, 1, 1, 2, ""), (1, 0, 9, 9, PERCENT)]
    _mark(cells, [*facts, (0, 1, 0, 1, "#N/A")])
    merged = {"lacks": "B1:C2"}
    assert cells == [[{"lacks": ""}, "#N/A", merged], [{"percent": 0.5}, merged, {"percent": 2}]]
    cells = [[0]]
    _mark(cells, [(0, 0, 0, 0, str(number)) for number in range(9)])
    assert cells == [["3"]]  # four marks for each cell are enough


def test_a_sheet_may_span_as_many_cells_as_the_file_has_bytes_for(tmp_path, monkeypatch):
    workbook(tmp_path / "a.xlsx", a=[[1, 2, 3], [4, 5, 6]])
    size = (tmp_path / "a.xlsx").stat().st_size
    assert (program.MOST_CELLS, program.CELLS_OF_BYTE) == (100_000, 50)
    for free, each, fits in ((2, 4 / size, True), (2, 3 / size, False), (6, 0, True)):
        monkeypatch.setattr(program, "MOST_CELLS", free)
        monkeypatch.setattr(program, "CELLS_OF_BYTE", each)
        with nullcontext() if fits else pytest.raises(SystemExit):
            ((title, is_visible, cells, *_),) = program.sheets_of(tmp_path / "a.xlsx", 0)
            assert (title, is_visible, cells) == ("a", True, [[1, 2, 3], [4, 5, 6]])


def test_rows_at_the_end_that_hold_formulas_only_belong_to_the_sheet(tmp_path, monkeypatch):
    """The library leaves out rows at the end that have no value."""
    workbook(tmp_path / "a.xlsx", a=[[1, "x"], ["=A1"], ["=A2"]])
    lacking = [{"lacks": ""}, ""]
    for most, rows in ((0, 3), (3, 3), (2, 2), (1, 1)):
        ((_, _, cells, *_),) = program.sheets_of(tmp_path / "a.xlsx", most)
        assert cells == [[1, "x"], lacking, lacking][:rows]
    monkeypatch.setattr(program, "CELLS_OF_BYTE", 0)
    for room, rows in ((6, 3), (5, 1)):
        monkeypatch.setattr(program, "MOST_CELLS", room)
        ((_, _, cells, *_),) = program.sheets_of(tmp_path / "a.xlsx", 0)
        assert len(cells) == rows


def test_merged_cells_are_marked_except_for_the_first(tmp_path):
    book = workbook(tmp_path / "a.xlsx", a=[[7], [None], [8]])
    book["a"].merge_cells("A1:A2")
    book.save(tmp_path / "a.xlsx")
    ((_, _, cells, *_),) = program.sheets_of(tmp_path / "a.xlsx", 0)
    assert cells == [[7], [{"lacks": "A1:A2"}], [8]]


def test_cells_are_counted_from_the_corner_of_the_sheet(tmp_path):
    workbook(tmp_path / "a.xlsx", a=[[], [None, 7]])
    ((_, _, cells, *_),) = program.sheets_of(tmp_path / "a.xlsx", 0)
    assert cells == [["", ""], ["", 7]]


def test_a_sheet_may_use_one_of_several_formats_in_per_cent(tmp_path):
    book = workbook(tmp_path / "a.xlsx", a=[[0.2]], b=[[0.3]])
    book["a"]["A1"].number_format, book["b"]["A1"].number_format = "0%", "0.00%"
    book.save(tmp_path / "a.xlsx")
    with ZipFile(tmp_path / "a.xlsx") as archive:
        for title in "ab":
            assert [*markup.facts_of(archive, title)] == [(0, 0, 0, 0, PERCENT)]


NO_SECTOR = 0xFFFFFFFF


def compound(stream, listed_apart):
    """Return a file of sectors of 512 bytes with this stream ([MS-CFB]). A stream of fewer than
    4096 bytes stands in sectors of 64 bytes of another stream. The sector of the table is listed in
    the header, or apart from it in a sector of its own.
    """
    is_small = len(stream) < 4096
    content = stream + bytes(-len(stream) % 512)
    count = len(content) // 512

    def chain(first, length):
        return [*range(first + 1, first + length), NO_SECTOR - 1]

    # the sectors: list of tables, table, directory, small table, and the contents
    table = [NO_SECTOR - 3, NO_SECTOR - 2, *chain(2, 1), *chain(3, 1), *chain(4, count)]
    small = chain(0, -(-len(stream) // 64)) if is_small else []

    def sector(numbers):
        return pack("<128I", *numbers, *[NO_SECTOR] * (128 - len(numbers)))

    def entry(name, start, length):
        text = (name + "\0").encode("utf-16-le")
        return text.ljust(64, b"\0") + pack("<H50x2I4x", len(text), start, length)

    entries = [entry("Root Entry", 4, len(content)), entry("A", 0, 0)]
    entries.append(entry("Workbook", 0 if is_small else 4, len(stream)))
    tables = [NO_SECTOR] * 109 if listed_apart else [1, *[NO_SECTOR] * 108]
    apart = 0 if listed_apart else NO_SECTOR - 1
    head = binary.BEGINS.ljust(30, b"\0") + pack("<2H14x", 9, 6)
    head += pack("<6I", 2, 0, 4096, 3, 1, apart) + pack("<I", 1) + pack("<109I", *tables)
    more = sector([1, *[NO_SECTOR] * 126, NO_SECTOR - 1])
    directory = b"".join(entries).ljust(512, b"\0")
    return b"".join([head, more, sector(table), directory, sector(small), content])


@pytest.mark.parametrize("size", [1, 64, 4095, 4096, 9000, 60_000])
def test_the_stream_of_an_old_workbook_is_a_chain_of_sectors(size):
    stream = bytes(place * place % 251 for place in range(size))
    # only a long file has so many tables that they are listed apart from the header
    for listed_apart in (False, True) if size == 60_000 else (False,):
        assert binary._stream(compound(stream, listed_apart)) == stream


def test_hidden_rows_and_columns_end_with_the_cells():
    facts = [hidden_rows(1, 2), hidden_rows(2, 9), hidden_columns(1, 9), (0, 0, 0, 0, PERCENT)]
    assert [*map(set, _hidden(facts, [["a", "b", "c"]] * 4))] == [{1, 2, 3}, {1, 2}]
    assert _hidden([hidden_rows(0, 0), hidden_columns(0, 0)], [["a", "b"]] * 2) == ([0], [0])
    assert _hidden(facts, []) == ([], [])
    assert (hidden_rows(1, 2)[:4], hidden_columns(1, 2)[:4]) == ((1, 0, 2, MOST), (0, 1, MOST, 2))


@pytest.mark.parametrize(
    ("cell", "plain"),
    [
        (date(2026, 3, 1), datetime(2026, 3, 1)),
        (datetime(2026, 3, 1, 12), datetime(2026, 3, 1, 12)),
        *((time(12), time(12)), (2026.0, 2026), (0.5, 0.5), ("1.0", "1.0"), (True, True)),
    ],
)
def test_dates_are_midnights_and_whole_numbers_have_no_decimals(cell, plain):
    assert repr(_plain(cell)) == repr(plain)


def record(kind, content=b""):
    return pack("<2H", kind, len(content)) + content


def test_records_of_a_substream_end_with_it():
    """Beginnings and ends pair like brackets; a length of zero bytes is one of a record, too."""
    stream = b"".join(map(record, (0x809, 0x809, 0x0A, 0x85, 0x0A, 0x85)))
    assert [kind for kind, _ in binary._records(stream, 0)] == [0x809, 0x809, 0x0A, 0x85, 0x0A]
    assert [kind for kind, _ in binary._records(stream, 4)] == [0x809, 0x0A]
    assert [*binary._records(record(0x809) + record(0x85, b"ab"), 0)][1] == (0x85, b"ab")
    assert [*binary._records(record(0x809) + record(0x85), 0)][1:] == [(0x85, b"")]


def test_titles_of_sheets_have_letters_of_one_or_two_bytes():
    for is_wide, encoding in ((1, "utf-16-le"), (0, "latin-1")):
        content = bytes(6) + bytes([2, is_wide]) + "äb".encode(encoding) + b"more"
        assert binary._title(content) == "äb"


def stream_of(settings, sheets):
    """Return the stream of a workbook: its settings, where its sheets begin, and the sheets."""
    whole, begin = b"", len(settings) + 13 * len(sheets) + 4
    for title, records in sheets.items():
        named = pack("<I2x2B", begin + len(whole), 1, 0) + title.encode()
        settings += record(0x85, named)
        whole += record(0x809) + records + record(0x0A)
    return settings + record(0x0A) + whole


def cell(kind, *numbers, value=b""):
    """Return a record that begins with numbers of two bytes, such as row, column and style."""
    return record(kind, pack(f"<{len(numbers)}H", *numbers) + value)


def row(number, flags):
    return cell(0x208, number, *[0] * 5, flags, 0)


def formula(row, column, *value):
    """Return a formula with no number but a text, an error or nothing, by the kind of its value."""
    return cell(6, row, column, 0, value=bytes([*value, *[0] * (6 - len(value)), 255, 255, 0, 0]))


def test_facts_of_the_records_of_an_old_sheet():
    """A style is the number of the record in which it names its format."""
    styles = b"".join(cell(0xE0, 0, number) for number in (0, 10, 200, 201))
    formats = cell(0x41E, 200, value=b"\1\0\0%") + cell(0x41E, 201, value=b"\3\0\0000.0%")
    own = [
        *(row(4, 0x20), row(5, 0x10), cell(0x7D, 2, 3, 0, 0, 1), cell(0x7D, 5, 6, 0, 0, 2)),
        *(cell(0x203, 1, 2, 1, value=bytes(8)), cell(0x203, 1, 3, 3, value=bytes(8))),
        cell(0xBD, 2, 0, *(0, 0, 0), *(2, 0, 0), 1),
        cell(0xBD, 5, 0, *[0] * 15, *(2, 0, 0), 5),
        *(cell(0x205, 3, 1, 0, value=b"\7\1"), cell(0x205, 3, 2, 0, value=b"\1\0")),
        *(formula(6, 1, 3), formula(6, 2, 2, 0, 36)),
    ]
    sheets = {"a": row(7, 0x20), "b": b"".join(own), "c": b"".join([*own, formula(8, 1)])}
    stream = stream_of(record(0x809) + styles + formats, sheets)
    facts = [
        *(
            hidden_rows(4, 4),
            hidden_columns(2, 3),
            (1, 2, 1, 2, PERCENT),
            (2, 1, 2, 1, PERCENT),
            (5, 5, 5, 5, PERCENT),
        ),
        *((3, 1, 3, 1, "#DIV/0!"), (6, 2, 6, 2, "#NUM!"), (6, 1, 6, 1, NEVER_COMPUTED)),
    ]
    assert [*binary._facts_of_records(stream, "a")] == [hidden_rows(7, 7)]
    assert binary.facts_of(compound(stream, listed_apart=False), "b") == facts
    assert binary.facts_of(b"no workbook", "b") == []
    assert [*binary._facts_of_records(stream, "c")] == facts[:-1]


def test_lengths_of_records_have_seven_bits_in_a_byte():
    """[MS-XLSB] 2.1.4: a kind has one or two bytes, a length one to four."""
    content = bytes([5, 1, 9]) + bytes([0x9C, 0x01, 0x82, 0x01]) + b"x" * 130
    assert [*xlsb._records(content)] == [(5, b"\x09"), (0x9C, b"x" * 130)]
    assert xlsb._length(bytes([0xFF, 0xFF, 0xFF, 0x7F, 0x01]), 0) == ((1 << 28) - 1, 4)
    assert xlsb._text(b"??" + pack("<I", 2) + "äb".encode("utf-16-le") + b"!", 2) == ("äb", 10)


def test_a_sheet_of_a_binary_workbook_is_found_by_its_title():
    def text(word):
        return pack("<I", len(word)) + word.encode("utf-16-le")

    names = (("rId1", "a"), ("rId2", "b"))
    sheets = [xlsb_record(156, 0, 1, value=text(key) + text(title)) for key, title in names]
    book = xlsb_record(143) + b"".join(sheets)
    assert [xlsb._key_of_sheet(book, title) for title in "ab"] == ["rId1", "rId2"]
    with pytest.raises(ValueError, match="there is no sheet 'c'"):
        xlsb._key_of_sheet(book, "c")


def test_facts_of_the_records_of_a_binary_sheet(monkeypatch):
    monkeypatch.setattr(xlsb, "_key_of_sheet", lambda *_: "")
    monkeypatch.setattr(xlsb, "part_of_sheet", lambda *_: "sheet")
    formats = xlsb_record(44, value=pack("<HI", 164, 2) + "0%".encode("utf-16-le"))
    # only the styles between 617 and 618 are those of cells
    styles = [xlsb_record(47, value=pack("<2H", 0, number)) for number in (10, 0, 164, 10)]
    styles = styles[0] + xlsb_record(617) + styles[1] + styles[2] + xlsb_record(618) + styles[3]
    own = [
        *(xlsb_record(60, 1, 2, 0, 0, value=b"\1\0"), xlsb_record(60, 4, 5, 0, 0, value=b"\2\0")),
        *(
            xlsb_record(0, 3, 1, 0),
            xlsb_record(0, 4, 0, value=bytes(3)),
            xlsb_record(0, 5, 0, value=bytes([0, 0, 0, 1])),
            xlsb_record(0, 7, 0, value=bytes([0, 0, 0, 16])),
        ),
        *(
            xlsb_record(5, 2, 1, 0, 0),
            xlsb_record(5, 3, 2, 0, 0),
            xlsb_record(3, 4, 0, value=b"\x2a"),
        ),
        *(
            xlsb_record(11, 5, 0, value=b"\0"),
            xlsb_record(8, 6, 0, 0),
            xlsb_record(176, 1, 3, 0, 2),
        ),
    ]
    parts = {"xl/styles.bin": formats + styles, "xl/workbook.bin": b""}

    def facts(*more):
        parts["sheet"] = b"".join([*own, *more])
        archive = SimpleNamespace(read=parts.get, namelist=lambda: [*parts])
        return [*xlsb.facts_of(archive, "a")]

    found = [
        *(hidden_columns(1, 2), hidden_rows(7, 7), (7, 2, 7, 2, PERCENT), (7, 4, 7, 4, "#N/A")),
        *((7, 5, 7, 5, "#NULL!"), (1, 0, 3, 2, ""), (7, 6, 7, 6, NEVER_COMPUTED)),
    ]
    assert facts() == found
    for computed in (
        xlsb_record(8, 1, 0, 1),
        xlsb_record(9, 1, 0, 0, 0),
        xlsb_record(10, 1, 0, value=b"\1"),
    ):
        assert facts(computed) == found[:-1]


SHEET = """<worksheet xmlns="urn:x">
<cols><col min="2" max="3" hidden="1"/><col min="5" max="5"/></cols>
<row r="3" hidden="true"><c r="A3" s="2"><v>1</v></c><c r="B3" t="e"><v>#N/A</v></c></row>
<row hidden="1"><c r="AA4"><f>1</f></c><c r="B4" t="str"><f>1</f><v></v></c>
<c r="C4" t="str"><f>1</f></c></row>
<row r="9" ht="0"><c r="D9" s="3"><f>1</f><v>2</v></c></row></worksheet>"""


def test_facts_of_a_sheet_of_xml():
    assert [*markup._facts_of_xlsx(SHEET.encode(), {"2"})] == [
        *(hidden_columns(1, 2), (2, 0, 2, 0, PERCENT), (2, 1, 2, 1, "#N/A"), hidden_rows(2, 2)),
        *((3, 26, 3, 26, NEVER_COMPUTED), (3, 2, 3, 2, NEVER_COMPUTED)),
        *(hidden_rows(3, 3), hidden_rows(8, 8)),
    ]


TABLES = """<d xmlns:t="urn:t" xmlns:o="urn:o">
<t:table t:name="x"><t:table-row t:visibility="filter"/>
</t:table><t:table t:name="a"><t:table-column/><t:table-column t:number-columns-repeated="2"/>
<t:table-column t:visibility="collapse" t:number-columns-repeated="3"/>
<t:table-row t:number-rows-repeated="2"><t:table-cell t:number-columns-repeated="2"/>
<t:table-cell o:value-type="percentage" t:number-columns-repeated="2"><p>20 %</p></t:table-cell>
<t:table-cell o:value-type="float"><p>#REF!</p></t:table-cell>
<t:table-cell t:formula="1"/></t:table-row>
<t:table-row t:visibility="filter" t:number-rows-repeated="4"/>
<t:table-row><t:table-cell t:number-rows-spanned="3" t:number-columns-spanned="2"/>
<t:table-cell t:number-rows-spanned="2"/><t:table-cell t:number-columns-spanned="2"/>
<t:table-cell o:value-type="error"/></t:table-row></t:table></d>"""


def test_facts_of_a_sheet_of_an_open_document():
    archive = SimpleNamespace(namelist=lambda: ["content.xml"], read=lambda _: TABLES.encode())
    assert [*markup.facts_of(archive, "a")] == [
        *(hidden_columns(3, 5), (0, 2, 1, 3, PERCENT), (0, 4, 1, 4, "#REF!")),
        *(
            (0, 5, 1, 5, NEVER_COMPUTED),
            hidden_rows(2, 5),
            *((6, 0, 8, 1, ""), (6, 1, 7, 1, ""), (6, 2, 6, 3, "")),
            (6, 3, 6, 3, "#VALUE!"),
        ),
    ]
