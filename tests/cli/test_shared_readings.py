"""Recordings that several runs read in the same way are read once, and never more is shared than is
the same.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from cli_samples import write_study
from workers_here import Here

from mapmore_cli.annexes.campaigns.batch import Finished, Job, planned, run_all, run_one
from mapmore_cli.ingestion import dataset
from mapmore_cli.spec.loader import load


@pytest.fixture
def reads(monkeypatch) -> list[Path]:
    """The folders of the specs whose recordings were read."""
    found: list[Path] = []
    build = dataset.build_dataset

    def counted(part: Any, folder: Path, **options: Any) -> Any:
        found.append(folder)
        return build(part, folder, **options)

    monkeypatch.setattr(dataset, "build_dataset", counted)
    return found


SETTINGS = {
    "one": ["fit.max_terms=1"],
    "two": ["fit.max_terms=2"],
    "other": ["data.split={validate: {pressure: [300]}}"],
}


def campaign(folder: Path, rivals: str = "polynomial_2", force: bool = False) -> list[Job]:
    spec = write_study(folder, "base")
    spec.write_text(spec.read_text().replace("[polynomial_2]", f"[{rivals}]"))
    jobs = [
        Job(spec, folder / "runs", (f"name={name}", *settings), force)
        for name, settings in SETTINGS.items()
    ]
    return planned(jobs, [load(job.config, job.overrides) for job in jobs])


def done(jobs: Sequence[Job]) -> list[Finished]:
    results = dict(run_all(jobs, Here()))
    assert all(isinstance(result, Finished) for result in results.values()), results
    return [results[number] for number in range(len(jobs))]


def test_one_reading_for_all_runs_and_variations(tmp_path, reads):
    varied = "{set: {fit.max_terms: 1}, as: short}"
    jobs = campaign(tmp_path, varied)
    assert [(job.leader, job.leads) for job in jobs] == [("one", True), ("one", False), ("", False)]
    assert [run.stages["ingest"] for run in done(jobs)] == ["done"] * 3
    assert len(reads) == 2
    for job, name in zip(jobs[1:], ["two", "other"], strict=True):
        alone = run_one(replace(job, runs=tmp_path / "alone", leader="", leads=False))
        assert (tmp_path / "runs" / name / "scores.json").read_bytes() == (
            alone.run_dir / "scores.json"
        ).read_bytes()
    assert [run.stages["ingest"] for run in done(campaign(tmp_path, varied))] == ["up-to-date"] * 3


def test_runs_that_took_longest_come_first(tmp_path):
    """Those of which nothing is known before all, in the order that is given."""
    done(campaign(tmp_path)[:2])
    for name, seconds in (("one", 1.0), ("two", 50.0)):
        record = tmp_path / "runs" / name / "run.json"
        document = json.loads(record.read_text())
        for stage in document["stages"].values():
            stage["seconds"] = seconds
        record.write_text(json.dumps(document))
    again = campaign(tmp_path)
    assert [job.seconds for job in again] == [6.0, 300.0, math.inf]
    results = list(run_all(again, Here()))
    assert [number for number, _ in results] == [2, 1, 0]
    assert [results[place][1].name for place in (2, 1, 0)] == ["one", "two", "other"]
    unknown = [replace(job, seconds=math.inf) for job in again]
    assert [number for number, _ in run_all(unknown, Here())] == [0, 1, 2]


def test_forced_runs_read_for_themselves(tmp_path, reads):
    done(campaign(tmp_path, force=True)[:2])
    assert len(reads) == 2


def test_what_differs_is_not_shared(tmp_path, reads):
    first, second, _ = campaign(tmp_path)
    third = replace(second, overrides=("name=three",))
    run_one(first)
    file = tmp_path / "runs" / "one" / "ingest.h5"
    file.write_bytes(file.read_bytes()[:-1] + b"?")
    run_one(second)  # not the file that the leader wrote
    assert len(reads) == 2
    recording = tmp_path / "base_100.csv"
    recording.write_text(recording.read_text() + "100,0.09,100\n")
    run_one(third)  # not the recordings that the leader read
    assert len(reads) == 3
    assert (tmp_path / "runs" / "two" / "ingest.h5").read_bytes() != (
        tmp_path / "runs" / "three" / "ingest.h5"
    ).read_bytes()


def test_warnings_of_a_reading_are_told_of_every_run(tmp_path):
    (tmp_path / "few").mkdir()
    spec = write_study(tmp_path, "base")
    (tmp_path / "base_150.csv").write_text("P,eps,F\n100,0.01,150\n100,0.02,140\n")
    jobs = [
        Job(spec, tmp_path / "runs", (f"name={name}", "data.levels.within=10"))
        for name in ("a", "b")
    ]
    both = done(planned(jobs, [load(job.config, job.overrides) for job in jobs]))
    assert both[0].warnings == both[1].warnings
    assert any("base_150.csv: holds only 2 samples" in warning for warning in both[0].warnings)
