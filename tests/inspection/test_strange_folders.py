"""Folders as laboratories keep them: what names of folders, lines before titles, remarks and clocks
tell is used.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from recorded import drafted, drafts, write

from mapmore_cli.annexes.drafting.answers import answers_of
from mapmore_cli.annexes.drafting.preview import preview
from mapmore_cli.annexes.drafting.studies import _copies, find_studies
from mapmore_cli.domain.errors import DataError

STRAIN = np.linspace(0.0, 0.15, 40)
THERE_AND_BACK = np.concatenate([STRAIN, STRAIN[::-1]])
T = 0.01 * np.arange(3000)


def force(bar, strain):
    return 40 * bar * (1 - 3 * strain) - 100 * strain


def test_names_of_files_say_what_tests(tmp_path):
    for name, speed in (("train_1", 1.0), ("train_2", 1.3), ("validation_1", 1.15)):
        t = 0.02 * np.arange(1500)
        pressure = 200 + 100 * np.sin(speed * t) * np.cos(0.31 * t)
        write(
            tmp_path / f"{name}.csv",
            (t, pressure, np.tanh(pressure / 200)),
            "time,pressure_kPa,bend\n",
        )
    asked = drafts(tmp_path, ask=lambda _: "")[0]
    assert (
        drafted(tmp_path).data["split"]
        == asked.data["split"]
        == {"validate": {"files": ["validation_1.csv"]}}
    )


@pytest.mark.parametrize(
    ("names", "left_out"),
    [
        (["Calibration_1", "load_1", "tara"], ["Calibration_1", "tara"]),
        (["calibration_1", "calibration_2"], []),  # they are the tests
        (["recalibration", "target"], []),
    ],
)
def test_files_for_sensors_are_left_out_beside_tests(tmp_path, names, left_out):
    for number, name in enumerate(names):
        (tmp_path / f"{name}.csv").write_text(f"P,F\n1,2\n3,{number}\n")
    ((study,), reasons) = find_studies(tmp_path)
    assert [
        reason.partition(".csv: was recorded for a sensor")[0] for reason in reasons
    ] == left_out
    assert len(study.files) == len(names) - len(left_out)


@pytest.mark.parametrize("suffix", [".log", ".asc", ".txt"])
def test_comments_between_the_rows_of_a_serial_log_are_left_out(tmp_path, suffix):
    for number in range(3):
        u = 50 + 40 * np.sin((0.9 + 0.1 * number) * T[:500])
        lines = ["# logger v2", "ms\tpressure_kPa\tangle_deg"]
        for at, (pressure, angle) in enumerate(zip(u, np.roll(u, 3) / 9, strict=True)):
            lines += ["# valve open"] * (at in (120, 400))
            lines.append(f"{20 * at + 1234}\t{pressure:.2f}\t{angle:.3f}")
        (tmp_path / f"COM3_{number}{suffix}").write_text("\n".join([*lines, "31240\t4"]))
    draft = drafted(tmp_path)
    assert draft.data["comment"] == "#"
    assert [*draft.data["columns"]] == ["time", "pressure", "angle"]
    assert len(draft.data["files"]) == 1


def test_parts_of_a_clock_are_no_recordings(tmp_path):
    u, whole = 50 + 40 * np.sin(T[:900]), np.arange(900)
    columns = (whole // 100, 10.0 * (whole % 100), u, np.roll(u, 3))
    write(tmp_path / "log.csv", columns, "s,ms,p [kPa],angle [deg]\n")
    assert not drafted(tmp_path).tips


@pytest.mark.parametrize("label", ["Count:", "Anzahl"])
def test_lines_above_the_numbers_may_say_at_their_beginning_what_they_hold(tmp_path, label):
    """As exports of TDM files: the first column is empty below, and one line holds counts."""
    u = 50 + 40 * np.sin(T[:300])
    head = f"Name\tTime\tDruck\tWinkel\nUnit:\t\tmbar\t°\n{label}\t300\t300\t300\n"
    rows = zip(T[:300], u, np.roll(u, 3), strict=True)
    lines = [f"\t14:02:{10 + t:06.3f}\t{p:.3f}\t{angle:.3f}" for t, p, angle in rows]
    (tmp_path / "log.txt").write_text(head + "\n".join(lines), encoding="utf-8")
    (tmp_path / "short").mkdir()
    (tmp_path / "short/log.txt").write_text(head + "\n".join(lines[:5]), encoding="utf-8")
    assert preview(tmp_path / "short/log.txt").titles == ("", "Time", "Druck", "Winkel")
    columns = drafted(tmp_path / "log.txt").data["columns"]
    units = {one["column"]: one["unit"] for one in columns.values()}
    assert units == {"Time": "s", "Druck": "mbar", "Winkel": "deg"}


def test_a_column_that_is_empty_below_the_titles_is_no_column_of_numbers(tmp_path):
    """Numbers in the lines before the titles do not make it one."""
    lines = ["1,2,3"] * 6 + ["P [kPa],F [N],note"] + ["1,2,", "2,4,", "3,6,"]
    (tmp_path / "a.csv").write_text("\n".join([*lines, ""]))
    assert preview(tmp_path / "a.csv").numeric == (0, 1)


def test_dates_are_in_seconds_whatever_stands_above_them(tmp_path):
    u = 50 + 40 * np.sin(T[:300])
    rows = zip(T[:300], u, np.roll(u, 3), strict=True)
    lines = [f"12.03.2024 14:02:{10 + t:06.3f};{p:.2f};{angle:.2f}" for t, p, angle in rows]
    head = ["Datum;Druck;Winkel", "dd.mm.yyyy hh:mm:ss,fff;bar;deg"]
    (tmp_path / "log.csv").write_text("\n".join([*head, *lines]))
    assert "is it s?" not in drafted(tmp_path).text()


def test_what_names_say_is_no_second_input_beside_its_measurement(tmp_path):
    """The pressures in names are those that were wanted; a person names the measured one."""
    for psi in (10, 20, 30, 40):
        measured = psi + 0.05 * np.sin(np.arange(80))
        own = force(psi / 14.5, THERE_AND_BACK)
        columns = (0.1 * np.arange(80), psi, measured, 200 * THERE_AND_BACK, own)
        head = "Time (s),Pressure_cmd,Pressure_meas,Extension (mm),Load (N)\n"
        write(tmp_path / f"{psi}psi_run1.csv", columns, head)
    said = answers_of(target="Load (N)", inputs="Pressure_meas:psi,Extension (mm)")
    draft = drafted(tmp_path, answers=said)
    assert draft.data["levels"]["of"] == "Pressure_meas"
    assert "set" not in str(draft.data["files"])


def test_files_of_office_programs_are_passed_over(tmp_path):
    u = 50 + 40 * np.sin(T[:600])
    write(tmp_path / "log.csv", (T[:600], u, np.roll(u, 3)), "t [s],p [kPa],angle [deg]\n")
    for name in ("~$log.xlsx", "Thumbs.db", ".hidden.csv"):
        (tmp_path / name).write_bytes(b"x")
    (study,), left_out = find_studies(tmp_path)
    assert (study.names, left_out) == (["log"], [])


def test_a_copy_in_another_folder_is_named_with_its_folder(tmp_path):
    u = 50 + 40 * np.sin(T[:600])
    for name in ("a/run.csv", "beside/run.csv"):
        (tmp_path / name).parent.mkdir()
        write(tmp_path / name, (T[:600], u, np.roll(u, 3)), "t [s],p [kPa],angle [deg]\n")
    why = "beside/run.csv: has the same contents as a/run.csv"
    assert find_studies(tmp_path)[1] == [why]


def test_a_copy_of_a_file_is_left_out_by_name(tmp_path):
    u = 50 + 40 * np.sin(T[:600])
    for number in range(3):
        columns = (T[:600], u + number, np.roll(u, 3))
        write(tmp_path / f"bend_{number}.csv", columns, "t [s],p [kPa],angle [deg]\n")
    copy = tmp_path / "bend_1 - Copy.csv"
    copy.write_bytes((tmp_path / "bend_1.csv").read_bytes())
    assert find_studies(tmp_path)[1] == ["bend_1 - Copy.csv: has the same contents as bend_1.csv"]
    draft = drafted(tmp_path)
    assert draft.data["skip_bad_files"] == [copy.name]
    assert draft.data["split"] == {"validate": {"recordings": ["bend_1"]}}
    copy.write_bytes(copy.read_bytes()[:-2] + b"7\n")  # is of the same size and time
    os.utime(copy, ns=(0, 0))
    os.utime(tmp_path / "bend_1.csv", ns=(0, 0))
    assert find_studies(tmp_path)[1] == []


@pytest.mark.parametrize("copy", [".snapshot/bend.csv", "bend.bak", "old/run/bend.csv"])
def test_a_copy_that_is_not_read_is_no_reason_to_leave_a_file_out(tmp_path, copy):
    """It is hidden, has no reader, or lies in the folder of a run."""
    u = 50 + 40 * np.sin(T[:600])
    write(tmp_path / "own" / "bend.csv", (T[:600], u, np.roll(u, 3)), "t [s],p [kPa],angle [deg]\n")
    place = tmp_path / copy
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_bytes((tmp_path / "own" / "bend.csv").read_bytes())
    if "run" in copy:
        (place.parent / "run.json").write_text("{}")
    (study,), left_out = find_studies(tmp_path)
    assert [file.name for file in study.files] == ["bend.csv"]
    assert left_out == []


@pytest.mark.parametrize("mark", ["%", "#"])
def test_remarks_with_numbers_stand_between_titles_and_numbers(tmp_path, mark):
    head = f"{mark} t[s] p[kPa] angle[deg]\n{mark} speed = 3 mm/s\n"
    u = 50 + 40 * np.sin(T[:600])
    write(tmp_path / "log.txt", (T[:600], u, np.roll(u, 3)), head, "   ")
    columns = drafted(tmp_path).data["columns"]
    assert [(one["column"], one["unit"]) for one in columns.values()] == [
        (0, "s"),
        (1, "kPa"),
        (2, "deg"),
    ]


@pytest.mark.parametrize(("label", "mark"), [("{}={}", ","), ("{}: {}", ", "), ("{}:{}", "\t")])
def test_labelled_values_are_refused_with_a_command_that_keeps_their_names(tmp_path, label, mark):
    rows = [{"t": k, "p": 2.5 * k, "F": -k} for k in range(40)]
    lines = [mark.join(label.format(*one) for one in row.items()) for row in rows]
    (tmp_path / "serial.csv").write_text("\n".join(lines) + "\n")
    with pytest.raises(DataError) as refused:
        drafted(tmp_path)
    command = refused.value.remedy.split("for example with: ")[1]
    subprocess.run(command, shell=True, cwd=tmp_path, check=True)
    assert preview(tmp_path / "serial_table.csv").titles == ("t", "p", "F")


@pytest.mark.parametrize("mark", [",", ";", "\t", " "])
def test_arrows_behind_stamps_are_refused_with_a_command_that_leaves_them_out(tmp_path, mark):
    """As the serial monitor of the Arduino writes them; other lines are left out, too."""
    lines = ["10:21:30.001 -> Booting..."]
    lines += [f"10:21:31.{k:03} -> {2.5 * k:.2f}{mark}{-k}" for k in range(40)]
    (tmp_path / "serial.csv").write_text("\n".join(lines) + "\n")
    with pytest.raises(DataError) as refused:
        drafted(tmp_path)
    command = refused.value.remedy.split("for example with: ")[1]
    subprocess.run(command, shell=True, cwd=tmp_path, check=True)
    assert len(preview(tmp_path / "serial_table.csv").numeric) == 3


def test_names_behind_an_arrow_get_no_command_that_leaves_every_line_out(tmp_path):
    lines = (f"10:21:31.{k:03} -> p:{k},F:{-k}\n" for k in range(40))
    (tmp_path / "serial.csv").write_text("".join(lines))
    with pytest.raises(DataError, match="no table of numbers was found"):
        preview(tmp_path / "serial.csv")


def lines_of_levels(line, bars=(1.0, 2.0, 3.0)):
    """The lines of recordings at these pressures, made by `line(bar, strain, force)`."""
    return [[line(bar, x, force(bar, x)) for x in THERE_AND_BACK] for bar in bars]


@pytest.mark.parametrize("mark", [" ", "\u00a0", "\u202f", "'", "."])
def test_separators_of_thousands_are_read_as_such(tmp_path, mark):
    def line(bar, strain, force):
        cells = (f"{x:,.2f}" for x in (1000 * bar, 100 * strain, 1000 * force))
        return ";".join(x.replace(".", ";").replace(",", mark).replace(";", ",") for x in cells)

    for at, lines in enumerate(lines_of_levels(line)):
        text = "\n".join(["pressure [mbar];strain [%];force [mN]", *lines])
        (tmp_path / f"a{at}.csv").write_text(text + "\n", encoding="utf-8")
    draft = drafted(tmp_path)
    columns = draft.data["columns"]
    assert [columns[name]["unit"] for name in ("pressure", "strain", "force")] == [
        "mbar",
        "%",
        "mN",
    ]
    assert [np.max(draft.raw["pressure [mbar]"][at]) for at in range(3)] == [1000, 2000, 3000]


def test_quoted_numbers_may_have_the_comma_that_separates_the_columns(tmp_path):
    def line(*cells):
        return ",".join(f'"{x:.3f}"'.replace(".", ",") for x in cells)

    (lines,) = lines_of_levels(line, (2.0,))
    (tmp_path / "a.csv").write_text("\n".join(["p [bar],strain,F [N]", *lines]) + "\n")
    layout = preview(tmp_path / "a.csv")
    assert (layout.settings, layout.numeric) == ({"decimal": ","}, (0, 1, 2))


def test_a_column_whose_cells_hold_units_is_marked_if_it_is_left_out(tmp_path):
    (lines,) = lines_of_levels(lambda p, x, f: f"{p + x:.3f},{100 * x:.2f}%,{f:.3f},N", (2.0,))
    (tmp_path / "a.csv").write_text("\n".join(["p [bar],strain,F [N],flag", *lines]) + "\n")
    note = drafted(tmp_path).notes["data", "columns"]
    assert not note.sure
    assert "'0.00%' is not a number: it is followed by a unit; remove the unit" in note.why


def test_a_table_of_cells_with_units_is_refused_with_the_reason(tmp_path):
    (lines,) = lines_of_levels(lambda p, x, f: f"{p} bar,{x:.3f} m,{f:.3f} N", (2.0,))
    (tmp_path / "a.csv").write_text("\n".join(["p,x,F", *lines]) + "\n")
    with pytest.raises(
        DataError, match=r"because '2\.0 bar' is not a number: it is followed by a u"
    ):
        preview(tmp_path / "a.csv")


def test_joined_files_with_comments_are_several_tables_with_titles(tmp_path):
    tables = lines_of_levels(lambda p, x, f: f"{p:.3f},{x:.4f},{f:.3f}")
    parts = ["\n".join(["p [bar],strain,F [N]", *one[:50], "# note", *one[50:]]) for one in tables]
    text = "".join(f"\ufeff{part}\n" for part in parts)
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    layout = preview(tmp_path / "a.csv")
    assert layout.tables == (1, 2, 3)
    assert (layout.titles, layout.settings) == (("p [bar]", "strain", "F [N]"), {"comment": "#"})


def test_a_line_of_settings_above_the_titles_has_no_titles(tmp_path):
    (lines,) = lines_of_levels(lambda p, x, f: f"{p},{x:.3f},{f:.3f},0", (2.0,))
    head = ["gain,2 mV/V,full scale,500 N", "p [bar],strain,F [mV/V],x"]
    (tmp_path / "a.csv").write_text("\n".join([*head, *lines]) + "\n")
    layout = preview(tmp_path / "a.csv")
    assert layout.titles == ("p [bar]", "strain", "F [mV/V]", "x")
    assert layout.settings == {"skip_rows": 1}


def test_only_files_of_equal_size_are_compared(tmp_path, monkeypatch):
    for name, text in (("a", ""), ("b", ""), ("long", "12"), ("x", "3"), ("y", "4")):
        (tmp_path / name).write_text(text)
    opened = []
    whole = Path.open
    monkeypatch.setattr(Path, "open", lambda one, *a: opened.append(one.name) or whole(one, *a))
    assert _copies(tmp_path.iterdir()) == {}
    assert opened == ["x", "y"]
