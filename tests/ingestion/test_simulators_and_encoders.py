"""Logs as other programs leave them: Simulink's structs and arrays, objects of MATLAB, notes in workbooks, tables in a row, encoders."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
from hypothesis import given
from hypothesis import strategies as st
from reading import opaque_mat

from mapmore_cli.domain.errors import DataError
from mapmore_cli.ingestion.samples import unwrapped
from mapmore_cli.spec.loader import load
from mapmore_cli.study.drafting import start as drafting
from mapmore_cli.study.drafting.draft import Draft
from mapmore_cli.study.inspection.lint import inspect

pytestmark = pytest.mark.usefixtures("quick_families")

T = 0.02 * np.arange(700)
PRESSURE = 200 + 100 * np.sin(T) + 50 * np.sin(2.3 * T)
POSITION = 0.05 * np.convolve(PRESSURE, np.exp(-np.arange(200) / 30) / 30)[: T.size]


@pytest.fixture(autouse=True)
def _without_search(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drafting, "proven", lambda draft, _: draft)


def signal(values: Any, label: str, block: str) -> dict[str, Any]:
    return {"values": values[:, None], "dimensions": 1.0, "label": label, "blockName": block}


def taken(draft: Draft) -> dict[str, tuple[Any, Any]]:
    return {name: (one["column"], one.get("unit")) for name, one in draft.data["columns"].items()}


def read(draft: Draft, folder: Path) -> dict[str, np.ndarray]:
    """The columns of the recording that a draft reads."""
    path = folder / "spec.yaml"
    path.write_text(draft.text())
    found = inspect(load(path))
    assert found.dataset is not None
    (recording,) = found.dataset.recordings
    return dict(recording.columns)


def test_a_scope_of_simulink_is_one_log_by_its_labels(tmp_path: Path) -> None:
    signals = np.zeros((1, 2), dtype=[(name, object) for name in ("values", "dimensions", "label", "blockName")])
    for place, one in enumerate([signal(PRESSURE, "P [kPa]", "rig/Scope"), signal(POSITION, "x [mm]", "rig/Scope")]):
        for key, value in one.items():
            signals[0, place][key] = value
    scipy.io.savemat(tmp_path / "scope.mat", {"ScopeData": {"time": T[:, None], "signals": signals}, "tout": T[:, None]})
    (draft,) = drafting.start(tmp_path, tmp_path).drafts
    assert taken(draft) == {
        "time": ("ScopeData.time", "s"),
        "pressure": ("ScopeData.signals[0].values", "kPa"),
        "displacement": ("ScopeData.signals[1].values", "mm"),
    }
    np.testing.assert_allclose(read(draft, tmp_path)["displacement"], POSITION / 1000, rtol=1e-6)


def test_structs_with_time_of_each_variable_are_one_log_by_their_names(tmp_path: Path) -> None:
    logged = {
        name: {"time": T[:, None], "signals": signal(values, "", f"rig/{name}")}
        for name, values in (("pressure_kPa", PRESSURE), ("position_mm", POSITION))
    }
    scipy.io.savemat(tmp_path / "log.mat", logged)
    (draft,) = drafting.start(tmp_path, tmp_path).drafts
    assert taken(draft)["pressure"] == ("pressure_kPa.signals.values", "kPa")
    assert taken(draft)["displacement"] == ("position_mm.signals.values", "mm")


def test_arrays_to_workspace_have_tout_for_a_clock(tmp_path: Path) -> None:
    scipy.io.savemat(tmp_path / "out.mat", {"tout": T[:, None], "pressure_kPa": PRESSURE[:, None], "position_mm": POSITION[:, None]})
    (draft,) = drafting.start(tmp_path, tmp_path).drafts
    assert taken(draft)["time"] == ("tout", "s")
    assert draft.notes[("data", "columns", "time")].sure


def test_a_timetable_alone_is_refused_with_the_line_that_converts_it(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "log.mat", "w") as file:
        log = file.create_dataset("log", data=np.array([[0xDD000000, 2, 1, 1, 1, 1]], dtype=np.uint32))
        log.attrs["MATLAB_class"], log.attrs["MATLAB_object_decode"] = b"timetable", np.int32(3)
    with pytest.raises(DataError) as caught:
        drafting.start(tmp_path, tmp_path)
    assert "'log' is an object of MATLAB (timetable)" in str(caught.value)
    assert "table2struct" in str(caught.value)
    opaque_mat(tmp_path / "log.mat", "log", "timetable", T)
    with pytest.raises(DataError, match="no usable recording"):
        drafting.start(tmp_path, tmp_path)


def test_several_tables_of_a_text_file_are_recordings_of_one_study(tmp_path: Path) -> None:
    def rows(count: int) -> str:
        return "\n".join(f"{t:.3f}\t{p:.4f}\t{x:.5f}" for t, p, x in zip(T[:count], PRESSURE, POSITION, strict=False))

    head = "Time [s]\tPressure [kPa]\tPosition [mm]"
    text = f"*TENSILE*\nOperator: me\n\nSpeed\t5 mm/s\n\nTable 1\n{head}\n{rows(300)}\n\nTable 2\n{head}\n{rows(700)}\n\n"
    (tmp_path / "test.txt").write_text(text)
    (draft,) = drafting.start(tmp_path, tmp_path).drafts
    assert {name: unit for name, (_, unit) in taken(draft).items()} == {"time": "s", "pressure": "kPa", "displacement": "mm"}
    path = tmp_path / "spec.yaml"
    path.write_text(draft.text())
    found = inspect(load(path))
    assert found.dataset is not None
    assert [len(one.columns["time"]) for one in found.dataset.recordings] == pytest.approx([300, 700], abs=1)


def test_notes_in_a_workbook_hide_neither_titles_nor_numbers(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in (["Operator", "me"], ["length mm", 88]):
        book.active.append(row)
    sheet = book.create_sheet("Data")
    for row in (["Test 12"], [], ["Time [s]", "Pressure [kPa]", "Position [mm]", "Remarks"]):
        sheet.append(row)
    for number, values in enumerate(zip(T[:300], PRESSURE, POSITION, strict=False)):
        sheet.append([*map(float, values), *(["valve opened"] if number == 50 else [])])
    sheet.cell(row=8, column=7, value="the sensor was replaced")
    sheet.cell(row=9, column=7, value=3.5)
    book.save(tmp_path / "book.xlsx")
    (draft,) = drafting.start(tmp_path, tmp_path).drafts
    assert {name: unit for name, (_, unit) in taken(draft).items()} == {"time": "s", "pressure": "kPa", "displacement": "mm"}
    np.testing.assert_allclose(read(draft, tmp_path)["pressure"], PRESSURE[:300], rtol=1e-12)


@given(
    steps=st.lists(st.integers(-1500, 1500), min_size=1, max_size=60),
    first=st.integers(0, 4095),
    missing=st.sets(st.integers(0, 59), max_size=3),
)
def test_an_encoder_that_wraps_goes_on(steps: list[int], first: int, missing: set[int]) -> None:
    """A gap may be two steps long, and its sum more than half a turn: then nothing can tell, and no gap is made there."""
    whole = first + np.cumsum([0, *steps]).astype(float)
    read_off = np.mod(whole, 4096)
    gaps = [place for place in missing if 0 < place < whole.size - 1 and abs(whole[place + 1] - whole[place - 1]) < 2048]
    gaps = [place for place in gaps if place - 1 not in gaps and place + 1 not in gaps]
    read_off[gaps] = np.nan
    known = np.isfinite(read_off)
    np.testing.assert_allclose(unwrapped(read_off, 4096)[known], whole[known])


def test_a_wrapping_encoder_is_seen_and_unwrapped(tmp_path: Path) -> None:
    angle = 250 + 3 * np.cumsum(np.sin(0.6 * T))
    assert np.ptp(np.floor(angle / 360)) >= 1
    rows = np.column_stack([T, PRESSURE, np.mod(angle, 360)])
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header="t [s],P [kPa],angle", comments="", fmt="%.8g")
    (draft,) = drafting.start(tmp_path, tmp_path).drafts
    assert draft.data["columns"]["angle"]["unwrap"] == 360
    assert not draft.notes[("data", "columns", "angle")].sure
    np.testing.assert_allclose(read(draft, tmp_path)["angle"][20:200], angle[20:200], rtol=1e-3)
    plain = np.column_stack([T, PRESSURE, 90 + 80 * np.sin(T)])
    np.savetxt(tmp_path / "log.csv", plain, delimiter=",", header="t [s],P [kPa],angle", comments="", fmt="%.8g")
    (draft,) = drafting.start(tmp_path, tmp_path).drafts
    assert all("unwrap" not in one for one in draft.data["columns"].values())
