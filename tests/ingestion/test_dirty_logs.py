"""Logs as they were met in laboratories that nobody here had seen: each is read, or told what is wrong with it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.signals.sampling import longest_ascent
from mapmore_cli.study.drafting.recordings import dataset_of
from mapmore_cli.study.drafting.start import start

pytestmark = pytest.mark.usefixtures("quick_families")

COLUMNS = {"time": {"column": "t", "unit": "s"}, "force": {"column": "F", "unit": "N"}}


def table(path: Path, rows: list[str]) -> None:
    path.write_text("\n".join(rows) + "\n")


def test_a_joined_log_with_repeated_and_glitched_stamps_is_read(tmp_path: Path) -> None:
    time = np.arange(300) * 0.01
    table(tmp_path / "force.csv", ["t,F", *(f"{t:.2f},{np.sin(t):.5f}" for t in time)])
    stamps = [f"{t:.2f}" for t in time for _ in (0, 1)]
    stamps[101] = "0.07"  # a glitch back, and one ahead
    stamps[301] = "9.99"
    table(tmp_path / "log.txt", ["t,P", *(f"{stamp},{100 + row / 10:.2f}" for row, stamp in enumerate(stamps))])
    data = {
        "files": ["force.csv"],
        "columns": COLUMNS,
        "join": [{"files": ["log.txt"], "columns": {"time": {"column": "t", "unit": "s"}, "pressure": {"column": "P", "unit": "kPa"}}}],
        "repeated_time": "average",
    }
    with pytest.raises(DataError, match="runs backwards") as refusal:
        dataset_of(data, tmp_path, "force")
    assert "glitches: drop" in str(refusal.value.remedy)
    (recording,) = dataset_of({**data, "glitches": "drop"}, tmp_path, "force").recordings
    wanted = 100 + (2 * np.arange(300) + 0.5) / 10
    assert recording.rows_kept == 300
    assert np.abs(recording.columns["pressure"] - wanted).max() < 0.2


def test_a_clock_that_was_set_back_is_no_glitch(tmp_path: Path) -> None:
    time = np.concatenate([np.arange(200), np.arange(200)]) * 0.01
    table(tmp_path / "force.csv", ["t,F", *(f"{t:.2f},{row}" for row, t in enumerate(time))])
    with pytest.raises(DataError, match="runs backwards"):
        dataset_of({"files": ["force.csv"], "columns": COLUMNS, "glitches": "drop"}, tmp_path, "force")


def test_a_line_with_a_field_too_many_is_left_out_where_the_spec_says_so(tmp_path: Path) -> None:
    rows = ["t,F", *(f"{row},{row * row}" for row in range(20))]
    rows[7] = "6,36,6.5,42"  # two lines run into one
    table(tmp_path / "force.csv", rows)
    data = {"files": ["force.csv"], "columns": COLUMNS}
    with pytest.raises(DataError, match="too many fields") as refusal:
        dataset_of(data, tmp_path, "force")
    assert "missing: drop" in str(refusal.value.remedy)
    (recording,) = dataset_of({**data, "missing": "drop"}, tmp_path, "force").recordings
    assert recording.rows_kept == 19


def test_bars_between_fields_and_a_readme_beside(tmp_path: Path) -> None:
    time = np.arange(400) * 0.01
    drive = 100 + 50 * np.sin(2 * time)
    table(tmp_path / "run_1.txt", [f"{t:.2f}|  {p:.3e}|  {0.001 * p**1.5:.4e}" for t, p in zip(time, drive, strict=True)])
    table(tmp_path / "ReadMe.txt", ["Date 1009", "Trail List", "1. single sine A=5, f=0.1Hz 0g load", "", "2. steps 200g load"])
    found = start(tmp_path, tmp_path)
    (draft,) = found.drafts
    assert draft.data["delimiter"] == "|"
    assert any("ReadMe" in remark for remark in found.remarks)


def test_quoted_numbers_under_two_header_rows_and_a_pressure_log_of_its_own(tmp_path: Path) -> None:
    time = np.arange(600) * 20.0
    pressure = 2 + np.sin(time / 1500)
    strain = 5 * np.sin(time / 400)
    force = 3 * pressure - strain
    header = ["Time,Tensile strain,Force", "(ms),(%),(N)"]
    table(tmp_path / "tester.csv", [*header, *(f'"{t:.4f}","{e:.4f}","{f:.4f}"' for t, e, f in zip(time, strain, force, strict=True))])
    table(tmp_path / "log.txt", ["Time, Pressure", *(f"{int(t)},{p:.3f}" for t, p in zip(time, pressure, strict=True) for _ in (0, 1))])
    (draft, *_) = start(tmp_path, tmp_path).drafts
    assert draft.data["header"] == 2
    assert draft.data["repeated_time"] == "average"
    assert "join" in draft.data


@given(st.lists(st.integers(-20, 20), max_size=40))
def test_the_longest_ascent_never_decreases_and_leaves_out_no_ordered_stamp(stamps: list[int]) -> None:
    time = np.array(stamps, dtype=float)
    kept = longest_ascent(time)
    assert (np.diff(time[kept]) >= 0).all()
    lengths = [1] * len(stamps)  # by every earlier stamp: slow, and plainly right
    for i in range(len(stamps)):
        lengths[i] = 1 + max((lengths[j] for j in range(i) if stamps[j] <= stamps[i]), default=0)
    assert kept.sum() == max(lengths, default=0)
