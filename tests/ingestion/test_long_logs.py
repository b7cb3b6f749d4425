"""Logs that are longer than memory, read block by block."""

import gc
import hashlib
import json

import numpy as np
import pytest
from common import peak_memory
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ingest_samples import COLUMNS, csv_text, spec_of

from mapmore_cli.domain import arrays
from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.ingestion.dataset import build_dataset
from mapmore_cli.ingestion.files import slice_of
from mapmore_cli.modelling.signals.sampling import typical_step
from mapmore_cli.storage.artefacts import hdf5, read_dataset, write_dataset
from mapmore_cli.storage.artefacts.schema import encoded

SAMPLES = 60


def log(seed, fault):
    """Cycles at three pressures, with one fault of the clock or of the values."""
    rng = np.random.default_rng(seed)
    t = np.round(np.cumsum(rng.uniform(0.009, 0.011, SAMPLES)), 4)
    force = np.round(100 * np.sin(np.arange(SAMPLES) / 3) + rng.normal(size=SAMPLES), 3)
    if fault == "gap":
        t[30:] += 5
    elif fault == "reset":
        t[40:] -= t[39]
    elif fault == "repeated":
        t[20:24] = t[20]
    elif fault == "missing":
        force[[7, 50]] = np.nan
    elif fault == "marked":
        force[[0, 59]] = -999
    return csv_text(
        t=t,
        P=np.repeat([80, 150, 250], 20) + np.round(rng.normal(size=SAMPLES), 2),
        eps=np.round(t / 10, 5),
        F=force,
    )


SPLITTING = {"longer_than": 1.0, "action": "split"}
OPTIONS = {
    "every": [1, 2, 7],
    "missing": ["error", "drop", {"tokens": [-999]}],
    "gaps": [None, SPLITTING, {"longer_than": 1.0, "action": "error"}],
    "repeated_time": ["error", "average", "spread"],
    "resample": [None, None, 0.02],
    "levels": [
        None,
        {"of": "pressure"},
        {"of": "pressure", "at": [80, 150]},
        {"of": "pressure", "at": [250], "within": 3},
    ],
    "derive": [
        {},
        {"stiffness": "force/(strain + 0.01)", "half": "exp(-strain)/2"},
        {"strain_rate": {"rate_of": "strain", "window": 0.05}},
    ],
    "split": [
        {},
        {"validate": {"last": 0.2}},
        {"validate": {"strain": {"between": [[0.01, 0.02]]}}},
        {"validate": {"files": ["b.csv"]}},
        {"validate": {"fraction": 0.3, "seed": 4}},
        {"validate": {"pressure": [150]}},
    ],
}
"""Keys of `data`, and what they may say."""

CONDITIONS = [
    {"quantity": "force", "abs_below": 90},
    {"quantity": "strain", "above": 0.01},
    {"quantity": "time", "outside": [0.2, 0.3]},
    {"quantity": "pressure", "between": [0, 200]},
]
FAULTS = ["none", "none", "gap", "reset", "repeated", "missing", "marked"]


def outcome(folder, data):
    """A checksum of everything in the dataset, and the warnings; or the error."""
    warnings = []
    try:
        dataset = build_dataset(slice_of(spec_of(data)), folder, warn=warnings.append)
    except MapmoreError as error:
        return str(error), []
    digest = hashlib.sha256()
    document = encoded(
        dataset,
        Dataset,
        lambda path, value, *_: hdf5.add_to_hash(digest, path, value, value.dtype.str),
        {},
    )
    digest.update(json.dumps(document).encode())
    return digest.hexdigest(), warnings


@pytest.fixture
def spooled(tmp_path):
    gc.collect()  # columns that tests before this one held in a circle are open until then
    folder = tmp_path / "spool"
    folder.mkdir()
    token = arrays.SCRATCH.set(str(folder))
    yield folder
    arrays.SCRATCH.reset(token)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    faults=st.tuples(st.sampled_from(FAULTS), st.sampled_from(FAULTS)),
    options=st.fixed_dictionaries({key: st.sampled_from(words) for key, words in OPTIONS.items()}),
    keep=st.lists(st.sampled_from(CONDITIONS), max_size=2),
    scale=st.sampled_from([{}, {"unit": "kN"}, {"scale": 2.0, "offset": 0.5}, {"rest": 0.05}]),
    constants=st.sampled_from([{}, {"set": {"load": 2.5}}]),
    timed=st.booleans(),
    size=st.integers(1, 25),
)
def test_blocks_give_what_the_whole_gives(
    tmp_path, faults, options, keep, scale, constants, timed, size
):
    columns = {**COLUMNS, "force": {**COLUMNS["force"], **scale}}
    options = {key: value for key, value in options.items() if value is not None}
    if not timed:
        columns = {name: column for name, column in columns.items() if name != "time"}
        options["sample_time"] = 0.01
    for name, fault, seed in zip(("a.csv", "b.csv"), faults, (1, 2), strict=True):
        (tmp_path / name).write_text(log(seed, fault))
    data = {
        "files": [{"path": name, **constants} for name in ("a.csv", "b.csv")],
        "columns": columns,
        "keep": keep,
        **options,
    }
    with pytest.MonkeyPatch.context() as patch:
        at_once = outcome(tmp_path, data)
        patch.setattr(arrays, "ROWS", size)
        patch.setattr(arrays, "LONG", 0)
        block_by_block = outcome(tmp_path, data)
    assert block_by_block == at_once


def test_a_long_log_takes_the_memory_of_its_blocks(tmp_path, spooled, monkeypatch):
    n, rows = 80_000, 2000
    text = "".join(
        f"{i / 100:.2f},{80 + 70 * (i // 1000 % 2)},{i % 1000 / 5000:.4f},{i % 77}.25\n"
        for i in range(n)
    )
    (tmp_path / "a.csv").write_text("t,P,eps,F\n" + text)
    data = {
        "files": ["a.csv"],
        "columns": {**COLUMNS, "force": {"column": "F", "unit": "kN"}},
        "keep": [{"quantity": "strain", "above": 0.001}],
        "derive": {"half": "force/2"},
        "levels": {"of": "pressure", "at": [80, 150]},
        "split": {"validate": {"strain": {"between": [[0.1, 0.12]]}}},
    }
    part = slice_of(spec_of(data))
    monkeypatch.setattr(arrays, "ROWS", rows)
    monkeypatch.setattr(arrays, "LONG", 8 * rows)
    monkeypatch.setattr(hdf5, "HUGE", rows)
    monkeypatch.setattr("mapmore_cli.storage.tables.lines.CHUNK", rows // 4)
    monkeypatch.setattr("mapmore_cli.modelling.signals.sampling.PART", rows // 8)
    # what is imported, and kept for the next time
    write_dataset(tmp_path / "ingest.h5", build_dataset(part, tmp_path))
    peak = peak_memory(lambda: write_dataset(tmp_path / "ingest.h5", build_dataset(part, tmp_path)))
    assert read_dataset(tmp_path / "ingest.h5").recordings[0].rows_kept > 0.9 * n
    one_column = 8 * n
    assert peak < 2 * one_column, (
        "there are five columns, twice, besides row numbers, places and masks"
    )


def test_the_step_of_a_long_record_is_that_of_its_parts(monkeypatch):
    monkeypatch.setattr("mapmore_cli.modelling.signals.sampling.PART", 50)
    time = np.cumsum(np.random.default_rng(0).uniform(0.9, 1.1, 5000))
    assert typical_step(time) == pytest.approx(np.median(np.diff(time)), rel=0.02)
    assert typical_step(np.arange(5000) / 7) == pytest.approx(1 / 7, rel=1e-9)
