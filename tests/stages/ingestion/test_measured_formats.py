"""Recordings of other laboratories in the formats that their loggers write; skipped where they are not installed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ingest_samples import spec_of

from mapmore_cli.domain.recording import Dataset
from mapmore_cli.ingestion.dataset import build_dataset
from mapmore_cli.ingestion.files import slice_of
from mapmore_cli.spec.loader import load

CONFIGS = Path(__file__).resolve().parents[3] / "configs"


def shipped(name: str, monkeypatch: pytest.MonkeyPatch, folder: Path, warnings: list[str] | None = None, *changes: str) -> Dataset:
    monkeypatch.setenv("MAPMORE_DATA", str(folder))
    loaded = load(CONFIGS / name, changes)
    return build_dataset(slice_of(loaded.spec), loaded.folder, warn=(warnings if warnings is not None else []).append)


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


def test_two_logs_of_the_bellows_give_the_pressure_that_was_published(measured_data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    levels = "data.levels={of: strain, at: auto, within: 0.005}"
    everywhere = [levels, "data.split={}"]
    raw = shipped("bellows/bellows_raw.yaml", monkeypatch, measured_data, None, *everywhere)
    table = shipped("bellows/bellows_strain.yaml", monkeypatch, measured_data, None, *everywhere)
    ours = {name: np.concatenate([r.columns[name] for r in raw.recordings]) for name in ("time", "pressure", "force", "strain")}
    theirs = table.recordings[0].columns
    place = np.searchsorted(theirs["time"], ours["time"] - 1e-6).clip(0, len(theirs["time"]) - 1)
    assert np.isclose(theirs["time"][place], ours["time"], atol=1e-6).mean() > 0.99
    np.testing.assert_allclose(ours["force"], theirs["force"][place], atol=2e-3)
    smooth = np.convolve(ours["pressure"], np.full(9, 1 / 9), mode="same")  # they published a moving average
    differences = smooth - theirs["pressure"][place]
    assert np.sqrt(np.mean((ours["pressure"] - theirs["pressure"][place]) ** 2)) < 0.3  # kPa, of 94
    assert np.median(np.abs(differences)) < 0.02
    assert np.ptp(theirs["pressure"]) > 90


def test_what_the_bellows_logs_lack_is_counted(measured_data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    warnings: list[str] = []
    raw = shipped("bellows/bellows_raw.yaml", monkeypatch, measured_data, warnings)
    assert len(raw.recordings) == 11
    assert sum(recording.rows_read for recording in raw.recordings) == 34_340
    assert sum(recording.dropped.get("missing value", 0) for recording in raw.recordings) > 9_000  # the logger rests between the holds
    assert "10 gaps longer than 1 s" in raw.notes[0]
    assert [curve.held_out.all() for curve in raw.curves] == [curve.level in (0, 0.25, 0.5) for curve in raw.curves]
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
        assert abs(before.columns["pressure"][covered].mean() - after.columns["pressure"].mean()) < 1  # kPa, of 1700


def test_clock_that_was_set_back_while_logging(measured_data: Path) -> None:
    dataset = coiled(measured_data, steps("Sample 2 Final 500"))
    assert "row 10001: the clock was set back, from 12.1459999 to 11.1669993 s" in dataset.notes[0]
    assert [r.rows_read for r in dataset.recordings] == [1000] * 13


def test_datasheet(measured_data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    dataset = shipped("festo/festo_datasheet.yaml", monkeypatch, measured_data)
    assert [curve.level for curve in dataset.curves if curve.held_out.all()] == [200, 500]
    assert sum(curve.size for curve in dataset.curves) == 58
