"""Worker processes: what becomes of their jobs when they die, and of them when their parent
does.
"""

import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor, process
from pathlib import Path

import pytest
from cli_samples import wait_until, write_slow_study
from common import python
from filelock import FileLock

from mapmore_cli.annexes.campaigns import workers
from mapmore_cli.annexes.campaigns.workers import in_processes
from mapmore_cli.domain.errors import MapmoreError, WriteError

PROC = Path("/proc/self/task")


def die_at_first(mark):
    """A job that kills its worker where the mark is not there yet; without one, always."""
    if mark is None or not mark.exists():
        if mark is not None:
            mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return os.getpid()


def fail_if_none(mark):
    if mark is None:
        raise MapmoreError("wrong", "mend it")
    return mark.name


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs a signal that cannot be heard")
@pytest.mark.parametrize("once", [True, False])
def test_a_worker_that_dies_costs_its_job_one_start(once, tmp_path):
    """What was at work beside it is started again as well; nothing of the batch is lost."""
    told = []
    (tmp_path / "there").touch()
    deadly = tmp_path / "mark" if once else None
    jobs = dict(enumerate([deadly, *[tmp_path / "there"] * 3]))
    ended = dict(in_processes(die_at_first, jobs, 2, lambda *what: told.append(what)))
    assert set(ended) == set(jobs)
    assert isinstance(ended.pop(0), int if once else MapmoreError)
    assert all(isinstance(outcome, int) for outcome in ended.values())
    assert told[0] == (0, "its worker process died; the run is started again")


def test_no_jobs_need_no_process():
    """So it is where a campaign is known to be up to date by the seals of all its runs."""
    assert list(in_processes(abs, {}, 2, print)) == []


@pytest.mark.parametrize(("count", "jobs", "started"), [(2, 3, 2), (5, 3, 3)])
def test_there_are_no_more_processes_than_jobs(count, jobs, started, monkeypatch):
    pools = []

    def processes(size, _how):
        pools.append(size)
        return ThreadPoolExecutor(size)

    monkeypatch.setattr(workers, "processes", processes)
    assert len([*in_processes(abs, dict.fromkeys(range(jobs), -1), count, print)]) == jobs
    assert pools == [started]


def test_a_job_that_fails_is_not_started_again(tmp_path):
    told = []
    jobs = {3: None, 4: tmp_path / "a", 5: tmp_path / "b"}
    ended = dict(in_processes(fail_if_none, jobs, 1, lambda *what: told.append(what)))
    error = ended.pop(3)
    assert (str(error), ended, told) == ("wrong\n  mend it", {4: "a", 5: "b"}, [])


@pytest.mark.skipif(not PROC.exists(), reason="looks for the workers in /proc")
@pytest.mark.parametrize(
    ("name", "code"),
    [
        ("SIGTERM", 143),
        pytest.param("SIGHUP", 129, marks=pytest.mark.long),  # the same handler
        ("SIGKILL", -9),
    ],
)
def test_no_worker_outlives_its_parent(name, code, tmp_path):
    """One worker; two are interrupted in test_cli_exits.py."""
    command = [
        sys.executable,
        "-m",
        "mapmore_cli",
        "batch",
        str(write_slow_study(tmp_path, "study")),
        "--runs",
        str(tmp_path / "runs"),
    ]
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        wait_until(lambda: len(list(tmp_path.glob("runs/*/ingest.h5"))) == 1)
        workers = children_of(process.pid)
        process.send_signal(getattr(signal, name))
        # what workers hold open would keep this waiting
        _, stderr = process.communicate(timeout=30)
    assert process.returncode == code
    assert "Traceback" not in stderr
    assert code < 0 or stderr.splitlines()[-1] == f"ended by {name}"
    wait_until(lambda: not any(is_alive(worker) for worker in workers))
    assert not list(tmp_path.glob("runs/*/scores.json"))  # killed at work, not waited for
    for folder in tmp_path.glob("runs/*"):
        with FileLock(folder / ".lock", timeout=0):
            pass


def children_of(pid):
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def is_alive(pid):
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


@pytest.mark.skipif(sys.platform == "win32", reason="there are no limits of that kind")
def test_without_room_for_its_locks_no_worker_starts():
    code = """
import resource
from mapmore_cli.domain.errors import WriteError
from mapmore_cli.annexes.campaigns.workers import in_processes
resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
try:
    list(in_processes(abs, {1: 1, 2: 2}, 2, print))
except WriteError as told:
    print(told, told.remedy)
"""
    ended = python(code)
    assert "a worker process cannot be started: File too large" in ended.stdout, ended.stderr
    assert "/dev/shm" in ended.stdout


def test_where_the_system_has_no_locks_no_worker_starts(monkeypatch):
    """Found by torture: it was an internal fault. Python remembers what it once found."""
    monkeypatch.setattr(process, "_system_limits_checked", False)
    monkeypatch.setattr(process, "_system_limited", None)
    monkeypatch.setitem(sys.modules, "multiprocessing.synchronize", None)
    with pytest.raises(WriteError, match="a worker process cannot be started"):
        list(in_processes(abs, {1: 1, 2: 2}, 2, print))
