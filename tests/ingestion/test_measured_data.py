"""Real recordings, with all their oddities; skipped where they are not installed."""

from pathlib import Path

import numpy as np
from ingest_samples import spec_of

from mapmore_cli.ingestion.dataset import build_dataset
from mapmore_cli.ingestion.files import slice_of
from mapmore_cli.study.loader import load

PROJECT = Path(__file__).resolve().parents[2]
# m; 0.182 m at rest
CLAMPED = {
    "Unkink": 0.182,
    "kinked25": 0.1745,
    "kinked50": 0.167,
    "kinked75": 0.1595,
}


def read(data, folder, warn=lambda _: None, **more):
    return build_dataset(slice_of(spec_of(data, **more)), folder, warn=warn)


def shipped(name, monkeypatch, folder):
    """A study as it is, but with all of its data at the same levels."""
    monkeypatch.setenv("MAPMORE_DATA", str(folder))
    levels = "data.levels={of: strain, at: auto, within: 0.005}"
    loaded = load(PROJECT / "configs" / name, [levels, "data.split={}"])
    return build_dataset(slice_of(loaded.spec), loaded.folder, warn=lambda _: None)


def test_two_logs_of_the_bellows_give_the_pressure_that_was_published(measured_data, monkeypatch):
    raw, table = (
        shipped(f"bellows/bellows_{name}.yaml", monkeypatch, measured_data)
        for name in ("raw", "strain")
    )
    ours = {
        name: np.concatenate([r.columns[name] for r in raw.recordings])
        for name in ("time", "pressure", "force", "strain")
    }
    theirs = table.recordings[0].columns
    place = np.searchsorted(theirs["time"], ours["time"] - 1e-6).clip(0, len(theirs["time"]) - 1)
    assert np.isclose(theirs["time"][place], ours["time"], atol=1e-6).mean() > 0.99
    np.testing.assert_allclose(ours["force"], theirs["force"][place], atol=2e-3)
    # they published a moving average
    smooth = np.convolve(ours["pressure"], np.full(9, 1 / 9), mode="same")
    differences = smooth - theirs["pressure"][place]
    assert np.sqrt(np.mean((ours["pressure"] - theirs["pressure"][place]) ** 2)) < 0.3  # kPa, of 94
    assert np.median(np.abs(differences)) < 0.02
    assert np.ptp(theirs["pressure"]) > 90
