"""Real recordings, with all their oddities; skipped where they are not installed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ingest_samples import spec_of

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.ingestion.dataset import build_dataset
from mapmore_cli.ingestion.files import slice_of

PROJECT = Path(__file__).resolve().parents[3]
CLAMPED = {"Unkink": 0.182, "kinked25": 0.1745, "kinked50": 0.167, "kinked75": 0.1595}  # m; 0.182 m at rest


def read(data: dict[str, Any], folder: Path, warnings: list[str] | None = None) -> Dataset:
    return build_dataset(slice_of(spec_of(data)), folder, warn=(warnings if warnings is not None else []).append)


def festo(**changes: Any) -> dict[str, Any]:
    return {
        "files": [
            {"path": f"festo_10mm_isometric/10mm_20cm_{state}_*.csv.gz", "set": {"length": length}} for state, length in CLAMPED.items()
        ],
        "header": False,
        "columns": {"force": {"column": 0}, "pressure": {"column": 1, "unit": "kPa"}, "time": {"column": 2, "unit": "s"}},
        "repeated_time": "average",
        "derive": {
            "strain": "(0.182 - length)/0.182",
            "pressure_rate": {"rate_of": "pressure", "window": 0.1, "order": 2},
        },
        "keep": [{"quantity": "pressure_rate", "abs_below": 25.0}],
        "levels": {"of": "strain", "at": "auto"},
        **changes,
    }


def test_isometric_muscle_gives_four_curves_of_settled_samples(measured_data: Path) -> None:
    warnings: list[str] = []
    dataset = read(festo(split={"validate": {"files": ["*_Test10.csv.gz"]}}), measured_data, warnings)
    assert [curve.id for curve in dataset.curves] == ["strain=0", "strain=0.0412088", "strain=0.0824176", "strain=0.123626"]
    assert [recording.rows_read for recording in dataset.recordings] == [15_000] * 12
    for recording in dataset.recordings:
        assert recording.rows_kept + sum(recording.dropped.values()) == 15_000
        assert recording.rows_kept > 12_000
        assert set(recording.dropped) <= {"repeated time", "|pressure_rate| >= 25 kPa/s"}
    for curve in dataset.curves:
        assert np.abs(curve.columns["pressure_rate"]).max() < 25
        tests = [int(name.rpartition("Test")[2]) for name in curve.recordings]
        assert tests == [10, 8, 9]
        sizes = {r.id: r.rows_kept for r in dataset.recordings}
        np.testing.assert_array_equal(curve.held_out, np.repeat([True, False, False], [sizes[name] for name in curve.recordings]))
    peaks = [curve.columns["force"].max() for curve in dataset.curves]
    assert peaks == sorted(peaks, reverse=True)
    assert warnings == []


def test_repeated_stamps_of_the_logger_are_refused_unless_the_spec_says_what_to_do(measured_data: Path) -> None:
    with pytest.raises(DataError, match=r"10mm_20cm_Unkink_Test10\.csv\.gz:row \d+: the time [\d.]+ stands twice"):
        read(festo(repeated_time="error"), measured_data)


def test_pressure_rate_integrates_to_the_steps_of_the_staircase(measured_data: Path) -> None:
    dataset = read({**festo(), "keep": [], "files": [festo()["files"][0]]}, measured_data)
    for recording in dataset.recordings:
        time, pressure, slope = (recording.columns[name] for name in ("time", "pressure", "pressure_rate"))
        later = time > 1  # the record begins in the middle of a step
        risen = np.concatenate([[0], np.cumsum(np.diff(time) * (slope[1:] + slope[:-1]) / 2)])
        drift = (risen - pressure)[later & (np.abs(slope) < 5)]  # within a step, the window smooths the corner away
        assert np.ptp(drift) < 0.02 * np.ptp(pressure)


def test_every_recording_of_the_muscles_is_read(measured_data: Path) -> None:
    data = festo(files=["festo_10mm_isometric/*.csv.gz"], levels=None, derive={}, keep=[])
    assert len(read(data, measured_data).recordings) == 36


def test_held_strains_of_the_bellows(measured_data: Path) -> None:
    data = {
        "files": ["bellows_tensile/four1.csv.gz"],
        "columns": {
            "time": {"column": "t_s", "unit": "s"},
            "strain": {"column": "strain_pct", "unit": "%"},
            "force": {"column": "force_N_total", "scale": 0.25},
            "pressure": {"column": "pressure_kPa_smoothed", "unit": "kPa"},
        },
        "missing": "drop",
        "levels": {"of": "strain", "at": "auto", "within": 0.005},
    }
    dataset = read(data, measured_data)
    levels = np.array([curve.level for curve in dataset.curves])
    np.testing.assert_allclose(levels, np.linspace(-0.1665, 0.668, 11), atol=2e-3)
    assert dataset.recordings[0].dropped["missing value"] == 2013
    with pytest.raises(DataError, match=r"row 2, column pressure_kPa_smoothed: the value of pressure is missing"):
        read({**data, "missing": "error"}, measured_data)


def test_datasheet_without_time(measured_data: Path) -> None:
    data = {
        "files": ["festo_datasheet/dmsp_20mm.csv"],
        "columns": {
            "pressure": {"column": "pressure_kPa", "unit": "kPa"},
            "strain": {"column": "contraction_frac"},
            "force": {"column": "force_N"},
        },
        "levels": {"of": "pressure", "at": "auto"},
        "split": {"validate": {"quantities": {"pressure": [300.0]}}},
    }
    dataset = read(data, measured_data)
    assert [curve.level for curve in dataset.curves] == [0, 100, 200, 300, 400, 500, 600]
    assert [curve.held_out.all() for curve in dataset.curves] == [False, False, False, True, False, False, False]
    assert sum(curve.size for curve in dataset.curves) == 58


@pytest.mark.parametrize(("muscle", "levels"), [("mckibben", [0, 80, 150, 250, 350]), ("peano", [0, 80, 200, 350, 500])])
def test_levels_of_the_simulated_load_cycles(muscle: str, levels: list[float]) -> None:
    data = {
        "files": [f"datasets/{muscle}/load_cycle_*.csv"],
        "cycles": {"over": "strain", "samples": 100},
        "levels": {"of": "pressure", "at": "auto"},
    }
    dataset = read(data, PROJECT)
    np.testing.assert_allclose([curve.level for curve in dataset.curves], levels, atol=0.6)
    for curve in dataset.curves[1:]:
        assert (curve.columns["hysteresis"][10:-10] > 0).all()
        assert (np.diff(curve.columns["force"]) < 1.0).all()
