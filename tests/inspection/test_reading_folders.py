"""What `init` reads in folders: bad files, tables below each other, clocks in parts, recordings
that a column tells apart, many columns; and what it tells of them.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorded import checked, dataset_of, drafted, drafts, loaded, write

from mapmore_cli.annexes.drafting.answers import answers_of
from mapmore_cli.annexes.drafting.reading import table_of
from mapmore_cli.annexes.drafting.start import start
from mapmore_cli.annexes.drafting.studies import find_studies
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.storage.tables.below import tables_below
from mapmore_cli.storage.tables.cells import holds_number

N = 240
T = 0.1 * np.arange(N)
SAID = {"target": "F", "inputs": "P"}


def swing(number=0):
    """A pressure, and a force that lags behind it."""
    pressure = 200 + 100 * np.sin((0.7 + 0.2 * number) * T) + 20 * np.sin(3.1 * T + number)
    return pressure, np.convolve(pressure, [0.5, 0.3, 0.2])[:N] + number


def recordings(folder, names, cut=0.0):
    """Files of a clock, a pressure and a force, each cut in the middle by so many seconds."""
    for number, name in enumerate(names):
        time = T + cut * (np.arange(N) > N // 2)
        columns = dict(zip(("t [s]", "P [kPa]", "F [N]"), (time, *swing(number)), strict=True))
        write(folder / f"{name}.csv", columns)


# What is held out
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["{}[First run]", "[ab]{}", "a #{}", "x, {}", "Prüfung {}", "{}#1"]
)
@pytest.mark.parametrize("cut", [0.0, 30.0])
def test_held_out_recordings_are_those_that_exist(tmp_path, name, cut):
    """Brackets are text, and pieces of a recording that gaps cut have ids of their own."""
    recordings(tmp_path, [name.format(number) for number in range(4)], cut)
    draft = drafted(tmp_path, answers=answers_of(**SAID))
    held = draft.data["split"]["validate"]["recordings"]
    assert {*held} < {one.id for one in dataset_of(draft, tmp_path).recordings}
    assert len(held) == (2 if cut else 1)
    checked(draft, tmp_path)


# The clock
# --------------------------------------------------------------------------------------------------


def test_a_clock_in_parts_is_added_up(tmp_path):
    seconds = 3595.0 + T
    parts = {"Date": 0, "Hour": 9 + seconds // 3600, "Minute": seconds // 60 % 60}
    parts |= {"Second": seconds // 1 % 60, "ms": np.round(1000 * (seconds % 1))}
    columns = dict(zip(("P [kPa]", "F [N]"), swing(), strict=True))
    write(tmp_path / "log.csv", parts | columns)
    text = (tmp_path / "log.csv").read_text().replace("\n0,", "\n2026-03-01,")
    (tmp_path / "log.csv").write_text(text)
    draft = drafted(tmp_path, answers=answers_of(**SAID))
    clock = {"columns": ["Hour", "Minute", "Second", "ms"], "format": "h min s ms"}
    assert draft.data["columns"]["time"] == clock
    time = dataset_of(draft, tmp_path).recordings[0].columns["time"]
    np.testing.assert_allclose(time, 9 * 3600 + seconds)
    dated = {"columns": ["Date", *clock["columns"]], "format": "%Y-%m-%d %H %M %S ms"}
    draft = draft.with_data("columns", draft.data["columns"] | {"time": dated})
    time = dataset_of(draft, tmp_path).recordings[0].columns["time"]
    np.testing.assert_allclose(time - 1772323200, 9 * 3600 + seconds)


# Names
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("said", ["pressure,strain", "pressure,strain=strain"])
def test_a_strain_that_a_person_names_is_called_so(tmp_path, said):
    pressure, force = swing()
    strain = 0.1 + 0.05 * np.sin(T)
    columns = {"pressure": pressure, "length": 80 * (1 - strain) + 0.1 * T, "strain": strain}
    write(tmp_path / "a.csv", columns | {"force": force})
    draft = drafted(tmp_path, answers=answers_of(target="force", inputs=said))
    assert draft.data["columns"]["strain"] == {"column": "strain"}


# Bad files, layouts and tables
# --------------------------------------------------------------------------------------------------


def test_bad_files_are_left_out_by_name(tmp_path):
    recordings(tmp_path, "abcd")
    (tmp_path / "e.csv").write_text("")
    rows = (f"{k},,{k}" if k % 2 else f"{k},{k}," for k in range(30))
    (tmp_path / "f.csv").write_text("\n".join(["t [s],P [kPa],F [N]", *rows]))
    found = start(tmp_path, tmp_path, answers=answers_of(**SAID))
    (draft,) = found.drafts
    assert draft.data["files"] == ["*.csv"]
    assert {*draft.data["skip_bad_files"]} == {"e.csv", "f.csv"}
    assert any("e.csv: is empty" in remark for remark in found.remarks)
    assert any("f.csv: no sample is left" in remark for remark in found.remarks)
    with pytest.raises(DataError, match="two sampling rates alternate"):
        start(tmp_path / "f.csv", tmp_path, answers=answers_of(**SAID))
    checked(draft, tmp_path)


def test_all_layouts_are_told_and_numbers_are_those_of_one(tmp_path):
    recordings(tmp_path, ["a_1bar", "a_2bar"])
    write(tmp_path / "z.csv", (T, T**2, np.sin(T)), "x;y;z\n", ";")
    told = []
    found = start(tmp_path, tmp_path, answers=answers_of(target="2", inputs="1"), tell=told.append)
    assert "2 files, 480 rows, 3 columns (t [s], P [kPa], F [N]); names say pressure" in told[1]
    assert "1 file, 240 rows, 3 columns (x, y, z)" in told[2]
    assert len(found.drafts) == 1
    assert any(
        "the numbers of columns that you give belong to a_1bar.csv" in one for one in found.remarks
    )


@pytest.mark.parametrize("mark", [",", ";"])
def test_tables_below_each_other_are_recordings(tmp_path, mark):
    """What stands above each says what sets it apart; one with another header is told."""
    lines = ["Bench 7", ""]
    for distance in (0, 5, 10, 15):
        rows = (f"{p}{mark}{2 * p - distance * p / 20 + 0.01}" for p in range(0, 200, 10))
        lines += [f"distance {distance} mm", f"P_kPa{mark}F_N", *rows, ""]
    lines += [f"a{mark}b", f"1{mark}2", f"2{mark}3"]
    (tmp_path / "tables.csv").write_text("\n".join(lines))
    draft = drafted(tmp_path, answers=answers_of(target="F_N", inputs="P_kPa"))
    assert draft.data["files"] == [
        {"path": "tables.csv", "table": number, "set": {"distance": 5 * (number - 1)}}
        for number in (1, 2, 3, 4)
    ]
    assert "table 5 (a, b)" in draft.text()
    dataset = dataset_of(draft, tmp_path)
    assert [one.rows_kept for one in dataset.recordings] == [20] * 4
    draft = draft.with_data("files", [{"path": "tables.csv", "table": 9, "set": {"distance": 0}}])
    with pytest.raises(DataError, match="there is no table 9: with `header: 1`, 5 tables"):
        dataset_of(draft.without_data("levels").without_data("split"), tmp_path)


@pytest.mark.parametrize(
    ("title", "samples"), [("1. pressure {} kPa", 30), ("pressure {} kPa", 220)]
)
def test_each_file_has_its_own_words_above_its_tables(tmp_path, title, samples):
    """The first lines of both files differ only in numbers, or not at all."""
    for name, pressures in (("a", (100, 200)), ("b", (100, 300))):
        text = ""
        for pressure in pressures:
            rows = (f"{0.1 * k:.1f},{pressure + k + ord(name)}" for k in range(samples))
            text += "\n".join([f"{title.format(pressure)},", "time [s],F [N]", *rows, ""])
        (tmp_path / f"{name}.csv").write_text(text)
    (study,), _ = find_studies(tmp_path)
    titles = [title.format(x) for x in (100, 200, 100, 300)]
    assert study.names == [f"{file} {own}" for file, own in zip("aabb", titles, strict=True)]
    draft = drafted(tmp_path, answers=answers_of(target="F", inputs="pressure"))
    found = [one.columns["pressure"][0] for one in dataset_of(draft, tmp_path).recordings]
    assert sorted(found) == [100, 100, 200, 300]


@pytest.mark.parametrize("suffix", ["", "pandas"])
@pytest.mark.parametrize("gap", [0, 1])
def test_tables_side_by_side_are_recordings(tmp_path, suffix, gap):
    """The third is shorter, and what stands above each is its name."""

    def line(cells):
        """Three cells for each table, and an empty column between tables."""
        return ("," * (1 + gap)).join(",".join(map(str, three)) for three in cells) + "\n"

    text = "" if suffix else line([f"Specimen {name}", "", ""] for name in "ABC")
    text += line([f"{t}.{k}" if suffix and k else t for t in ("s", "mm", "N")] for k in range(3))
    for row in range(30):
        cells = [[0.1 * row, row % 20, 3 * row % 20 + k] for k in range(3)]
        text += line(cells if row <= 20 else [*cells[:2], [""] * 3])
    (tmp_path / "press.csv").write_text(text)
    said = answers_of(target="N", inputs="mm", sample_time="0.1 s")
    draft = drafted(tmp_path, answers=said)
    assert [one["table"] for one in draft.data["files"]] == [1, 2, 3]
    assert "each of the 3 tables in a file is a recording" in draft.text()
    dataset = dataset_of(draft, tmp_path)
    assert [one.rows_kept for one in dataset.recordings] == [30, 30, 21]
    assert [one.columns["N"][0] for one in dataset.recordings] == [0, 1, 2]


def test_a_table_side_by_side_may_be_empty(tmp_path):
    rows = (f"{p},{2 * p},{p},{3 * p},," for p in range(30))
    (tmp_path / "press.csv").write_text("\n".join(["P [kPa],F [N]," * 2 + "P [kPa],F [N]", *rows]))
    draft = drafted(tmp_path)
    assert draft.data["files"] == [{"path": "press.csv", "table": at} for at in (1, 2)]
    assert [one.rows_kept for one in dataset_of(draft, tmp_path).recordings] == [30, 30]


def test_pairs_of_a_clock_and_a_signal_are_no_tables_side_by_side():
    rows = [(1, ["t", "p", "t", "F"]), *((n, ["1", "2", "3", str(n)]) for n in (2, 3, 4))]
    assert len(tables_below(rows, 1, holds_number)) == 1


@pytest.mark.parametrize(("unit", "scale"), [("kPa", 1.0), ("psi", 0.1450377), ("kPa(g)", 1.0)])
def test_a_file_with_the_columns_in_another_order_belongs_to_the_others(tmp_path, unit, scale):
    """Also if it has a column of words, or another unit."""
    for number in range(4):
        pressure, force = swing(number)
        write(tmp_path / f"r{number}.csv", {"t [s]": T, "p [kPa]": pressure, "F [N]": force})
    rows = zip(T, force, scale * pressure[::-1], strict=True)
    lines = [f"t [s],F [N],p [{unit}],note", *(f"{t},{f},{p},ok" for t, f, p in rows)]
    (tmp_path / "r4.csv").write_text("\n".join(lines))
    (draft,) = drafts(tmp_path)
    says = "1 of 5 files have other names or units" in draft.text()
    assert says == (unit != "kPa")
    dataset = dataset_of(draft, tmp_path)
    assert len(dataset.recordings) == 5
    np.testing.assert_allclose(dataset.recordings[4].columns["pressure"], pressure[::-1], rtol=1e-6)


# Recordings that a column tells apart
# --------------------------------------------------------------------------------------------------


def test_a_column_tells_recordings_apart(tmp_path):
    """Also where their rows are mixed; each has a clock of its own and is held out whole."""
    trial = np.arange(N) % 2 + 2 * (np.arange(N) // 120)
    columns = dict(zip(("P [kPa]", "F [N]"), swing(), strict=True))
    write(tmp_path / "press.csv", {"trial": trial} | columns)
    said = answers_of(**SAID, recordings="trial", sample_time="10 ms")
    draft = drafted(tmp_path, answers=said)
    assert draft.data["recordings"] == {"of": "trial"}
    assert draft.data["split"]["validate"] == {"trial": [1]}
    dataset = dataset_of(draft, tmp_path)
    assert [one.id for one in dataset.recordings] == [f"press[trial={k}]" for k in range(4)]
    for one in dataset.recordings:
        np.testing.assert_allclose(one.columns["time"], 0.01 * np.arange(60))
    draft = draft.with_data("recordings", {"of": "specimen"})
    with pytest.raises(SpecError, match="no column is called `specimen`"):
        loaded(draft, tmp_path)


@pytest.mark.parametrize(("empty", "filled", "read"), [("", 1, 1), ("---", 9, 0), ("---", 10, 10)])
def test_a_column_may_be_mostly_empty_but_not_mostly_words(tmp_path, empty, filled, read):
    rows = [f"{k},{k * k % 7},{k if k < filled else empty}" for k in range(20)]
    (tmp_path / "a.csv").write_text("\n".join(["t [s],F [N],P [kPa]", *rows]))
    ((study,), _) = find_studies(tmp_path)
    assert sum(map(len, table_of(study, tmp_path)["P [kPa]"].values)) == read
