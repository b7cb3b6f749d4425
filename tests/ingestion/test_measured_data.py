"""Real recordings, with all their oddities; skipped where they are not installed."""

from pathlib import Path

import numpy as np
import pytest
from ingest_samples import spec_of

from mapmore_cli.domain.errors import DataError
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


def festo(**changes):
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


def test_repeated_stamps_of_the_logger_are_refused_unless_the_spec_says_what_to_do(
    measured_data,
):
    with pytest.raises(
        DataError, match=r"10mm_20cm_Unkink_Test10\.csv\.gz:row \d+: the time [\d.]+ stands twice"
    ):
        read(festo(repeated_time="error"), measured_data)


def test_every_recording_of_the_muscles_is_read(measured_data):
    data = festo(files=["festo_10mm_isometric/*.csv.gz"], levels=None, derive={}, keep=[])
    assert len(read(data, measured_data).recordings) == 36


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


def test_clock_that_was_set_back_while_logging(measured_data):
    pytest.importorskip("openpyxl")
    data = {
        "files": ["coiled_isotonic_steps/Sample 2 Final 500 grams.xlsx"],
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
    }
    dataset = read(
        data,
        measured_data,
        pytest.fail,
        target={"column": "displacement"},
        dictionary=[{"terms": ["pressure"]}],
    )
    assert "row 10001: the clock was set back, from 12.1459999 to 11.1669993 s" in dataset.notes[0]
    assert [r.rows_read for r in dataset.recordings] == [1000] * 13
