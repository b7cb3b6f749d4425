"""`init` on made-up campaigns: what the draft says, and that it loads."""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from mapmore_cli.domain.errors import DataError
from mapmore_cli.pipeline.runner import bring_up_to_date
from mapmore_cli.spec.experiment import TargetColumn
from mapmore_cli.spec.loader import LoadedSpec, load
from mapmore_cli.study.drafting.answers import Answers
from mapmore_cli.study.drafting.draft import Draft, Note, to_yaml
from mapmore_cli.study.drafting.groups import patterns
from mapmore_cli.study.drafting.preview import preview
from mapmore_cli.study.drafting.proof import proven
from mapmore_cli.study.drafting.start import start
from mapmore_cli.study.inspection.lint import inspect

PLAIN = "1,10\n2,20\n3,30\n4,40\n"


@pytest.mark.parametrize(
    ("text", "settings", "titles"),
    [
        ("t,P\n" + PLAIN, {}, ("t", "P")),
        (PLAIN, {"header": False}, None),
        ('"t","P"\n' + PLAIN, {}, ("t", "P")),
        ("t;P\n" + PLAIN.replace(",", ";"), {"delimiter": ";"}, ("t", "P")),
        ("t\tP\n" + PLAIN.replace(",", "\t"), {"delimiter": "tab"}, ("t", "P")),
        ("t;P\n1,5;10,5\n2,5;20,5\n3;30\n", {"delimiter": ";", "decimal": ","}, ("t", "P")),
        ("  t   P\n" + PLAIN.replace(",", "   "), {"delimiter": "whitespace"}, ("t", "P")),
        ("t,P\ns,kPa\n" + PLAIN, {"header": 2}, ("t", "P")),
        ("Rig 4\n\nt,P\n" + PLAIN, {"skip_rows": 2}, ("t", "P")),
        ("t,P\n1,\n2,20\n,30\n", {}, ("t", "P")),
        ("t,P\r1,2\r3,4\r", {}, ("t", "P")),
        ("t,P\n" + PLAIN + "5,5", {}, ("t", "P")),
    ],
)
def test_dialects_are_recognised(tmp_path: Path, text: str, settings: dict[str, Any], titles: tuple[str, ...] | None) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(text.encode())
    found = preview(path)
    assert (found.reader, found.settings, found.titles, found.width) == ("csv", settings, titles, 2)
    zipped = tmp_path / "b.csv.gz"
    zipped.write_bytes(gzip.compress(text.encode()))
    assert preview(zipped) == found


@pytest.mark.parametrize("encoding", ["utf-8-sig", "cp1252", "utf-16"])
def test_files_of_older_programs_are_read_as_what_they_look_like(tmp_path: Path, encoding: str) -> None:
    """Umlauts and degree signs of a logger under Windows; a mark at the beginning of UTF-8 needs no word."""
    for number, level in enumerate([100.0, 200.0]):
        strain = np.linspace(0, 0.1, 20)
        force = level * (2 - 10 * strain)
        lines = [f"{level:g};{e:.5f};{f:.3f}".replace(".", ",") for e, f in zip(strain, force, strict=True)]
        (tmp_path / f"r{number}.csv").write_bytes("\n".join(["Prüfdruck P [kPa];eps;Zugkraft F [N] (20 °C)", *lines]).encode(encoding))
    (draft,) = start(tmp_path, tmp_path).drafts
    assert draft.data.get("encoding") == (None if encoding == "utf-8-sig" else encoding)
    spec = tmp_path / "spec.yaml"
    spec.write_text(draft.text(), encoding="utf-8")
    assert inspect(load(spec)).verdict is None
    assert "Prüfdruck" in draft.text()


@pytest.mark.parametrize(
    ("stamp", "delimiter"), [("01.03.2026 12:00:{:06.3f}", ";"), ("2026-03-01T12:00:{:06.3f}+02:00", ","), ("12:00:{:06.3f}", ",")]
)
def test_local_dates_and_times_of_day_are_the_time(tmp_path: Path, stamp: str, delimiter: str) -> None:
    rng = np.random.default_rng(2)
    pressure = 100 + np.cumsum(rng.normal(0, 5, 150))
    for number in range(1):
        rows = [(stamp.format(k / 10), f"{p:.3f}", f"{2 * p + k / 50:.3f}") for k, p in enumerate(pressure)]
        lines = [delimiter.join(row).replace(".", ",") if delimiter == ";" else delimiter.join(row) for row in rows]
        if delimiter == ";":
            lines = [line.replace("01,03,2026", "01.03.2026") for line in lines]
        (tmp_path / f"log_{number}.csv").write_text("\n".join([delimiter.join(["Time", "P [kPa]", "F [N]"]), *lines]) + "\n")
    (draft,) = start(tmp_path, tmp_path).drafts
    assert draft.data["columns"]["time"] == {"column": "Time", "unit": "s"}
    spec = tmp_path / "spec.yaml"
    spec.write_text(draft.text())
    found = inspect(load(spec))
    assert found.verdict is None
    assert found.dataset is not None
    (time, *_) = (recording.columns["time"] for recording in found.dataset.recordings)
    np.testing.assert_allclose(np.diff(time), 0.1, atol=1e-6)


@pytest.mark.parametrize("content", [b"", b"\x00\x01\x02" * 50, b"dear diary\ntoday\n", b"1\n2\n3\n", b"a,b\n", b'"never closed,1\n2,3\n'])
def test_what_is_no_table_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(content)
    with pytest.raises(DataError, match=r"a\.csv"):
        preview(path)
    with pytest.raises(DataError, match="no usable recording"):
        start(tmp_path, tmp_path)


def written(draft: Draft, folder: Path) -> LoadedSpec:
    path = folder / f"{draft.name}.yaml"
    path.write_text(draft.text())
    loaded = load(path)
    assert [issue for issue in inspect(loaded).issues if issue.severity != "hint"] == []
    return loaded


def write(path: Path, header: str, *columns: Any, delimiter: str = ",") -> None:
    table = np.column_stack(np.broadcast_arrays(*columns))
    np.savetxt(path, table, delimiter=delimiter, header=header, comments="", fmt="%.6g")


T = np.arange(0, 20, 0.02)
LOOP = 1 - np.abs(T / 10 - 1)


def isobaric(
    folder: Path, levels: tuple[float, ...] = (100, 200, 300, 400), strain_factor: float = 1.0, header: str = "time_s,P,strain,F"
) -> None:
    for level in levels:
        strain = 0.15 * LOOP
        write(folder / f"pull_{level:g}.csv", header, T, level, strain_factor * strain, level * (2 - 9 * strain) + 0.1)


def test_an_isobaric_campaign(tmp_path: Path) -> None:
    isobaric(tmp_path)
    (draft,) = start(tmp_path, tmp_path).drafts
    spec = written(draft, tmp_path).spec
    assert spec.data.levels is not None
    assert (spec.data.levels.of, spec.data.levels.at) == ("pressure", [100, 200, 300, 400])
    assert spec.data.files == ["pull_*.csv"]
    assert spec.data.cycles is not None
    assert spec.data.cycles.over == "strain"
    assert spec.data.split.hold_out is not None
    assert spec.data.split.hold_out.quantities == {"pressure": [300]}
    assert "found by search: " in draft.text()
    assert "# 4 files, pressure held at 100 200 300 400 kPa" in draft.text()


def test_per_cent_without_a_unit_in_the_name(tmp_path: Path) -> None:
    isobaric(tmp_path, strain_factor=100)
    (draft,) = start(tmp_path, tmp_path).drafts
    assert written(draft, tmp_path).spec.data.columns["strain"].unit == "%"


def test_the_held_strain_in_the_names_of_files(tmp_path: Path) -> None:
    for word, strain in (("slack", 0.0), ("c5", 0.05), ("c10", 0.1), ("c15", 0.15)):
        for repeat in (1, 2):
            steps = 600 * np.floor(10 * LOOP) / 10
            force = 0.7 * np.maximum(steps - 120 - 2000 * strain, 0) + 0.001 * repeat * T
            write(tmp_path / f"m_{word}_run{repeat}.csv", "F,P,t", force, steps, T)
    (draft,) = start(tmp_path, tmp_path).drafts
    spec = written(draft, tmp_path).spec
    text = draft.text()
    assert spec.data.levels is not None
    assert (spec.data.levels.of, spec.data.levels.at) == ("strain", [0, 0.05, 0.1, 0.15])
    assert [keep.quantity for keep in spec.data.keep] == ["pressure_rate"]
    assert "found by search: " in text
    assert "# CHECK: 'slack' has no number: taken as strain 0" in text
    assert "# CHECK: 'c10' taken as strain 10 %: say what was measured" in text


def test_two_muscles_in_one_folder_are_two_studies(tmp_path: Path) -> None:
    for size in ("10cm", "20cm"):
        (tmp_path / size).mkdir()
        isobaric(tmp_path / size)
        for path in sorted((tmp_path / size).iterdir()):
            path.rename(tmp_path / f"{size}_{path.name}")
        (tmp_path / size).rmdir()
    (tmp_path / "notes.csv").write_text("dear diary\n")
    found = start(tmp_path, tmp_path)
    assert [written(draft, tmp_path).spec.data.files for draft in found.drafts] == [["10cm_pull_*.csv"], ["20cm_pull_*.csv"]]
    assert len({draft.name for draft in found.drafts}) == 2
    assert any("notes.csv" in remark for remark in found.remarks)


def test_tests_of_another_kind_in_the_same_folder_are_another_study(tmp_path: Path) -> None:
    for muscle in ("left", "right"):
        (tmp_path / muscle).mkdir()
        isobaric(tmp_path / muscle)
        for path in list((tmp_path / muscle).iterdir()):
            path.with_name(path.name.replace("pull", "slow_pull")).write_text(path.read_text())
    names = [draft.name for draft in start(tmp_path, tmp_path).drafts]
    assert names == ["left-pull", "left-slow_pull", "right-pull", "right-slow_pull"]


def test_what_readers_stumble_over_is_named_in_the_draft(tmp_path: Path) -> None:
    isobaric(tmp_path)
    for path in tmp_path.glob("*.csv"):
        lines = path.read_text().splitlines()
        lines[5], lines[7] = lines[5].rsplit(",", 1)[0] + ",", lines[6]
        path.write_text("\n".join(lines) + "\n")
    (draft,) = start(tmp_path, tmp_path).drafts
    data = written(draft, tmp_path).spec.data
    assert (data.missing, data.repeated_time) == ("drop", "average")
    assert "missing: drop  # 4 samples have an empty cell" in draft.text()


def test_other_dialects_are_written_into_the_spec(tmp_path: Path) -> None:
    isobaric(tmp_path)
    for path in tmp_path.glob("*.csv"):
        path.write_text("Rig 4\n" + path.read_text().replace(",", ";").replace(".", ","))
    (draft,) = start(tmp_path, tmp_path).drafts
    data = written(draft, tmp_path).spec.data
    assert (data.delimiter, data.decimal, data.skip_rows) == (";", ",", 1)


def test_a_backward_clock_is_left_out(tmp_path: Path) -> None:
    isobaric(tmp_path)
    path = tmp_path / "pull_100.csv"
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:5], lines[6], lines[5], *lines[7:]]) + "\n")
    (glitch,) = start(tmp_path, tmp_path).drafts
    assert written(glitch, tmp_path).spec.data.glitches == "drop"
    path.write_text("\n".join([*lines[:5], *lines[40:5:-1], *lines[41:]]) + "\n")
    (draft,) = start(tmp_path, tmp_path).drafts
    assert "time" not in written(draft, tmp_path).spec.data.columns
    assert "time runs backwards" in draft.text()


def test_what_nobody_knows_is_taken_as_it_comes(tmp_path: Path) -> None:
    """No force, no displacement: what is named as a command drives, the last column follows, and both are marked."""
    write(tmp_path / "valve.csv", "t_s,cmd_kPa,sensor_kPa", T, 100 * LOOP, 99 * LOOP**2)
    (draft,) = start(tmp_path, tmp_path).drafts
    spec = written(draft, tmp_path).spec
    assert spec.target == TargetColumn(column="sensor_kPa")
    assert list(spec.data.columns) == ["time", "cmd_kPa", "sensor_kPa"]
    assert draft.text().count("CHECK: taken as what") == 2


def test_a_position_under_pressure_is_a_model_with_memory(tmp_path: Path) -> None:
    lag = np.convolve(LOOP, np.exp(-T[:200] / 0.5) / np.exp(-T[:200] / 0.5).sum())[: len(T)]
    write(tmp_path / "lift.csv", "t_s,pressure_psi,position_mm", T, 60 * LOOP, -8 * lag)
    (draft,) = start(tmp_path, tmp_path).drafts
    spec = written(draft, tmp_path).spec
    assert spec.target == TargetColumn(column="displacement")
    assert spec.data.resample is not None  # even steps: a search tries models with memory
    assert spec.data.split.hold_out is not None
    assert spec.data.split.hold_out.last == 0.5
    (strained,) = start(tmp_path, tmp_path, answers=Answers(length=0.08)).drafts
    assert "-displacement/0.08" in strained.text()
    assert written(strained, tmp_path).spec.target == TargetColumn(column="strain")
    assert "displacement" not in str([strained.spec.get(key) for key in ("dictionary", "model")])


def test_a_force_that_was_set_is_no_target(tmp_path: Path) -> None:
    force = 0.5 * np.concatenate([np.arange(60), np.arange(60, 0, -1)])
    for level in (50, 100, 150, 200, 250):
        strain = 0.3 * (1 - force / (0.25 * level + 30)) * level / 250
        write(tmp_path / f"m_{level}.csv", "pressure_kPa,force_N,strain", level, force, strain + 1e-4 * np.sin(7 * force))
    (draft,) = start(tmp_path, tmp_path).drafts
    spec = written(draft, tmp_path).spec
    assert spec.target == TargetColumn(column="strain")
    assert "the force was set in steps of 0.5 N" in draft.text()


def test_pressures_in_the_names_of_files_without_a_header(tmp_path: Path) -> None:
    for bar in (1, 2, 3, 4):
        place = 20 * LOOP
        write(tmp_path / f"K_{bar}bar.csv", "", 1000 * T, 3 + 0.1 * LOOP, bar + 0.01 * np.sin(T), place, 50 * bar - place)
        path = tmp_path / f"K_{bar}bar.csv"
        path.write_text(path.read_text().lstrip("\n"))
    (draft,) = start(tmp_path, tmp_path).drafts
    spec = written(draft, tmp_path).spec
    assert (spec.data.columns["pressure"].column, spec.data.columns["pressure"].unit) == (2, "bar")
    assert spec.data.levels is not None
    assert spec.data.levels.of == "pressure"


def test_a_line_of_units_and_every_sheet(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.remove(book.active)
    for level in (1.0, 2.0, 3.0, 4.0):
        sheet = book.create_sheet(f"{level:g} bar")
        sheet.append(["time", "P", "eps", "F"])
        sheet.append(["s", "bar", "%", "kN"])
        for t, e in zip(T[::20], LOOP[::20], strict=True):
            sheet.append([float(t), level, float(15 * e), float(level * (0.2 - 0.9 * 0.15 * e))])
    book.save(tmp_path / "all.xlsx")
    (draft,) = start(tmp_path, tmp_path).drafts
    data = written(draft, tmp_path).spec.data
    assert (data.sheet, data.header) == ("*", 2)
    assert [data.columns[name].unit for name in ("pressure", "strain", "force")] == ["bar", "%", "kN"]
    assert data.levels is not None
    assert data.levels.at == [100, 200, 300, 400]


def test_of_sheets_of_different_layout_the_longest_is_read_and_the_others_are_told(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(["Rig 4, operator, remarks"])
    for title, header, count in (("short", ["a", "b", "c"], 5), ("run", ["P [kPa]", "eps", "F [N]"], 60)):
        sheet = book.create_sheet(title)
        sheet.append(header)
        for k in range(count):
            sheet.append([100.0 * (1 + k // 20), 0.005 * (k % 20), 100.0 * (1 + k // 20) * (2 - 0.05 * (k % 20))])
    book.save(tmp_path / "all.xlsx")
    (draft,) = start(tmp_path, tmp_path).drafts
    assert draft.data["sheet"] == "run"
    assert "CHECK: the sheet with the most rows; laid out in another way, and left out: 'Sheet', 'short'" in draft.text()


def test_what_fails_its_own_run_is_made_simpler(tmp_path: Path) -> None:
    """Three samples at each of three pressures: too few for three terms, let alone for segments."""
    for level in (100, 200, 300):
        write(tmp_path / f"p_{level}.csv", "P_kPa,eps,F_N", level, [0.0, 0.1, 0.2], [2.0 * level, 1.1 * level, 0.1 * level])
    (draft,) = start(tmp_path, tmp_path).drafts
    cut = draft.with_section("segment", {"strain": {"method": "even", "count": 2}})
    simpler = proven(cut, tmp_path)
    assert "made simpler" in simpler.text()
    path = tmp_path / "simple.yaml"
    path.write_text(simpler.text())
    bring_up_to_date(load(path), tmp_path / "runs", until="validate")


# Names and text -----------------------------------------------------------------------------------------------------------------------


def test_results_of_runs_are_no_recordings(tmp_path: Path) -> None:
    isobaric(tmp_path)
    results = tmp_path / "runs" / "old"
    results.mkdir(parents=True)
    (results / "run.json").write_text("{}")
    isobaric(results)
    assert len(start(tmp_path, tmp_path).drafts) == 1


def test_patterns_match_their_files_and_no_others(tmp_path: Path) -> None:
    names = ["a_1_up.csv", "a_2_up.csv", "a_1_down.csv", "a_2_down.csv", "[x].csv"]
    files = {name: tmp_path / name for name in names}
    for path in files.values():
        path.write_text(PLAIN)
    assert patterns([files["a_1_up.csv"], files["a_2_up.csv"]], tmp_path) == ["a_*_up.csv"]
    assert patterns([files[name] for name in names[:4]], tmp_path) == ["a_*.csv"]
    assert patterns([files["a_1_up.csv"], files["a_2_down.csv"]], tmp_path) == ["a_1_up.csv", "a_2_down.csv"]
    assert patterns([files["[x].csv"]], tmp_path) == ["[x].csv"]


def test_yaml_says_what_the_dictionary_says() -> None:
    spec = {
        "name": "1e5",
        "data": {"files": ["a b.csv", "${x}.csv"], "header": False, "columns": {"force": {"column": "no: #1", "scale": 0.5}}},
        "n": 3,
    }
    notes = {("data", "files", 0): Note("why " * 60), ("data",): Note("is it?", sure=False)}
    text = to_yaml(spec, notes, ("head",))
    expected = {**spec, "data": {**spec["data"], "files": ["a b.csv", "$${x}.csv"]}}
    assert yaml.safe_load(text) == expected
    assert "# CHECK: is it?" in text
    assert max(map(len, text.splitlines())) <= 132


def test_titles_with_commands_to_a_terminal_are_told_as_text(tmp_path: Path) -> None:
    """In a comment of the draft, they made it no YAML."""
    rows = "".join(f"{i / 10},{100 + 100 * (i // 30)},{i % 30 / 200},{200 - i % 30 - (i // 30) * (i % 7)},{i}\n" for i in range(90))
    (tmp_path / "a.csv").write_text('t,P [kPa],eps,F [N],"\x1b[2J\nb"\n' + rows)
    (draft,) = start(tmp_path, tmp_path).drafts
    assert "\\x1b[2J" in draft.text()
    (tmp_path / "a.yaml").write_text(draft.text())
    load(tmp_path / "a.yaml")
