"""Ctrl-C while a long log is read."""

from __future__ import annotations

from pathlib import Path

import pytest

from mapmore_cli.pipeline.runner import bring_up_to_date
from mapmore_cli.spec.loader import load
from mapmore_cli.storage.artefacts import read_dataset
from mapmore_cli.storage.run_record import load_records

SPEC = """
schema_version: 1
name: long
data: {files: [log.csv], reader: csv, columns: {time: {column: t}, force: {column: F}, strain: {column: eps}}}
target: {column: force}
dictionary: [{terms: [strain]}]
"""
ROWS = 50_000


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "log.csv").write_text("t,F,eps\n" + "".join(f"{i},{i % 7}.25,0.{i % 9}\n" for i in range(ROWS)))
    (tmp_path / "long.yaml").write_text(SPEC)
    return tmp_path


def interrupted_after(calls: int, folder: Path) -> None:
    seen: list[int] = []

    def progress(_what: str, done: int, _total: int) -> None:
        seen.append(done)
        if len(seen) > calls:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        bring_up_to_date(load(folder / "long.yaml"), folder / "runs", until="ingest", progress=progress)


@pytest.mark.parametrize("calls", [0, 1, 3])
def test_nothing_is_left_behind(folder: Path, calls: int) -> None:
    interrupted_after(calls, folder)
    left = {path.name for path in (folder / "runs" / "long").iterdir()}
    assert left <= {".lock", "run.json"}  # the folder is ours, and no stage of it is done
    assert load_records(folder / "runs" / "long", lambda _message: None) == {}


def test_the_results_of_before_stay(folder: Path) -> None:
    run = folder / "runs" / "long"
    bring_up_to_date(load(folder / "long.yaml"), folder / "runs", until="ingest")
    before = {path.name: path.read_bytes() for path in run.iterdir()}
    with (folder / "log.csv").open("a") as log:
        log.write(f"{ROWS},1,0.5\n")
    interrupted_after(2, folder)
    assert {path.name: path.read_bytes() for path in run.iterdir()} == before
    bring_up_to_date(load(folder / "long.yaml"), folder / "runs", until="ingest")
    assert read_dataset(run / "ingest.h5").curves[0].size == ROWS + 1
