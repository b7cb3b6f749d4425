"""Worker processes: what becomes of their jobs when they die, and of them when their parent
does.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from cli_samples import wait_until, write_slow_study
from filelock import FileLock

from mapmore_cli.annexes.campaigns.processes import LocalWorkers
from mapmore_cli.domain.errors import MapmoreError

PROC = Path("/proc/self/task")


def die_at_first(mark: Path | None) -> int:
    """A job that kills its worker where the mark is not there yet; without one, always."""
    if mark is None or not mark.exists():
        if mark is not None:
            mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return os.getpid()


def fail_if_none(mark: Path | None) -> str:
    if mark is None:
        raise MapmoreError("wrong", "mend it")
    return mark.name


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs a signal that cannot be heard")
def test_a_worker_that_dies_costs_its_job_one_start(tmp_path):
    told: list[tuple[int, str]] = []
    (tmp_path / "there").touch()
    jobs = [tmp_path / "there", tmp_path / "mark", None]
    with LocalWorkers(2, lambda number, message: told.append((number, message))) as workers:
        ended = dict(workers.each(die_at_first, jobs))
    assert isinstance(ended[0], int)
    assert isinstance(ended[1], int)
    assert isinstance(ended[2], MapmoreError)
    assert "died 2 times" in ended[2].message
    assert sorted(number for number, _ in told) == [1, 2]
    assert "started again" in told[0][1]


def test_a_job_that_fails_is_not_started_again(tmp_path):
    told: list[int] = []
    with LocalWorkers(1, lambda number, _: told.append(number)) as workers:
        ended = dict(workers.each(fail_if_none, [None, tmp_path / "a", tmp_path / "b"]))
        again = dict(workers.each(fail_if_none, [tmp_path / "c"]))
    assert (str(ended[0]), ended[1], ended[2], again, told) == (
        "wrong\n  mend it",
        "a",
        "b",
        {0: "c"},
        [],
    )


@pytest.mark.skipif(not PROC.exists(), reason="looks for the workers in /proc")
@pytest.mark.parametrize(("name", "code"), [("SIGTERM", 143), ("SIGHUP", 129), ("SIGKILL", -9)])
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
        _, stderr = process.communicate(
            timeout=30
        )  # what workers hold open would keep this waiting
    assert process.returncode == code
    assert "Traceback" not in stderr
    assert code < 0 or stderr.splitlines()[-1] == f"ended by {name}"
    wait_until(lambda: not any(is_alive(worker) for worker in workers))
    assert not list(tmp_path.glob("runs/*/scores.json"))  # killed at work, not waited for
    for folder in tmp_path.glob("runs/*"):
        with FileLock(folder / ".lock", timeout=0):
            pass


def children_of(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def is_alive(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


@pytest.mark.skipif(sys.platform == "win32", reason="there are no limits of that kind")
def test_without_room_for_its_locks_no_worker_starts():
    code = (
        "import resource\n"
        "from mapmore_cli.domain.errors import WriteError\n"
        "from mapmore_cli.annexes.campaigns.processes import LocalWorkers\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))\n"
        "try:\n    list(LocalWorkers(2).each(abs, [1, 2]))\nexcept WriteError as told:\n    "
        "print(told, told.remedy)"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert "no worker process can be started: File too large" in ended.stdout, ended.stderr
    assert "/dev/shm" in ended.stdout
