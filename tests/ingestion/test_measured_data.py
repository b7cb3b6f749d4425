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
from mapmore_cli.spec.loader import load

PROJECT = Path(__file__).resolve().parents[2]
CLAMPED = {
    "Unkink": 0.182,
    "kinked25": 0.1745,
    "kinked50": 0.167,
    "kinked75": 0.1595,
}  # m; 0.182 m at rest


def read(data: dict[str, Any], folder: Path, warnings: list[str] | None = None) -> Dataset:
    return build_dataset(
        slice_of(spec_of(data)), folder, warn=(warnings if warnings is not None else []).append
    )


def festo(**changes: Any) -> dict[str, Any]:
    return {
        "files": [
            {"path": f"festo_10mm_isometric/10mm_20cm_{state}_*.csv.gz", "set": {"length": length}}
            for state, length in CLAMPED.items()
        ],
        "header": False,
        "columns": {
            "force": {"column": 0},
            "pressure": {"column": 1, "unit": "kPa"},
            "time": {"column": 2, "unit": "s"},
        },
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
    dataset = read(
        festo(split={"validate": {"files": ["*_Test10.csv.gz"]}}), measured_data, warnings
    )
    assert [curve.id for curve in dataset.curves] == [
        "strain=0",
        "strain=0.0412088",
        "strain=0.0824176",
        "strain=0.123626",
    ]
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
        np.testing.assert_array_equal(
            curve.held_out,
            np.repeat([True, False, False], [sizes[name] for name in curve.recordings]),
        )
    peaks = [curve.columns["force"].max() for curve in dataset.curves]
    assert peaks == sorted(peaks, reverse=True)
    assert warnings == []


def test_repeated_stamps_of_the_logger_are_refused_unless_the_spec_says_what_to_do(
    measured_data: Path,
) -> None:
    with pytest.raises(
        DataError, match=r"10mm_20cm_Unkink_Test10\.csv\.gz:row \d+: the time [\d.]+ stands twice"
    ):
        read(festo(repeated_time="error"), measured_data)


def test_pressure_rate_integrates_to_the_steps_of_the_staircase(measured_data: Path) -> None:
    dataset = read({**festo(), "keep": [], "files": [festo()["files"][0]]}, measured_data)
    for recording in dataset.recordings:
        time, pressure, slope = (
            recording.columns[name] for name in ("time", "pressure", "pressure_rate")
        )
        later = time > 1  # the record begins in the middle of a step
        risen = np.concatenate([[0], np.cumsum(np.diff(time) * (slope[1:] + slope[:-1]) / 2)])
        drift = (risen - pressure)[
            later & (np.abs(slope) < 5)
        ]  # within a step, the window smooths the corner away
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
    with pytest.raises(
        DataError, match=r"row 2, column pressure_kPa_smoothed: the value of pressure is missing"
    ):
        read({**data, "missing": "error"}, measured_data)


@pytest.mark.parametrize(
    ("muscle", "levels"), [("mckibben", [0, 80, 150, 250, 350]), ("peano", [0, 80, 200, 350, 500])]
)
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


CONFIGS = Path(__file__).resolve().parents[2] / "configs"


def shipped(
    name: str,
    monkeypatch: pytest.MonkeyPatch,
    folder: Path,
    warnings: list[str] | None = None,
    *changes: str,
) -> Dataset:
    monkeypatch.setenv("MAPMORE_DATA", str(folder))
    loaded = load(CONFIGS / name, changes)
    return build_dataset(
        slice_of(loaded.spec), loaded.folder, warn=(warnings if warnings is not None else []).append
    )


def steps(sample: str, **changes: Any) -> dict[str, Any]:
    """The data section of the studies of the coiled muscle."""
    return {
        "files": [f"coiled_isotonic_steps/{sample} grams.xlsx"],
        "reader": "xlsx",
        "header": False,
        "columns": {
            "time": {"column": 2, "unit": "s"},
            "pressure": {"column": 3, "unit": "psi"},
            "displacement": {"column": 4, "unit": "mm", "scale": -1.0},
        },
        "gaps": {"longer_than": 0.01, "action": "split"},
        "resample": 0.01,
        "split": {"validate": {"last": 0.5}},
        **changes,
    }


def coiled(folder: Path, data: dict[str, Any]) -> Dataset:
    pytest.importorskip("openpyxl")
    spec = spec_of(data, target={"column": "displacement"}, dictionary=[{"terms": ["pressure"]}])
    return build_dataset(slice_of(spec), folder, warn=lambda warning: pytest.fail(warning))


def test_two_logs_of_the_bellows_give_the_pressure_that_was_published(
    measured_data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    levels = "data.levels={of: strain, at: auto, within: 0.005}"
    everywhere = [levels, "data.split={}"]
    raw = shipped("bellows/bellows_raw.yaml", monkeypatch, measured_data, None, *everywhere)
    table = shipped("bellows/bellows_strain.yaml", monkeypatch, measured_data, None, *everywhere)
    ours = {
        name: np.concatenate([r.columns[name] for r in raw.recordings])
        for name in ("time", "pressure", "force", "strain")
    }
    theirs = table.recordings[0].columns
    place = np.searchsorted(theirs["time"], ours["time"] - 1e-6).clip(0, len(theirs["time"]) - 1)
    assert np.isclose(theirs["time"][place], ours["time"], atol=1e-6).mean() > 0.99
    np.testing.assert_allclose(ours["force"], theirs["force"][place], atol=2e-3)
    smooth = np.convolve(
        ours["pressure"], np.full(9, 1 / 9), mode="same"
    )  # they published a moving average
    differences = smooth - theirs["pressure"][place]
    assert np.sqrt(np.mean((ours["pressure"] - theirs["pressure"][place]) ** 2)) < 0.3  # kPa, of 94
    assert np.median(np.abs(differences)) < 0.02
    assert np.ptp(theirs["pressure"]) > 90


def test_what_the_bellows_logs_lack_is_counted(
    measured_data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    warnings: list[str] = []
    raw = shipped("bellows/bellows_raw.yaml", monkeypatch, measured_data, warnings)
    assert len(raw.recordings) == 11
    assert sum(recording.rows_read for recording in raw.recordings) == 34_340
    assert (
        sum(recording.dropped.get("missing value", 0) for recording in raw.recordings) > 9_000
    )  # the logger rests between the holds
    assert "10 gaps longer than 1 s" in raw.notes[0]
    assert [curve.held_out.all() for curve in raw.curves] == [
        curve.level in (0, 0.25, 0.5) for curve in raw.curves
    ]
    assert sum(curve.held_out.all() for curve in raw.curves) == 3


def test_steps_of_the_coiled_muscle_are_split_resampled_and_halved(measured_data: Path) -> None:
    dataset = coiled(measured_data, steps("Sample 1 Final 200"))
    assert [r.rows_read for r in dataset.recordings] == [1000] * 12
    assert {curve.size for curve in dataset.curves} <= {99, 100}
    for curve in dataset.curves:
        np.testing.assert_allclose(np.diff(curve.columns["time"]), 0.01, rtol=1e-9)
    held = [curve.held_out.mean() for curve in dataset.curves]
    assert held == sorted(held)
    assert held[0] == 0
    assert held[-1] == 1
    assert "row 1000: the first of 11 gaps longer than 0.01 s" in dataset.notes[0]
    pressure = np.concatenate([curve.columns["pressure"] for curve in dataset.curves])
    assert 1500 < pressure.max() < 1900  # kPa: steps to 250 psi


def test_block_means_lose_nothing_of_the_slow_movement(measured_data: Path) -> None:
    fine = coiled(measured_data, steps("Sample 1 Final 200", resample=None))
    coarse = coiled(measured_data, steps("Sample 1 Final 200"))
    for before, after in zip(fine.curves, coarse.curves, strict=True):
        covered = before.columns["time"] < after.columns["time"][-1] + 0.005
        assert (
            abs(before.columns["pressure"][covered].mean() - after.columns["pressure"].mean()) < 1
        )  # kPa, of 1700


def test_clock_that_was_set_back_while_logging(measured_data: Path) -> None:
    dataset = coiled(measured_data, steps("Sample 2 Final 500"))
    assert "row 10001: the clock was set back, from 12.1459999 to 11.1669993 s" in dataset.notes[0]
    assert [r.rows_read for r in dataset.recordings] == [1000] * 13


def test_datasheet(measured_data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    dataset = shipped("festo/festo_datasheet.yaml", monkeypatch, measured_data)
    assert "time" not in dataset.quantities
    assert [curve.level for curve in dataset.curves] == [0, 100, 200, 300, 400, 500, 600]
    assert [curve.level for curve in dataset.curves if curve.held_out.all()] == [200, 500]
    assert sum(curve.size for curve in dataset.curves) == 58
