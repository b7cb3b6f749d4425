"""What `init` takes for a table: in text with remarks and words, in workbooks of several sheets, in
files that hold trees of arrays.
"""

from __future__ import annotations

from contextlib import nullcontext
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from recorded import drafted, workbook
from scipy.io import savemat
from test_lvm_reader import FIRST, HEAD

from mapmore_cli.annexes.drafting import first_lines
from mapmore_cli.annexes.drafting.first_lines import comment_among, kinds_of_lines, unread
from mapmore_cli.annexes.drafting.found_table import _labelled_lines
from mapmore_cli.annexes.drafting.layout import FileLayout
from mapmore_cli.annexes.drafting.preview import preview
from mapmore_cli.annexes.drafting.reading import read_draft
from mapmore_cli.annexes.drafting.rows import are_units
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.readers import READERS, TableRequest

N = 60
T = 0.05 * np.arange(N)
SWING = np.sin(0.1 * np.arange(N)) ** 2


def table(**columns):
    return [list(columns), *np.column_stack(list(columns.values())).tolist()]


RUN = table(
    time_s=T, P_kPa=np.repeat([100.0, 200.0, 300.0], N // 3), eps=0.2 * SWING, F_N=200 - 100 * SWING
)


def read(folder, rows, title="P_kPa"):
    """The draft of rows as text, in which the pressure has this title."""
    (folder / "a.csv").write_text(as_text(rows).replace("P_kPa", title))
    return drafted(folder)


def as_text(rows):
    return "".join(",".join(map(str, row)) + "\n" for row in rows)


# Text
# --------------------------------------------------------------------------------------------------


def test_a_column_of_words_is_left_out(tmp_path):
    rows = [
        [*row[:2], "note" if not k else "up" if k < 30 else "down", *row[2:]]
        for k, row in enumerate(RUN)
    ]
    draft = read(tmp_path, rows)
    assert set(draft.data["columns"]) == {"time", "pressure", "strain", "force"}
    assert "left out: note" in draft.text()


@pytest.mark.parametrize("place", [7, 40])
def test_a_word_for_a_missing_number_is_told_to_the_reader(tmp_path, place):
    """Also beyond the lines that are looked at first."""
    rows = [list(row) for row in RUN]
    rows[place][3] = rows[place + 3][3] = "OVLD"
    draft = read(tmp_path, rows)
    assert draft.data["missing"] == {"tokens": ["OVLD"]}
    assert (
        "CHECK: 2 samples have a cell that is empty or holds 'OVLD'; it is read as a missing value"
        in draft.text()
    )
    assert read_draft(draft, tmp_path, "force").recordings[0].dropped == {"missing value": 2}


def test_a_column_that_is_hardly_filled_hides_no_other(tmp_path):
    """Where the remark's number stands the pressure is 4 kPa, and elsewhere up to 300: no bar."""
    rows = [[*row, "remark" if not k else 1.0 if k in (1, 2) else ""] for k, row in enumerate(RUN)]
    for k in (1, 2):
        rows[k][1] = 4.0 + k
    for title in ("P_kPa", "P"):
        assert read(tmp_path, rows, title).data["columns"]["pressure"] == {
            "column": title,
            "unit": "kPa",
        }


ABOVE = {  # what stands above three columns of numbers: their names in the spec, and the units
    "t,P,F\n\n\n": ("t P F", ""),
    "t,P,F\n\ns,kPa,N\n": ("t P F", "s kPa N"),
    "Time,A,B\n(ms),(V),(mV)\n\n": ("Time A B", "ms V mV"),
    "Rig 7,by me,\n1.3.26,,\n\nt,P,F\n[s],[%],[-]\n\n": ("t P F", "s % -"),
    "t,P,F\nclock,cell,cell\ns,bar,counts\n": ("t P F", "s bar counts"),
    "Format 1\n\n,,Marker\n,,ID\nFrame,Time (Seconds),X\n": ("Frame Time_(Seconds) X", ""),
    ",Motor position,Tip z\n": ("0 Motor_position Tip_z", ""),
    ",P,F\nNo,kPa,N\n": ("0 P F", "No kPa N"),
    "t,P,P\n": ("t 1 2", ""),
    "Operator,me,\nSpeed,5,mm/s\nt,P,F\n": ("t P F", ""),
    "s,bar,N\ntime,P,F\n": ("time P F", "s bar N"),
    "t,P,F\nclock,gauge,cell\n": ("t P F", ""),
    "#t,P,F\n": ("#t P F", ""),
    "# of me, and you, on 1 May\n# t,P,F\n# s,kPa,N\n": ("#_t P F", "s kPa N"),
    "": ("0 1 2", ""),
    "\n\n": ("0 1 2", ""),
    "t,P,F,\n": ("0 1 2", ""),
    "Rig seven,by me\n": ("0 1 2", ""),
}


@pytest.mark.parametrize("above", ABOVE)
def test_the_reader_skips_what_stands_above_the_numbers(tmp_path, above):
    names, units = (text.split() for text in ABOVE[above])
    columns = tuple(int(one) if one.isdigit() else one.replace("_", " ") for one in names)
    numbers = np.arange(60.0).reshape(20, 3)
    (tmp_path / "a.csv").write_text(above + as_text(numbers.tolist()))
    layout = preview(tmp_path / "a.csv")
    assert (layout.columns, list(layout.units)) == (columns, units)
    settings = {**layout.settings, "header": int(layout.settings.get("header", 1))}
    (table,) = READERS["csv"].read(tmp_path / "a.csv", TableRequest("a", columns, **settings))
    np.testing.assert_array_equal(np.transpose([*table.columns.values()]), numbers)


def test_a_line_of_units_that_has_a_one_and_words_beside_numbers(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("P;eps\nkPa;1\n" + "".join(f"{k};0,{k}\n" for k in range(10, 30)))
    assert (preview(path).settings, preview(path).units) == (
        {"delimiter": ";", "decimal": ",", "header": 2},
        ("kPa", "1"),
    )
    path.write_text("t;state;F\n" + "".join(f"{k},5;up;{k},25\n" for k in range(20)))
    assert preview(path).settings == {"delimiter": ";", "decimal": ","}
    path.write_text(",F\n" + "".join(f"{k},{k * k}\n" for k in range(20)))
    assert preview(path).titles == ("", "F")  # half of the columns are named
    path.write_text("t,P,P\n,left,right\n" + "".join(f"{k},{k},{-k}\n" for k in range(20)))
    assert preview(path).titles == ("t", "P left", "P right")
    # the words of a line with numbers are not about columns
    path.write_text("gain,2.5,low\nt,P,P\n" + "".join(f"{k},{k},{-k}\n" for k in range(20)))
    assert preview(path).titles == ("t", "P", "P")
    path.write_text("run,5\nt,F,\n" + "".join(f"{k},{k},\n" for k in range(20)))
    assert preview(path).titles == ("t", "F")
    path.write_text("1,2\n")
    assert preview(path).columns == (0, 1)
    path.write_text("t,F\n" + "".join(f"{k},{k}\n" for k in range(20)) + "end of test\nby me\n")
    assert preview(path).titles == ("t", "F")
    path.write_text("# t P\n# s kPa\n" + "".join(f"{k} {k}\n" for k in range(20)))
    layout = preview(path)
    assert (layout.columns, layout.titles, layout.units) == ((0, 1), ("t", "P"), ("s", "kPa"))


def test_a_line_of_units_has_more_units_than_other_words():
    assert are_units(["kPa", "N", "", "left"])
    assert not are_units(["kPa", "left"])


@pytest.mark.parametrize(
    ("across", "is_map"),
    [
        *(("10,20,40", True), ("40,20,10", True), ("10,10,40", False), ("40,10,10", False)),
        ("1,2,3", False),
    ],
)
def test_values_above_and_beside_a_map_rise_or_fall(tmp_path, across, is_map):
    (tmp_path / "a.csv").write_text(f",{across}\n1,5,6,7\n2,6,7,8\n4,7,8,9\n8,9,9,9\n")
    found = preview(tmp_path / "a.csv")
    assert found.is_map == is_map
    assert not is_map or found.numeric == (0, 1, 2)


def test_a_map_has_at_least_three_values_of_both_quantities(tmp_path):
    for text in (",10,20\n1,5,6\n2,6,7\n4,7,8\n8,7,8\n", ",10,20,40\n1,5,6,7\n2,6,7,8\n4,7,8,9\n"):
        (tmp_path / "a.csv").write_text(text)
        assert not preview(tmp_path / "a.csv").is_map


def test_labels_are_texts_above_an_empty_column_or_end_with_a_colon_above_numbers():
    top = SimpleNamespace(is_number=lambda cell: str(cell).isdecimal())
    label, word = ["Count:", "3", "3"], ["Name", "t", "F"]

    def found(*firsts):
        rows = [label, word, ["Unit", "s", "N"], *([first, "1", "2"] for first in firsts)]
        return _labelled_lines(rows, 3, top)

    assert found(*"1234567") == [label]
    assert found(*"123456x") == []
    assert [row[0] for row in found(*[""] * 7)] == ["Count:", "Name", "Unit"]


def test_tables_below_each_other_differ_in_their_titles_or_their_number_of_columns(tmp_path):
    path, rows = tmp_path / "a.csv", "".join(f"{k},{k * k}\n" for k in range(30))
    path.write_text(f"{rows}\n{rows}\n1,2,3\n4,5,6\n")
    assert (preview(path).tables, preview(path).left) == ((1, 2), ("table 3 (3 columns)",))
    path.write_text(f"a,b\n{rows}a,b\n{rows}")
    assert preview(path).tables == (1, 2)
    path.write_text(f"a,b\n{rows}# x,y\n{rows}")  # a comment is no header
    assert preview(path).tables == ()
    for note in ("", "# note\n", f"# note\n{rows}"):
        path.write_text(f"a,b\n{rows}c,d\n{rows}{note}# x,y\n{rows}")
        assert preview(path).tables == (1,)


@pytest.mark.parametrize(("numbers", "numeric"), [(10, (0, 2)), (11, (0, 1, 2))])
def test_a_column_of_numbers_has_more_numbers_than_words_in_the_lower_half(
    tmp_path, numbers, numeric
):
    words = [*["on"] * 20, *["1.5"] * numbers, *["off"] * (20 - numbers)]
    rows = "".join(f"{k},{word},{k * k}\n" for k, word in enumerate(words))
    (tmp_path / "a.csv").write_text(f"t,state,F\n{rows}")
    assert preview(tmp_path / "a.csv").numeric == numeric


@pytest.mark.parametrize("name", ["a.zip", "a.MF4", "a.ndjson", "a.npy", "a.pkl", "a.bag"])
def test_what_no_reader_takes_is_named_with_what_to_do(tmp_path, name):
    (tmp_path / name).write_bytes(b"x")
    told = unread(tmp_path / name)
    assert told is not None
    assert told.startswith(f"{name}: no reader takes {name[1:].lower()}; ")
    with pytest.raises(DataError) as caught:
        preview(tmp_path / name)
    assert caught.value.message == told
    assert unread(tmp_path / "a.csv") is unread(tmp_path / "README.md") is None


@pytest.mark.parametrize(("widest", "is_read"), [(3, True), (2, False)])
def test_a_table_has_at_most_so_many_columns_as_init_can_read(
    tmp_path, monkeypatch, widest, is_read
):
    monkeypatch.setattr("mapmore_cli.annexes.drafting.preview.WIDEST", widest)
    (tmp_path / "a.csv").write_text("Rig 7\nt,P,F\n" + "1,2,3\n" * 9)
    with nullcontext() if is_read else pytest.raises(DataError, match="has 3 columns, more than 2"):
        assert preview(tmp_path / "a.csv").titles == ("t", "P", "F")


def test_the_reason_is_that_of_a_row_in_the_middle(tmp_path):
    text = "p,x,F\na,b,c\na,b,c\n" + "2 bar,1 m,3 N\n" * 3
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(DataError, match="because '2 bar' is not a number"):
        preview(tmp_path / "a.csv")
    (tmp_path / "a.csv").write_text("\n" * 9)
    with pytest.raises(DataError, match="no table of numbers"):
        preview(tmp_path / "a.csv")


@pytest.mark.parametrize("row", ["5 m", "12:00:01,on"])
def test_no_reason_is_given_for_texts_that_are_no_table(tmp_path, row):
    (tmp_path / "a.csv").write_text(f"{row}\n" * 9)
    with pytest.raises(DataError, match="was found in its first 9 lines") as caught:
        preview(tmp_path / "a.csv")
    assert "because" not in caught.value.message


@pytest.mark.parametrize(
    ("text", "skipped", "mark"),
    [
        ("# t,F\n1,2\n# note\n3,4\n", 0, None),  # the line of titles would be skipped as well
        ("t,F\n1,2\n# note\n3,4\n", 0, "#"),
        ("# rig\nt,F\n1,2\n% note\n3,4\n", 1, "%"),
        ("t,F\n1,2\n3,4\n", 0, None),
    ],
)
def test_comments_between_rows_begin_with_a_mark(tmp_path, text, skipped, mark):
    (tmp_path / "a.csv").write_text(text)
    layout = FileLayout("csv", (), (), {"skip_rows": skipped} if skipped else {}, (), ())
    assert comment_among(tmp_path / "a.csv", layout) == mark


def test_texts_are_alike_if_their_beginnings_differ_only_in_numbers(tmp_path, monkeypatch):
    monkeypatch.setattr(first_lines, "HEAD", 14)
    (tmp_path / "a.csv").write_bytes(b"")
    assert kinds_of_lines(tmp_path / "a.csv") == ()
    for text in (b"t,F\n1,2\n33,4\n", b"t,F\n10,2\n3,47\n", b"t,F\n1,2\nremark on"):
        # from 14 bytes on, the last line is cut
        (tmp_path / "a.csv").write_bytes(text)
        assert kinds_of_lines(tmp_path / "a.csv") == (b"t,F", b"0,0")


# Workbooks
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rows", "settings"),
    [
        (table(t=T, P=SWING, F=SWING), {}),  # a first row of zeros is no blank one
        (
            [
                ["rig 1"],
                [],
                ["t", "P", "F"],
                *([k, 2.0 * k, *([3.0 * k] if k % 2 else [])] for k in range(6)),
            ],
            {"skip_rows": 2},
        ),
    ],
)
def test_a_row_ends_at_its_last_filled_cell(tmp_path, rows, settings):
    workbook(tmp_path / "a.xlsx", {"run": rows})
    assert (preview(tmp_path / "a.xlsx").titles, preview(tmp_path / "a.xlsx").settings) == (
        ("t", "P", "F"),
        settings,
    )


NOTES = [["operator", "remarks"], ["me", "none"]]


@pytest.mark.parametrize("titles", [("run 1", "run 2"), ("left", "right"), ("one",)])
def test_every_sheet_that_is_alike_is_read(tmp_path, titles):
    summary = [["P", "F"], [1, 2], [3, 4]]
    workbook(
        tmp_path / "a.xlsx", {"notes": NOTES, **dict.fromkeys(titles, RUN), "summary": summary}
    )
    draft = drafted(tmp_path)
    one_by_one = [{"path": "a.xlsx", "sheet": title} for title in titles]
    assert draft.data["files"] == (one_by_one if len(titles) > 1 else ["a.xlsx"])
    assert len(read_draft(draft, tmp_path, "force").recordings) == len(titles)
    assert "left out because their layout differs: 'notes', 'summary'" in draft.text()


def test_tables_below_each_other_are_looked_for_in_a_single_sheet_only(tmp_path):
    rows = [["t", "F"], *([k, k * k] for k in range(9))]
    workbook(tmp_path / "a.xlsx", {"one": [*rows, [], *rows]})
    assert preview(tmp_path / "a.xlsx").tables == (1, 2)
    workbook(tmp_path / "a.xlsx", {name: [*rows, [], *rows] for name in ("one", "two")})
    found = preview(tmp_path / "a.xlsx")
    assert (found.tables, found.alike) == ((), ("one", "two"))


# Trees
# --------------------------------------------------------------------------------------------------


COLUMNS = dict(zip(RUN[0], np.array(RUN[1:]).T, strict=True))


def hdf5(path, **arrays):
    with h5py.File(path, "w") as file:
        for name, values in arrays.items():
            file[name] = values


RECORDED = np.array(list(zip(T, SWING, strict=True)), dtype=[("t", "f8"), ("P", "f8")])


@pytest.mark.parametrize(
    ("arrays", "columns", "settings"),
    [
        (
            {"run/P": SWING, "run/F": T[:, None], "run/fs": [[20.0]]},
            ("run/F", "run/P"),
            {"sample_time": 0.05},
        ),
        (
            {"a/P": SWING, "b/F": T, "dt": 0.05, "photo": np.zeros((9, 9, 3))},
            ("a/P", "b/F"),
            {"sample_time": 0.05},
        ),
        ({"all": RECORDED}, ("all/t", "all/P"), {}),
        ({"data": np.column_stack([T, SWING])}, ("data[:,0]", "data[:,1]"), {}),
        ({"data": np.stack([T, SWING])}, ("data[0,:]", "data[1,:]"), {}),
        (
            {f"r_{k}/{name}": SWING for k in (1, 2, 10) for name in "FP"},
            ("F", "P"),
            {"root": "[*]"},
        ),
        (
            {"short/P": SWING[:9], "short/F": T[:9], "long/P": SWING, "long/F": T, "who": "me"},
            ("F", "P"),
            {"root": "[*]"},
        ),
        (
            {"short/P": SWING[:9], "short/x": T[:9], "long/P": SWING, "long/F": T, "who": "me"},
            ("long/F", "long/P"),
            {},
        ),
    ],
)
def test_columns_of_an_hdf5_file(tmp_path, arrays, columns, settings):
    hdf5(tmp_path / "a.h5", **arrays)
    found = preview(tmp_path / "a.h5")
    assert (found.columns, found.settings) == (columns, settings)


def test_groups_with_equal_columns_are_recordings_with_their_sample_time(tmp_path):
    columns = {name: x for name, x in COLUMNS.items() if name != "time_s"}
    runs = {f"run_{k}/{name}": k * x for k in (1, 2, 10) for name, x in columns.items()}
    hdf5(tmp_path / "a.h5", **runs, **{f"run_{k}/fs": 50.0 for k in (1, 2, 10)})
    draft = drafted(tmp_path)
    assert (draft.data["root"], draft.data["sample_time"]) == ("[*]", 0.02)
    assert draft.notes["data", "sample_time"].why == "s: as the file says"
    recordings = read_draft(draft, tmp_path, "force").recordings
    assert [one.columns["pressure"][0] for one in recordings] == [100, 200, 1000]


def test_links_in_circles_end(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        run = file.create_group("run")
        run["t"], run["P"] = T, SWING
        for number in range(8):
            run[f"again_{number}"] = run
    assert preview(tmp_path / "a.h5").columns == ("run/P", "run/t")


def test_columns_of_a_mat_file(tmp_path):
    cells = np.empty(2, dtype=object)
    cells[:] = [{"t": T, "P": SWING}, {"t": T, "P": SWING}]
    for content, columns, settings in (
        (
            {"run": {"t": T, "P": SWING, "Ts": 0.05}, "who": "me"},
            ("run.t", "run.P"),
            {"sample_time": 0.05},
        ),
        ({"train": cells, "fs": 20.0}, ("t", "P"), {"root": "train[*]"}),
        ({"data": np.column_stack([T, SWING])}, ("data[:,0]", "data[:,1]"), {}),
    ):
        savemat(tmp_path / "a.mat", content)
        found = preview(tmp_path / "a.mat")
        assert (found.columns, found.settings) == (columns, settings)


def test_columns_of_a_tdms_file(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as file:
        waves = [
            nptdms.ChannelObject(
                "Rig", name, values, {"wf_increment": 0.05, "unit_string": f"{name}a"}
            )
            for name, values in (("P", SWING), ("F", T))
        ]
        file.write_segment([*waves, nptdms.ChannelObject("Notes", "who", ["me", "you"])])
    found = preview(tmp_path / "a.tdms")
    assert (found.columns, found.titles, found.settings) == (
        ("Rig/P", "Rig/F"),
        ("P", "F"),
        {"sample_time": 0.05},
    )
    assert found.units == ("Pa", "Fa")


def test_labview_texts_are_known_by_how_they_begin_and_archives_by_their_arrays(tmp_path):
    (tmp_path / "a.txt").write_text(HEAD + FIRST)
    found = preview(tmp_path / "a.txt")
    assert (found.reader, found.settings, found.numeric) == ("lvm", {}, (0, 1, 2))
    assert (found.columns, found.units) == (("X_Value", "P", "F", "Comment"), ("s", "kPa", "N", ""))
    np.savez(tmp_path / "a.npz", **{"P [kPa]": T, "y": np.column_stack([T, T]), "who": "me"})
    assert preview(tmp_path / "a.npz").columns == ("P [kPa]", "y[:,0]", "y[:,1]")


@pytest.mark.parametrize("content", [{"x": 1.0}, {"who": "me"}, {"only": T}])
def test_a_tree_without_a_table_is_refused(tmp_path, content):
    hdf5(tmp_path / "a.h5", **content)
    with pytest.raises(DataError, match=r"a\.h5: no table of numbers"):
        preview(tmp_path / "a.h5")


# Names beside arrays
# --------------------------------------------------------------------------------------------------

NAMES = ("time_s", "p_kPa", "angle_deg")
SIGNALS = np.column_stack([0.02 * np.arange(200), *(np.sin(np.arange(200) / k) for k in (9, 7))])


def named_cell():
    cell = np.empty(3, object)
    cell[:] = NAMES
    return cell


@pytest.mark.parametrize("kind", ["npz", "cell", "h5"])
def test_texts_beside_a_matrix_are_the_titles_of_its_columns(tmp_path, kind):
    if kind == "npz":
        np.savez(tmp_path / "a.npz", data=SIGNALS, columns=np.array(NAMES))
    elif kind == "cell":
        savemat(tmp_path / "a.mat", {"logsout": SIGNALS, "names": named_cell()})
    else:
        with h5py.File(tmp_path / "a.h5", "w") as file:
            file["run/data"] = SIGNALS
            file["run/names"] = list(NAMES)
    (path,) = tmp_path.iterdir()
    assert preview(path).titles == NAMES


@pytest.mark.parametrize("units", [("s", "bar", "deg"), ("", "", "")])
def test_the_name_and_the_unit_in_a_struct_are_those_of_its_data(tmp_path, units):
    """dSPACE saves X and Y in this way, in a variable with the name of the file."""
    for number in range(3):
        names = ("Time", "Pressure", "Angle")
        signals = [
            {"Name": name, "Data": x, "Unit": unit}
            for name, unit, x in zip(
                names, units, SIGNALS.T + number * np.array([[0], [1], [2]]), strict=True
            )
        ]
        variable = f"rec_{number}"
        record = {variable: {"X": signals[0], "Y": np.array(signals[1:], object)}}
        savemat(tmp_path / f"{variable}.mat", record)
    draft = drafted(tmp_path)
    assert draft.files == 3
    pressure = draft.data["columns"]["pressure"]
    assert (pressure["unit"], draft.open.get(("data", "columns", "pressure")) is None) == (
        ("bar", True) if units[0] else ("kPa", False)
    )
    recordings = read_draft(draft, tmp_path, "Angle").recordings
    assert [one.columns["Angle"][0] for one in recordings] == [0, 2, 4]


def test_texts_of_matlab_7_3_are_read(tmp_path):
    """They are numbers of characters there."""
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        for name, x in zip(NAMES, SIGNALS.T, strict=True):
            group = file.create_group(name[:1])
            group.attrs["MATLAB_class"] = np.bytes_("struct")
            for key, values, kind in (
                ("Data", x[None, :], "double"),
                ("Name", np.array([[ord(sign)] for sign in name], np.uint16), "char"),
            ):
                group[key] = values
                group[key].attrs["MATLAB_class"] = np.bytes_(kind)
    assert sorted(preview(tmp_path / "a.mat").titles) == sorted(NAMES)
