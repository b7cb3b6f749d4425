"""Runs on a real Dask scheduler with two workers, on loopback."""

import json
import os
import signal
import sys
from concurrent.futures import Future
from contextlib import nullcontext
from pathlib import Path
from subprocess import PIPE, Popen
from types import SimpleNamespace

import pytest
from cli_samples import wait_until, write_slow_study, write_study

from mapmore_cli.annexes.campaigns import cluster
from mapmore_cli.annexes.campaigns.cluster import (
    ATTEMPTS,
    Shared,
    checked_workers,
    run_on_cluster,
    shared_folder,
)
from mapmore_cli.domain.errors import UsageError, WriteError
from mapmore_cli.pipeline.jobs import Job, run_one
from mapmore_cli.storage.run_record import tool_versions

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/fd").exists(), reason="looks into /proc for the worker that does a run"
)

FORKED = """
import json, os, sys
from distributed.cli import dask_scheduler, dask_worker

scheduler, worker = json.loads(sys.argv[1])
for command, arguments in ((dask_worker, worker), (dask_worker, worker), (dask_scheduler,
    scheduler)):
    if command is dask_scheduler or not os.fork():
        command.main(arguments)
"""
"""The commands of Dask in processes that share what they import."""


@pytest.fixture
def scheduler_file(tmp_path):
    """A scheduler and two workers, one thread each, that nobody starts again."""
    file = tmp_path / "scheduler.json"
    common = ["--scheduler-file", str(file), "--host", "127.0.0.1", "--no-dashboard"]
    worker = [*common, "--nthreads", "1", "--no-nanny", "--local-directory", str(tmp_path)]
    command = [
        sys.executable,
        "-W",
        "ignore",
        "-c",
        FORKED,
        json.dumps([[*common, "--port", "0"], worker]),
    ]
    with (
        (tmp_path / "dask.log").open("wb") as log,
        Popen(command, stdout=log, stderr=log, start_new_session=True) as dask,
    ):
        try:
            yield file
        finally:
            os.killpg(dask.pid, signal.SIGKILL)


def holder_of(lock):
    """The process that has a file open."""
    for link in Path("/proc").glob("[0-9]*/fd/*"):
        try:
            if link.readlink() == lock:
                return int(link.parts[2])
        except OSError:
            continue
    return None


def is_done(run_dir):
    """True where a run has come to its end, and nobody writes it any more."""
    return (run_dir / "report").is_dir() and holder_of(run_dir / ".lock") is None


def batch(specs, runs, file):
    command = [
        sys.executable,
        "-m",
        "mapmore_cli",
        "batch",
        *map(str, specs),
        "--runs",
        str(runs),
        "--cluster-file",
        str(file),
        "--json",
    ]
    return Popen(command, stdout=PIPE, stderr=PIPE, text=True)


def test_a_campaign_on_a_cluster(tmp_path, scheduler_file):
    """The command is killed and started again, a worker is killed, and a run raises: every other
    run is done, once, as it is alone.
    """
    slow = write_slow_study(tmp_path, "slow")
    quick = [write_study(tmp_path, f"quick{number}") for number in range(3)]
    broken = write_study(tmp_path, "broken")
    broken.write_text(broken.read_text().replace("broken_*.csv", "none_*.csv"))
    runs, alone = tmp_path / "runs", tmp_path / "alone"
    with batch(quick, runs, scheduler_file) as first:
        for spec in (slow, *quick[:2]):
            run_one(Job(spec, alone))
        wait_until(lambda: is_done(runs / "quick0") or first.poll() is not None, 60)
        first.kill()
    before = (runs / "quick0" / "run.json").stat().st_mtime_ns
    with batch([slow, *quick, broken], runs, scheduler_file) as second:
        wait_until(lambda: (runs / "slow" / "ingest.h5").is_file() or second.poll() is not None, 60)
        worker = holder_of(runs / "slow" / ".lock")
        assert worker is not None
        os.kill(worker, signal.SIGKILL)
        stdout, stderr = second.communicate(timeout=120)
    assert second.returncode == 4, stderr
    assert "slow: its worker died or was lost; the run is started again" in stderr
    assert "broken: error:" in stderr
    documents = {run["name"]: run for run in json.loads(stdout)["runs"]}
    assert {name for name, run in documents.items() if run["exit_code"]} == {"broken"}
    assert set(documents["quick0"]["stages"].values()) == {"up-to-date"}
    assert (runs / "quick0" / "run.json").stat().st_mtime_ns == before
    for name in ("slow", "quick0", "quick1"):
        assert documents[name]["run_dir"] == str(runs / name)
        assert (runs / name / "scores.json").read_bytes() == (
            alone / name / "scores.json"
        ).read_bytes()
    assert len(list(runs.glob(".tmp-*-shared"))) < 2  # of the command that was killed, if any


def test_workers_that_differ_are_refused(tmp_path):
    (tmp_path / "token").touch()
    here = tool_versions()["mapmore"]
    Shared(tmp_path / "token", here, {}).check()
    with pytest.raises(WriteError, match="does not see the same folder"):
        Shared(tmp_path / "missing", here, {}).check()
    with pytest.raises(UsageError, match=r"has mapmore .*, but this computer has 0\.0"):
        Shared(tmp_path / "token", "0.0", {}).check()


def test_a_folder_is_shared_until_the_end_of_the_campaign(tmp_path, monkeypatch):
    monkeypatch.setenv("MAPMORE_DATA", "here")
    for is_deleted in (False, True):
        with shared_folder(tmp_path / "my" / "runs") as shared:
            shared.check()
            assert shared.environment["MAPMORE_DATA"] == "here"
            if is_deleted:
                shared.token.unlink()
        assert not shared.token.exists()


def test_a_cluster_that_is_not_there(tmp_path, monkeypatch):
    def silent(*_):
        pass

    monkeypatch.setattr("mapmore_cli.annexes.campaigns.cluster.CONNECT", "50ms")
    for scheduler, words in (
        ("tcp://127.0.0.1:9", "no Dask scheduler"),
        (tmp_path / "none.json", "does not exist"),
    ):
        with pytest.raises(UsageError, match=words):
            next(run_on_cluster({}, scheduler, tmp_path / "runs", silent, silent))
    assert not list((tmp_path / "runs").iterdir())


class Scheduler:
    """Does each job at once. The job is the number of workers that start it."""

    def subscribe_topic(self, _topic, note):
        self.note = note

    def scheduler_info(self):
        return {"workers": {}}

    def wait_for_workers(self, count):
        assert count == 1

    def run(self, _):
        return {"a": None, "b": None}

    def get_executor(self, **options):
        # a job writes files, so that no stored result replaces it
        assert options == {"pure": False, "retries": 0}
        return self

    def submit(self, _work, job, _shared, number):
        done = Future()
        for _ in range(job):
            self.note((0.0, number))
        done.set_result(f"{number} done")
        return done


def test_a_run_whose_worker_was_lost_is_told_when_it_starts_again(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "_connected", lambda _scheduler: nullcontext(Scheduler()))
    jobs = {number: SimpleNamespace(elsewhere=lambda starts=number: starts) for number in (1, 2)}
    told, said = [], []
    ended = run_on_cluster(jobs, "here", tmp_path, lambda *one: told.append(one), said.append)
    assert dict(ended) == {1: "1 done", 2: "2 done"}
    assert told == [(2, "its worker died or was lost; the run is started again")]
    assert said == ["here: waiting for a worker", f"here: 2 workers, which share {tmp_path}"]


def test_a_worker_on_which_the_program_does_not_run_says_why_in_one_line():
    class Old(Scheduler):
        def run(self, _):
            raise RuntimeError("no such module\nand much more")

    with pytest.raises(UsageError, match=r"cannot run mapmore \(RuntimeError: no such module\)"):
        checked_workers(Old(), Shared(Path("token"), "1", {}))


def test_the_client_of_a_campaign_is_no_default_of_other_programs(monkeypatch):
    monkeypatch.setattr("distributed.Client", lambda **how: how)
    how = cluster._connected("tcp://127.0.0.1:9")
    assert (how["address"], how["set_as_default"]) == ("tcp://127.0.0.1:9", False)


@pytest.mark.parametrize(("losses", "workers"), [(0, 2), (ATTEMPTS - 1, 2), (ATTEMPTS, None)])
def test_a_worker_that_is_lost_while_it_is_checked_is_not_a_wrong_installation(losses, workers):
    from distributed.comm import CommClosedError

    answers = [CommClosedError("Stream is closed")] * losses + [{"a": None, "b": None}]

    class Busy(Scheduler):
        def run(self, _):
            answer = answers.pop(0)
            if isinstance(answer, Exception):
                raise answer
            return answer

    if workers is not None:
        assert checked_workers(Busy(), Shared(Path("token"), "1", {})) == workers
        return
    with pytest.raises(UsageError, match=f"lost {ATTEMPTS} times"):
        checked_workers(Busy(), Shared(Path("token"), "1", {}))
