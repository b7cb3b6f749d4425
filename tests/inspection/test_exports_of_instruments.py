"""Folders of instruments and of other countries: labels before the lines of a header, titles in
several lines, specimens that are named once, Chinese and Japanese texts, counts instead of a clock.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorded import checked, dataset_of, drafted, workbook

from mapmore_cli.annexes.drafting.answers import answers_of
from mapmore_cli.domain.errors import UsageError

T = 0.01 * np.arange(200)
P, X = 200 + 90 * np.sin(5 * T), 9 + 3 * np.sin(5 * T - 0.4) + 0.3 * np.cos(31 * T)


def rows(*columns, mark=","):
    lines = zip(*columns, strict=True)
    return "".join(mark.join(f"{value:.6g}" for value in line) + "\n" for line in lines)


@pytest.mark.parametrize("label", ["=", ":"])
def test_labelled_lines_above_a_clock_are_its_header(tmp_path, label):
    """As LabChart writes them: again above each block, with limits as numbers; and a remark stands
    behind the numbers of a row, which is left out.
    """
    for number in (1, 2):
        text = ""
        for block in (1, 2):
            head = [f"Interval|0.01 s|{number}{block}", "Title|Pressure|Length", "Unit|kPa|mm"]
            lines = [line.replace("|", f"{label}\t", 1).replace("|", "\t") for line in head]
            text += "\n".join([*lines, f"Top{label}\t1000\t50", f"Bottom{label}\t-1000\t-50", ""])
            part = rows(T, P + block, X, mark="\t").splitlines()
            text += "\n".join([*part[:20], f"{part[20]}\t#1 start", *part[21:], ""])
        (tmp_path / f"rec{number}.txt").write_text(text)
    said = answers_of(target="Length", inputs="Pressure", columns="time=0:s")
    draft = drafted(tmp_path, answers=said)
    assert [entry["table"] for entry in draft.data["files"]] == [1, 2]
    named = [(one["column"], one["unit"]) for one in draft.data["columns"].values()]
    assert named == [(0, "s"), ("Pressure", "kPa"), ("Length", "mm")]
    assert [one.rows_kept for one in dataset_of(draft, tmp_path).recordings] == [199] * 4


NESTED = {
    "below": (",act,act,load\n,pressure,position,force\nt,,,\n", ("pressure", "position", "force")),
    "above": (",P,x,F\n,meas,meas,meas\n", ("P", "x", "F")),
    "both": (",arm,arm,load\n,mean,max,mean\n,,,N\n", ("arm mean", "arm max", "load")),
}


@pytest.mark.parametrize("kind", NESTED)
def test_titles_in_several_lines_are_told_apart(tmp_path, kind):
    """As pandas writes them."""
    head, (pressure, position, force) = NESTED[kind]
    for number in (1, 2):
        force_of = 0.4 * P - X + number
        (tmp_path / f"{number}.csv").write_text(head + rows(T, P, X, force_of))
    inputs = f"pressure={pressure}:kPa,position={position}:mm"
    said = answers_of(target=f"force={force}:N", inputs=inputs, columns="time=0:s")
    draft = drafted(tmp_path, answers=said)
    checked(draft, tmp_path)
    columns = dataset_of(draft, tmp_path).recordings[0].columns
    for name, values in (("pressure", P), ("position", X), ("force", 0.4 * P - X + 1)):
        np.testing.assert_allclose(columns[name], values, atol=1e-2)


@pytest.mark.parametrize("is_merged", [False, True])
def test_a_text_applies_to_the_empty_cells_below_it(tmp_path, is_merged):
    """In a sheet, the first of its rows names a specimen; or the cells of its rows are merged."""
    cells = [["Muscle", "P [kPa]", "F [N]"]]
    for number, muscle in enumerate(("M1", "M2", "M3"), start=1):
        pressure = np.arange(30.0)
        force = number * pressure + np.cos(pressure)
        cells += [[None, *row] for row in zip(pressure, force, strict=True)]
        cells[-30][0] = muscle
    workbook(tmp_path / "all.xlsx", {"all": cells})
    if is_merged:
        openpyxl = pytest.importorskip("openpyxl")
        book = openpyxl.load_workbook(tmp_path / "all.xlsx")
        for first in (2, 32, 62):
            book.active.merge_cells(f"A{first}:A{first + 29}")
        book.save(tmp_path / "all.xlsx")
    said = answers_of(target="F [N]", inputs="P [kPa]", recordings="Muscle")
    draft = drafted(tmp_path, answers=said)
    assert draft.data["columns"]["Muscle"] == {"column": "Muscle", "texts": "down"}
    found = dataset_of(draft, tmp_path).recordings
    assert [one.id for one in found] == [f"all[Muscle={muscle}]" for muscle in ("M1", "M2", "M3")]
    assert [one.rows_kept for one in found] == [30] * 3


@pytest.mark.parametrize("place", [0, 40])
def test_a_remark_in_a_row_names_no_recordings(tmp_path, place):
    lines = rows(P, X).splitlines()
    lines = [f"{'bubble' if at == place else ''},{line}" for at, line in enumerate(lines)]
    (tmp_path / "a.csv").write_text("\n".join(["Remark,P [kPa],x [mm]", *lines]))
    with pytest.raises(UsageError, match="Remark has no numbers, and no text"):
        drafted(tmp_path, answers=answers_of(target="x", inputs="P", recordings="Remark"))


@pytest.mark.parametrize(
    ("encoding", "titles"),
    [("gbk", "时间(s),压力(kPa),位移(mm)"), ("shift_jis", "時間(s),圧力(kPa),変位(mm)")],
)
def test_chinese_and_japanese_texts_are_read_in_their_encoding(tmp_path, encoding, titles):
    for number in (1, 2):
        text = f"{titles}\n{rows(T, P + number, X)}"
        (tmp_path / f"{number}.csv").write_bytes(text.encode(encoding))
    draft = drafted(tmp_path, answers=answers_of(target="displacement", inputs="pressure"))
    assert {*draft.data["columns"]} == {"time", "pressure", "displacement"}
    assert len(dataset_of(draft, tmp_path).recordings) == 2


def test_words_at_the_head_of_a_file_are_not_those_of_its_first_table(tmp_path):
    """`Points per scan: 40` stands above the first scan."""
    for pressure in (100, 200, 300):
        text = "Rig 7\nPoints per scan: 40\n"
        for scan in (1, 2):
            strain = np.linspace(0, 20, 40)
            force = pressure * (1 - strain / 25) + scan
            text += f"Scan\t{scan}\nDisp\tLoad\nmm\tN\n{rows(strain, force, mark=chr(9))}\n"
        (tmp_path / f"p{pressure}kPa.txt").write_text(text)
    data = drafted(tmp_path).data
    assert [(entry["set"]) for entry in data["files"]] == [
        {"pressure": pressure} for pressure in (100, 100, 200, 200, 300, 300)
    ]
    checked(drafted(tmp_path), tmp_path)


def test_the_first_lines_of_a_file_are_no_header_of_a_table_further_down(tmp_path):
    """`check` warned that `1000`, the rate of a Vicon file, is a line of the header."""
    head = "Devices\n1000\n,,Plate,Valve\nFrame,Sub,Fz,P\n,,N,V\n"
    frames = np.arange(200) // 10 + 1
    text = head + rows(frames, np.arange(200) % 10, X, P) + "\nOther\n100\nFrame,x\n,mm\n"
    (tmp_path / "a.csv").write_text(text + rows(np.arange(30), np.sin(np.arange(30))))
    said = answers_of(target="Fz", inputs="P", sample_time="1ms")
    draft = drafted(tmp_path, answers=said)
    assert draft.data["files"] == [{"path": "a.csv", "table": 1}]
    checked(draft, tmp_path)
