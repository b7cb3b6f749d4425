"""Readers x faults: what one reader says of a fault of its file, every reader says, or the fault
cannot occur in its files.
"""

import io
import json
import struct
import sys
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
from reading import ODS, other_workbook, refused, workbook, xlsb_record
from test_lvm_reader import FIRST, HEAD

from mapmore_cli.ingestion.clock import in_time_order
from mapmore_cli.ingestion.samples import Samples
from mapmore_cli.storage.readers import READERS, TableRequest, csv, lvm
from mapmore_cli.storage.tables.gate import gated

pa = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")
nptdms = pytest.importorskip("nptdms")
PLUGIN = Path(__file__).resolve().parents[3] / "docs/examples/plugin"

N = 14
T, F = [f"{i / 10:.1f}" for i in range(N)], [f"{1.25 * i:.3f}" for i in range(N)]
BACK = [*T[:-1], "-0.5"]
LARGE = ["950", "980", "1.010", *(f"{1 + 0.013 * i:.3f}" for i in range(3, N))]
TEXTS, BOOKS = ("csv", "lvm", "json_lines"), ("xlsx", "xlsb", "xls", "ods")

TWICE, BACKWARDS = "occurs 2 times", "time runs backwards"
OPEN, HALF = "the last line has no line break at its end", "not JSON"
DAMAGED, BREAKS = "the file is damaged", "the last segment is incomplete"
NEVER, FAILED, MERGED = "was never computed", "a formula failed there", "one of the merged cells"
NO_FORMULAS = "cannot occur: the format has no formulas"
NUMBERS = "cannot occur: an array of numbers holds numbers alone"
NO_CELLS = "cannot occur: the format has no cells to merge"
TABLE = {
    #            names twice  clock back  cut at the end  never computed  error cell  merged cells
    "csv": (TWICE, BACKWARDS, OPEN, NO_FORMULAS, FAILED, NO_CELLS),
    "lvm": (TWICE, BACKWARDS, OPEN, NO_FORMULAS, FAILED, NO_CELLS),
    "json_lines": (TWICE, BACKWARDS, HALF, NO_FORMULAS, FAILED, NO_CELLS),
    "xlsx": (TWICE, BACKWARDS, DAMAGED, NEVER, FAILED, MERGED),
    "xlsb": (TWICE, BACKWARDS, DAMAGED, NEVER, FAILED, MERGED),
    "xls": (TWICE, BACKWARDS, DAMAGED, NEVER, FAILED, MERGED),
    "ods": (TWICE, BACKWARDS, DAMAGED, NEVER, FAILED, MERGED),
    "mat": (TWICE, BACKWARDS, DAMAGED, NO_FORMULAS, NUMBERS, NO_CELLS),
    "4.mat": (TWICE, BACKWARDS, DAMAGED, NO_FORMULAS, NUMBERS, NO_CELLS),
    "npz": (TWICE, BACKWARDS, DAMAGED, NO_FORMULAS, NUMBERS, NO_CELLS),
    "parquet": (TWICE, BACKWARDS, DAMAGED, NO_FORMULAS, NUMBERS, NO_CELLS),
    "tdms": (TWICE, BACKWARDS, BREAKS, NO_FORMULAS, NUMBERS, NO_CELLS),
    "hdf5": (
        "cannot occur: members of a group have names of their own",
        BACKWARDS,
        DAMAGED,
        NO_FORMULAS,
        NUMBERS,
        NO_CELLS,
    ),
}
PADDED, GROUPED = "characters of padding", "may be 1010: the column has whole numbers up to 980"
PERCENT, HIDDEN, UNWRITTEN = "is shown in per cent", "1 hidden row is read", "never written"
TEXT_NUMBERS = "cannot occur: the format has no texts of numbers"
MORE = {  # what is told of a fault by these, and why it cannot occur in other files
    "padded": (dict.fromkeys(("csv", "lvm"), PADDED) | {"json_lines": HALF}, NO_FORMULAS),
    "thousands": (dict.fromkeys((*TEXTS, *BOOKS, "npz"), GROUPED), TEXT_NUMBERS),
    "percent": (dict.fromkeys(BOOKS, PERCENT), "cannot occur: numbers are stored as they are"),
    "hidden": (dict.fromkeys(BOOKS, HIDDEN), "cannot occur: nothing can be hidden"),
    "unwritten": ({"hdf5": UNWRITTEN}, "cannot occur: there is no room without values"),
}
TABLE = {
    kind: (*row, *(told.get(kind, why) for told, why in MORE.values()))
    for kind, row in TABLE.items()
}
DOUBTS = (PADDED, PERCENT, HIDDEN)
FAULTS = ("twice", "back", "cut", "never", "error", "merged", *MORE)
CELLS = [
    pytest.param(kind, fault, told, id=f"{kind}-{fault}")
    for kind, row in TABLE.items()
    for fault, told in zip(FAULTS, row, strict=True)
    if not told.startswith("cannot occur: ")
]


def reader_called(kind):
    if kind == "json_lines":
        sys.path.insert(0, str(PLUGIN))
        from mapmore_template.reader import READER

        sys.path.remove(str(PLUGIN))
        return gated(READER, ())
    return READERS["xlsx" if kind in BOOKS else kind.removeprefix("4.")]


def content_of(kind, columns):
    """The bytes of a text or a tree with columns of such titles and cells, equal titles and all."""
    rows, titles = (
        [*zip(*(cells for _, cells in columns), strict=True)],
        [one for one, _ in columns],
    )
    stream, arrays = io.BytesIO(), []
    if kind not in TEXTS:
        arrays = [(one, np.array(cells, dtype=float)) for one, cells in columns]
    match kind:
        case "csv":
            return "".join(",".join(row) + "\n" for row in [titles, *rows]).encode()
        case "lvm":
            lines = [*HEAD.splitlines(), "", "Channels\t1", "***End_of_Header***"]
            lines += ["\t".join(row) for row in [titles, *rows]]
            return "".join(line + "\n" for line in lines).encode()
        case "json_lines":
            lines = (zip(titles, map(number_or_text, row), strict=True) for row in rows)
            pairs = (
                ", ".join(f"{json.dumps(a)}: {json.dumps(b)}" for a, b in row) for row in lines
            )
            return "".join(f"{{{line}}}\n" for line in pairs).encode()
        case "npz":
            with zipfile.ZipFile(stream, "w") as archive:
                for title, array in arrays:
                    part = io.BytesIO()
                    np.save(part, array)
                    archive.writestr(f"{title}.npy", part.getvalue())
        case "parquet":
            names = [title for title, _ in arrays]
            table = pa.Table.from_arrays([pa.array(array) for _, array in arrays], names)
            parquet.write_table(table, stream)
        case "hdf5":
            with h5py.File(stream, "w") as file:
                for title, array in arrays:
                    file.create_dataset(title, data=array, chunks=(5,))
        case "tdms":
            with nptdms.TdmsWriter(stream) as writer:
                channels = [
                    (f"{i}/F" if i > 1 else title, a) for i, (title, a) in enumerate(arrays)
                ]
                groups = [("g/2", "F") if "/" in one else ("g", one) for one, _ in channels]
                twice = len(arrays) > 2
                writer.write_segment(
                    [
                        nptdms.ChannelObject(*("g", "2/F") if twice and i == 1 else name, array)
                        for i, (name, (_, array)) in enumerate(zip(groups, channels, strict=True))
                    ]
                )
        case _:
            parts = [io.BytesIO() for _ in arrays]
            for part, (title, array) in zip(parts, arrays, strict=True):
                scipy.io.savemat(part, {title: array}, format="4" if kind == "4.mat" else "5")
            begin = 0 if kind == "4.mat" else 128
            wholes = [part.getvalue() for part in parts]
            return wholes[0] + b"".join(whole[begin:] for whole in wholes[1:])
    return stream.getvalue()


def number_or_text(cell):
    return cell if cell.startswith("#") or cell in LARGE[2:] else float(cell)


def unwritten(path):
    """Room in an HDF5 file for three chunks, of which the second was never written."""
    with h5py.File(path, "w") as file:
        for title, cells in (("t", T), ("F", F)):
            array = file.create_dataset(title, (N,), chunks=(5,), dtype="f8")
            array[:5], array[10:] = cells[:5], cells[10:]


def book_with(kind, path, columns, fault):
    """A workbook; in the last row but two something is wrong with the cell of F."""
    rows = [*zip(*(map(number_or_text, cells) for _, cells in columns), strict=True)]
    rows = [[title for title, _ in columns], *map(list, rows)]
    if kind == "xlsx":
        rows[N - 2][1] = {"never": "=A2*2", "error": "#DIV/0!"}.get(fault, rows[N - 2][1])
        book = workbook(path, a=rows)
        if fault == "merged":
            book["a"].merge_cells(f"B{N - 3}:B{N - 1}")
        book["a"].row_dimensions[N - 1].hidden = fault == "hidden"
        book["a"][f"B{N - 1}"].number_format = "0.0%" if fault == "percent" else "General"
        book.save(path)
    elif kind == "xlsb":
        write_xlsb(path, rows, fault)
    elif kind == "xls":
        book = pytest.importorskip("xlwt").Workbook()
        sheet = book.add_sheet("a", cell_overwrite_ok=True)
        for row, cells in enumerate(rows):
            for place, cell in enumerate(cells):
                if (row, place) != (N - 2, 1) or fault not in ("error", "never", "merged"):
                    sheet.write(row, place, cell)
        if fault == "error":
            sheet.row(N - 2).set_cell_error(1, "#DIV/0!")
        elif fault == "never":
            sheet.write(N - 2, 1, pytest.importorskip("xlwt").Formula("A2*2"))
        elif fault == "merged":
            sheet.merge(N - 3, N - 2, 1, 1)
        elif fault == "percent":
            style = pytest.importorskip("xlwt").easyxf(num_format_str="0.0%")
            sheet.write(N - 2, 1, rows[N - 2][1], style)
        sheet.row(N - 2).hidden = fault == "hidden"
        book.save(str(path))
    else:
        other_workbook(path, rows)
        cell = f'office:value="{rows[N - 2][1]}"><text:p>{rows[N - 2][1]}</text:p>'
        above = f'<table:table-cell office:value-type="float" office:value="{rows[N - 3][1]}"'
        old = f'<table:table-cell office:value-type="float" {cell}</table:table-cell>'
        new = {
            "never": '<table:table-cell table:formula="of:=[.A2]*2"/>',
            # as LibreOffice stores it for programs that know no errors
            "error": '<table:table-cell table:formula="of:=1/0" office:value-type="float" '
            'office:value="0"><text:p>#DIV/0!</text:p></table:table-cell>',
            "merged": "<table:covered-table-cell/>",
            "percent": old.replace('"float"', '"percentage"'),
        }.get(fault, old)
        with zipfile.ZipFile(path) as archive:
            text = archive.read("content.xml").decode()
        assert old in text or fault == "thousands"
        text = text.replace(old, new)
        if fault == "hidden":
            row = text[: text.index(old)].rindex("<table:table-row>")
            text = f'{text[:row]}<table:table-row table:visibility="filter"{text[row + 16 :]}'
        if fault == "merged":
            text = text.replace(above, f'{above} table:number-rows-spanned="2"')
        rewrite_ods(path, text)


def write_xlsb(path, rows, fault):
    """A workbook of the sheet `a` in records, as Excel saves it."""
    hides = 16 * (fault == "hidden")
    cells = b"".join(
        xlsb_record(0, number, 0, value=bytes([0, 0, 0, hides * (number == N - 2), 0, 0, 0, 0, 0]))
        + b"".join(map(xlsb_cell, range(len(row)), row))
        for number, row in enumerate(rows)
    )
    right = xlsb_cell(1, rows[N - 2][1])
    value = {
        "error": xlsb_record(3, 1, 0, value=b"\7"),
        "never": xlsb_record(8, 1, 0, 0, 0, 0, value=bytes(2)),
        "merged": xlsb_record(1, 1, 0),
        "percent": xlsb_record(5, 1, 1, value=struct.pack("<d", float(rows[N - 2][1]))),
    }.get(fault, right)
    assert cells.count(right) == 1
    merged = xlsb_record(176, N - 3, N - 2, 1, 1) if fault == "merged" else b""
    extent = xlsb_record(148, 0, len(rows) - 1, 0, len(rows[0]) - 1)
    lines = xlsb_record(145) + cells.replace(right, value) + xlsb_record(146)
    sheet = xlsb_record(129) + extent + lines + merged
    name = xlsb_record(156, 0, 1, value=xlsb_text("rId1") + xlsb_text("a"))
    with zipfile.ZipFile(path, "w") as archive:
        book = xlsb_record(131) + xlsb_record(143) + name + xlsb_record(144) + xlsb_record(132)
        archive.writestr("xl/workbook.bin", book)
        archive.writestr("xl/worksheets/sheet1.bin", sheet + xlsb_record(130))
        layout = xlsb_record(44, value=struct.pack("<H", 164) + xlsb_text("0.0%"))
        layout = xlsb_record(615, 1) + layout + xlsb_record(616)
        styles = b"".join(
            xlsb_record(47, value=struct.pack("<HH12x", 0, number)) for number in (0, 164)
        )
        styles = xlsb_record(617, 2) + styles + xlsb_record(618)
        archive.writestr("xl/styles.bin", layout + styles)
        archive.writestr(
            "xl/_rels/workbook.bin.rels",
            '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
            '<Relationship Id="rId1" Type="http://schemas.openxmlformats.org/officeDocument/2006/'
            'relationships/worksheet" Target="worksheets/sheet1.bin"/></Relationships>',
        )


def xlsb_text(text):
    return struct.pack("<I", len(text)) + text.encode("utf-16-le")


def xlsb_cell(column, cell):
    if isinstance(cell, str):
        return xlsb_record(6, column, 0, value=xlsb_text(cell))
    return xlsb_record(5, column, 0, value=struct.pack("<d", cell))


def rewrite_ods(path, text):
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        archive.writestr("META-INF/manifest.xml", "<manifest/>")
        archive.writestr("content.xml", text)


def file_with(kind, fault, path):
    """Write a file with a fault; return how its columns are called."""
    titles = ["X_Value" if kind == "lvm" else "t", "F"]
    columns = [*zip(titles, (BACK if fault == "back" else T, F), strict=True)]
    if fault == "twice":
        # but for text, a title and the same one with a blank behind it
        columns.append(("F" if kind in ("4.mat", "mat", "tdms") else "F ", F))
    if fault == "thousands":
        columns[1] = ("F", LARGE)
    if fault == "error" and kind in TEXTS:
        columns[1] = ("F", [*F[:-3], "#DIV/0!", *F[-2:]])
    if kind in BOOKS:
        book_with(kind, path, columns, fault)
        whole = path.read_bytes()
    else:
        whole = content_of(kind, columns)
    if fault == "padded":
        whole += b"\0" * 5000 + b"\x1a"
    if fault == "thousands" and kind == "npz":
        stream = io.BytesIO()
        np.savez(stream, t=np.array(T, dtype=float), F=LARGE)
        whole = stream.getvalue()
    if fault == "cut":
        whole = whole[: -3 if kind in TEXTS else -60]
    path.write_bytes(whole)
    if fault == "unwritten":
        unwritten(path)
    if kind == "tdms":
        return ["g/t", "g/2/F" if fault == "twice" else "g/F"]
    return titles


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize(("kind", "fault", "told"), CELLS)
def test_what_one_reader_says_all_say(kind, fault, told, tmp_path):
    path, reader = tmp_path / f"a.{kind}", reader_called(kind)
    columns = tuple(file_with(kind, fault, path))
    if told in DOUBTS:
        (table,) = reader.read(path, TableRequest("a.log", columns))
        assert told in " ".join([*table.doubts, *(one.shown for one in table.noted.values())])
        assert table.size == N
        return
    with refused("a.log", told):
        (table,) = reader.read(path, TableRequest("a.log", columns))
        time = dict(zip(("time", "F"), table.columns.values(), strict=True))
        in_time_order(Samples(time, table.rows, table.label, table.place), "error", "s")
    if fault == "cut" and kind in ("csv", "lvm", "tdms"):  # where it is known what is whole
        (table,) = reader.read(path, TableRequest("a.log", columns, incomplete=True))
        assert told in " ".join(table.doubts)
        assert len(table.rows) <= N - (kind != "tdms")


def test_every_cell_of_the_table_is_filled():
    readers = {"xlsx" if kind in BOOKS else kind.removeprefix("4.") for kind in TABLE}
    assert readers == {*READERS, "json_lines"}
    assert {len(row) for row in TABLE.values()} == {len(FAULTS)}


@pytest.mark.parametrize("kind", TABLE)
def test_files_without_a_fault_are_read(kind, tmp_path):
    path, reader = tmp_path / f"a.{kind}", reader_called(kind)
    columns = tuple(file_with(kind, "", path))
    (table,) = reader.read(path, TableRequest("a.log", columns))
    np.testing.assert_array_equal(list(table.columns.values()), np.array([T, F], dtype=float))
    assert table.doubts == ()
    tops = list(reader.peek(path, 200))  # which every reader has
    assert any(len(top.rows) >= N for top in tops)


# Small files that declare more than they hold
# --------------------------------------------------------------------------------------------------


def npz_that_declares(path, kind, count):
    header = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': ({count},), }}".encode()
    header += b" " * (-(len(header) + 11) % 64) + b"\n"
    with zipfile.ZipFile(path, "w") as archive:
        size = len(header).to_bytes(2, "little")
        archive.writestr("F.npy", b"\x93NUMPY\x01\x00" + size + header)


@pytest.mark.parametrize("kind", ["<U0", "|S0", "|V0", "<f8"])
def test_arrays_of_nothing(kind, tmp_path):
    npz_that_declares(tmp_path / "a", kind, 10**9)
    with refused("declares more values than it holds"):
        READERS["npz"].read(tmp_path / "a", TableRequest("a", ("F",)))


def test_cells_that_are_far_away(tmp_path):
    book = workbook(tmp_path / "a.xlsx", a=[["t", "F"], *([i, i] for i in range(9))])
    book["a"]["XFD1048576"] = 1
    book.save(tmp_path / "a.xlsx")
    with refused("a"):
        READERS["xlsx"].read(tmp_path / "a.xlsx", TableRequest("a", ("F",)))
    book["a"]["XFD1048576"] = None
    book["a"]["A1048576"] = 1
    book.save(tmp_path / "a.xlsx")
    with refused("spans 1048576 rows and 2 columns", "delete the cells far away"):
        READERS["xlsx"].read(tmp_path / "a.xlsx", TableRequest("a", ("F",)))


@pytest.mark.parametrize("columns", [1, 16384])
def test_rows_that_are_repeated(columns, tmp_path):
    repeated = f'<table:table-row table:number-rows-repeated="{1 << 20}"><table:table-cell '
    repeated += f'table:number-columns-repeated="{columns}" office:value-type="float" '
    text = ODS.format(f'{repeated} office:value="1"/></table:table-row>')
    rewrite_ods(tmp_path / "a.ods", text)
    with refused("a"):
        READERS["xlsx"].read(tmp_path / "a.ods", TableRequest("a", (0,), header=0))


def test_pages_that_do_not_fit_their_checksum(tmp_path):
    table = pa.table({"F": np.arange(1000.0)})
    for told in (True, False):
        parquet.write_table(
            table,
            tmp_path / "a",
            write_page_checksum=told,
            compression="none",
            use_dictionary=False,
        )
        whole = bytearray((tmp_path / "a").read_bytes())
        whole[4000] ^= 1
        (tmp_path / "a").write_bytes(whole)
        if told:
            with refused("a: the file is damaged", "checksum"):
                READERS["parquet"].read(tmp_path / "a", TableRequest("a", ("F",)))
        else:
            assert READERS["parquet"].read(tmp_path / "a", TableRequest("a", ("F",)))


def test_the_date_of_a_header_is_read_once_and_not_for_every_row(tmp_path, monkeypatch):
    asked, path = [], tmp_path / "log.lvm"
    path.write_text(HEAD + FIRST + "0.3\t1\t2\n" * 500)
    read = lvm.stamp_of
    monkeypatch.setattr(lvm, "stamp_of", lambda text: asked.append(text) or read(text))
    (table,) = READERS["lvm"].read(path, TableRequest("log", ("F",)))
    assert len(table.rows) == 503
    assert len(asked) <= 3


def test_a_megabyte_of_blank_lines_is_counted_and_not_cut(tmp_path, monkeypatch):
    path = tmp_path / "log.csv"
    path.write_text("t,F\n" + "1,2\n" + f"{' ' * 60}\r\n\n" * 50_000 + "3,4\n", newline="")
    cut, records = [], csv._records
    monkeypatch.setattr(
        csv, "_records", lambda *how: (cut.append(one) or one for one in records(*how))
    )
    (table,) = READERS["csv"].read(path, TableRequest("log", ("F",)))
    assert table.rows.tolist() == [2, 100_003]
    assert len(cut) < 100_000
