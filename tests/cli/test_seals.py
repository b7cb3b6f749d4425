"""A campaign passes over the runs whose seal holds: whatever one depends on breaks it."""

import json
import shutil
from dataclasses import replace

import pytest
from cli_samples import edit, write_study

from mapmore_cli.annexes.campaigns import sealed
from mapmore_cli.annexes.campaigns.sealed import known_by_seal, run_and_seal
from mapmore_cli.pipeline.jobs import Job, run_one
from mapmore_cli.pipeline.runner import Options
from mapmore_cli.storage.ownership import contents_of
from mapmore_cli.storage.run_record import RUN_RECORD
from mapmore_cli.storage.seals import SEAL, read_seal, write_seal


def study_in(folder):
    return Job(folder / "top" / "bench.yaml", folder / "runs", until="validate")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The folder of a study whose run is sealed."""
    folder = tmp_path_factory.mktemp("sealed")
    (folder / "top").mkdir()
    spec = write_study(folder / "top")
    spec.rename(folder / "top" / "base.yaml")
    spec.write_text("extends: base.yaml\nvalidate: {require: {nrmse: 0.5}}\n")
    run_and_seal(study_in(folder))
    return folder


@pytest.fixture
def job(made, tmp_path):
    """The job of a study that may be changed; its copied files are sealed again."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    copied = study_in(tmp_path)
    assert known_by_seal(copied, "bench") is None
    run_and_seal(copied)
    return copied


def test_a_seal_says_what_planning_the_run_would(job):
    by_seal, planned = known_by_seal(job, "bench"), run_one(job)
    assert planned.limits
    assert planned.published is not None
    assert replace(by_seal, seconds=0.0) == replace(planned, seconds=0.0)


def appended(path):
    path.write_bytes(path.read_bytes() + b"\n")


def flipped(path):
    data = bytearray(path.read_bytes())
    data[-40] ^= 1
    path.write_bytes(data)


CHANGES = {
    "spec": lambda top, _run: appended(top / "bench.yaml"),
    "what the spec extends": lambda top, _run: appended(top / "base.yaml"),
    "spec gone": lambda top, _run: (top / "base.yaml").unlink(),
    "source": lambda top, _run: appended(top / "bench_200.csv"),
    "source gone": lambda top, _run: (top / "bench_200.csv").unlink(),
    "all sources gone": lambda top, _run: [path.unlink() for path in top.glob("*.csv")],
    "new source": lambda top, _run: (top / "bench_4.csv").write_text("P,eps,F\n100,0,1\n"),
    "source of same size": lambda top, _run: (top / "bench_200.csv").touch(),
    "result": lambda _top, run: appended(run / "model.h5"),
    "result gone": lambda _top, run: (run / "scores.csv").unlink(),
    "findings gone": lambda _top, run: (run / "check.json").unlink(),
    "resolved spec": lambda _top, run: appended(run / "experiment.yaml"),
    "record": lambda _top, run: appended(run / RUN_RECORD),
    "somebody at work": lambda _top, run: (run / ".old-report").mkdir(),
    "seal damaged": lambda _top, run: flipped(run / SEAL),
    "seal cut": lambda _top, run: (run / SEAL).write_bytes((run / SEAL).read_bytes()[:99]),
    "seal empty": lambda _top, run: (run / SEAL).write_bytes(b""),
    "seal gone": lambda _top, run: (run / SEAL).unlink(),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_what_a_run_depends_on_breaks_its_seal(change, job):
    assert known_by_seal(job, "bench") is not None
    change(job.config.parent, job.runs / "bench")
    assert known_by_seal(job, "bench") is None


@pytest.mark.parametrize(
    "changed",
    [
        {"until": "report"},
        {"overrides": ("fuse.z_s=0.3",)},
        {"options": Options(force=True)},
        {"options": Options(rehash=True)},
        {"options": Options(check=False)},
        {"options": Options(campaign=RUN_RECORD)},
    ],
    ids=str,
)
def test_another_job_is_not_answered_by_a_seal(changed, job):
    assert known_by_seal(replace(job, **changed), "bench") is None


def test_another_program_or_environment_breaks_a_seal(job, monkeypatch):
    assert known_by_seal(job, "other") is None
    with monkeypatch.context() as patch:
        patch.setenv("MAPMORE_FORCE", "3")
        assert known_by_seal(job, "bench") is None
    monkeypatch.setattr(sealed, "_program", lambda: {"mapmore": "0.9"})
    assert known_by_seal(job, "bench") is None


def test_a_run_that_needs_others_has_no_seal(job):
    edit(job.config, "validate: {", "validate: {against: [{as: k, set: {fit.max_terms: 1}}], ")
    run_and_seal(job)
    assert known_by_seal(job, "bench") is None


def test_a_spec_that_changes_while_it_runs_is_not_sealed(job, monkeypatch):
    (job.runs / "bench" / SEAL).unlink()

    def slowly(job):
        finished = run_one(job)
        appended(job.config)
        return finished

    monkeypatch.setattr(sealed, "run_one", slowly)
    run_and_seal(job)
    assert not (job.runs / "bench" / SEAL).exists()


def test_a_seal_is_removed_with_its_run_and_one_of_somebody_else_is_not(job):
    run_dir = job.runs / "bench"
    assert contents_of(run_dir).others == ()
    (run_dir / SEAL).write_text("mine")
    assert contents_of(run_dir).others == (SEAL,)


@pytest.mark.usefixtures("batch_here")
def test_a_campaign_whose_runs_are_sealed_starts_none(job, mapmore, monkeypatch):
    campaign = job.config.parent / "campaign.yaml"
    campaign.write_text("campaign: all\nruns: [{base: bench.yaml, name: one}]\n")
    command = ("batch", campaign, "--runs", job.runs, "--jobs", 1, "--no-pages", "--json", "-q")
    first = json.loads(mapmore(*command).stdout)["runs"][0]
    monkeypatch.setattr(sealed, "run_one", None)
    again = json.loads(mapmore(*command).stdout)["runs"][0]
    assert {*again.pop("stages").values()} == {"up-to-date"}
    assert again.items() <= first.items()
    write_seal(job.runs / "one", {**read_seal(job.runs / "one"), "question": None})
    assert mapmore(*command).exit_code == 1  # it would have to be planned
