"""What lies on the disks of other laboratories: trials called by texts, units that differ from file
to file, points of one file each, maps of cells, cells shown in per cent, hidden rows.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorded import checked, dataset_of, drafted, workbook, write

from mapmore_cli.annexes.drafting.answers import answers_of
from mapmore_cli.annexes.drafting.checked import with_few_files
from mapmore_cli.annexes.drafting.start import start
from mapmore_cli.domain.errors import UsageError

ROWS, LONG = np.arange(40), np.arange(300)


def trials(path, labels, titles=("Trial", "P [kPa]", "angle [deg]"), more=""):
    """One file of presses, each called by a text, one after the other."""
    lines = [",".join(titles)]
    for number, label in enumerate(labels, start=1):
        pressure = (50 + 10 * number) * np.sin(np.pi * ROWS / 39)
        angle = 0.3 * pressure + 20 * np.cos(np.pi * ROWS / 39)
        lines += [f"{label},{p:.4f},{a:.4f}" for p, a in zip(pressure, angle, strict=True)]
    path.write_text("\n".join(lines) + f"\n{more}")


# Recordings that a column tells apart
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("labels", ["T01 T02 T03 T04", "left right mid", "007 008 x-1 2024-01-05"])
@pytest.mark.parametrize("said", ["Trial", "0"])
def test_texts_tell_recordings_apart(tmp_path, labels, said):
    """Numbers of texts are one in all files; ids show the texts."""
    trials(tmp_path / "a.csv", labels.split())
    draft = drafted(tmp_path, answers=answers_of(recordings=said))
    ids = [one.id for one in dataset_of(draft, tmp_path).recordings]
    assert ids == [f"a[Trial={label}]" for label in labels.split()]
    assert {*draft.data["split"]["validate"]["recordings"]} < {*ids}
    assert draft.tips == ()
    checked(draft, tmp_path)


def test_texts_have_one_number_in_all_files(tmp_path):
    trials(tmp_path / "a.csv", ["S1", "S2"])
    trials(tmp_path / "b.csv", ["S2", "S3"])
    draft = drafted(tmp_path, answers=answers_of(recordings="Trial", group="Trial"))
    numbers = [one.columns["Trial"][0] for one in dataset_of(draft, tmp_path).recordings]
    assert numbers == [1, 2, 2, 3]
    assert draft.data["groups"] == {"of": "Trial"}


@pytest.mark.parametrize(
    ("labels", "is_proposed"),
    [
        (["T01", "T02", "T03"], True),
        (["1", "2", "3"], True),
        (["100", "200", "300"], False),
        (["up", "down", "up"], False),
    ],
)
def test_a_column_in_blocks_is_proposed_and_not_taken(tmp_path, labels, is_proposed):
    trials(tmp_path / "a.csv", labels)
    draft = drafted(tmp_path, answers=answers_of(target="angle", inputs="P"))
    assert "recordings" not in draft.data
    assert any("--recordings Trial" in tip for tip in draft.tips) == is_proposed
    assert ("--recordings Trial" in draft.text()) == is_proposed
    trials(tmp_path / "a.csv", labels, ("Trial", "one", "another"))
    with pytest.raises(UsageError) as refused:
        start(tmp_path, tmp_path)
    assert ("is each block a recording?" in refused.value.message) == is_proposed
    assert ("--recordings Trial" in str(refused.value.remedy)) == is_proposed


def test_rows_of_means_are_told(tmp_path):
    trials(tmp_path / "a.csv", ["T01", "T02"], more="Mean,75,30\nSD,3,2\n")
    (tip, *_) = drafted(tmp_path, answers=answers_of(target="angle", inputs="P")).tips
    assert "Mean, SD" in tip
    assert "`--group Trial`" in tip
    draft = drafted(tmp_path, answers=answers_of(target="angle", inputs="P", group="Trial"))
    (one,) = dataset_of(draft, tmp_path).recordings
    assert one.rows_kept == 80
    assert one.columns["Trial"].max() == 2


# Files
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("corner", "mark", "point"), [("", ",", "."), ("eps/P", ";", ","), ("eps/P", "\t", ".")]
)
def test_a_map_of_cells_is_a_table_of_its_cells(tmp_path, corner, mark, point):
    head = mark.join([corner, *(str(50 * k) for k in range(5))]) + "\n"
    cells = [[e / 2, *(e * k / 4 for k in range(5))] for e in range(8)]
    lines = [mark.join(str(x).replace(".", point) for x in row) for row in cells]
    (tmp_path / "map.csv").write_text(f"Bench 7{mark * 5}\n{head}" + "\n".join(lines) + "\n")
    with pytest.raises(
        UsageError, match=r"is a map.*`row`.*0 to 3\.5.*`column`.*0 to 200"
    ) as asked:
        start(tmp_path, tmp_path)
    assert "--target force=cell:N --inputs pressure=row:kPa,strain=column:%" in asked.value.remedy
    said = answers_of(target="force=cell:N", inputs="strain=row:%,pressure=column:kPa")
    (draft,) = start(tmp_path, tmp_path, answers=said).drafts
    (one,) = dataset_of(draft, tmp_path).recordings
    assert one.rows_kept == 40
    np.testing.assert_allclose(one.columns["strain"], np.repeat(np.arange(8) / 200, 5))
    np.testing.assert_allclose(one.columns["pressure"], np.tile(50.0 * np.arange(5), 8))
    np.testing.assert_allclose(one.columns["force"], np.ravel([row[1:] for row in cells]))


@pytest.mark.parametrize(
    "titles",
    [
        "Temps (s)|Pression (bar)|Effort (N)",
        "Tiempo (s)|Presión (bar)|Fuerza (N)",
        "Tempo [s]|Pressione [bar]|Forza [N]",
        "Uhrzeit [s]|Druck [bar]|Kraft [N]",
        "Время [s]|Давление [bar]|Сила [N]",
        "时间(s)|压力(bar)|力(N)",
    ],
)
def test_titles_of_other_languages_name_quantities(tmp_path, titles):
    columns = dict(zip(titles.split("|"), (0.1 * ROWS, np.sin(ROWS), ROWS % 7), strict=True))
    write(tmp_path / "a.csv", columns)
    assert {"time", "pressure", "force"} == {*drafted(tmp_path).data["columns"]}


# Workbooks
# --------------------------------------------------------------------------------------------------


def test_cells_in_per_cent_are_read_as_fractions(tmp_path):
    rows = [
        ["P [kPa]", "strain [%]", "F [N]"],
        *([k % 4 * 100, 0.01 * k, 3 * k + k % 4 * 30] for k in ROWS),
    ]
    workbook(tmp_path / "d.xlsx", {"Data": rows})
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.load_workbook(tmp_path / "d.xlsx")
    for row in range(2, len(rows) + 1):
        book["Data"].cell(row, 2).number_format = "0.0%"
    for row in (5, 6):
        book["Data"].row_dimensions[row].hidden = True
    book["Data"].column_dimensions["C"].hidden = True
    book.save(tmp_path / "d.xlsx")
    draft = drafted(tmp_path)
    (one,) = dataset_of(draft, tmp_path).recordings
    assert one.columns["strain"].max() == pytest.approx(0.39)
    hidden_rows, hidden_column = draft.tips
    assert "2 hidden rows are read" in hidden_rows
    assert "the column 'F [N]' is hidden" in hidden_column
    checked(draft, tmp_path)


# Many files
# --------------------------------------------------------------------------------------------------


def test_the_rules_look_at_some_of_many_files(tmp_path, monkeypatch):
    """Those drawn have the ids that they have among all, also where names repeat."""
    monkeypatch.setattr("mapmore_cli.annexes.drafting.checked.MOST", 8)
    for number in range(20):
        bar = 2 + np.cos(0.1 * LONG + number)
        force = 50 * bar + 20 * np.sin(0.1 * LONG + number)
        columns = {"t [s]": 0.1 * LONG, "P [bar]": bar, "F [N]": force}
        write(tmp_path / f"day{number % 5}" / f"log_{number // 5}.csv", columns)
    draft = drafted(tmp_path)
    assert draft.data["files"] == ["day*/log_*.csv"]
    assert "examined 8 of 20 files" in draft.text()
    ids = {one.id for one in dataset_of(draft, tmp_path).recordings}
    assert len(ids) == 20
    assert {*draft.data["split"]["validate"]["recordings"]} < ids
    checked(draft, tmp_path)


def test_some_of_many_files_have_every_level_that_names_say(tmp_path, monkeypatch):
    monkeypatch.setattr("mapmore_cli.annexes.drafting.checked.MOST", 6)
    for number in range(24):
        kpa, strain = 100 * (number % 5 + 1), 0.1 * (1 + np.sin(0.3 * LONG + number))
        columns = {"strain": strain, "F [N]": kpa * (1 - strain) + number}
        write(tmp_path / f"run_{number:02d}_{kpa}kPa.csv", columns)
    draft = drafted(tmp_path)
    assert "examined 6 of 24 files" in draft.text()
    few, files = with_few_files(draft, tmp_path)
    assert files == 24
    levels = [entry["set"]["pressure"] for entry in few.data["files"]]
    assert len(levels) == 6
    assert {*levels} == {100, 200, 300, 400, 500}
    assert levels == sorted(levels)  # the files stay in their order
    assert {curve.level for curve in dataset_of(few, tmp_path).curves} == {*levels}
