"""Disturbs commands at random instants and looks at what is left: `python tests/torture/torture.py
COUNT [SEED]`.

Each trial starts from the results of older settings. A command is begun in a fork and is killed,
interrupted, left without room on the disk or without the right to write, is run by a user to whom
nothing here belongs, sees its clock set back, loses a worker of its cluster, or meets a second one.
Afterwards every file is whole, old or new. The same command again comes to its end, and leaves,
byte for byte, what it leaves undisturbed.
"""

from __future__ import annotations

import ctypes
import importlib.util
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
import traceback
from collections import Counter
from contextlib import contextmanager, nullcontext, redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "cli"))

from cli_samples import write_study

from mapmore_cli.__main__ import main as mapmore
from mapmore_cli.cli.app import app
from mapmore_cli.pipeline.runs_rows import PAGE, rows_of
from mapmore_cli.storage.ownership import LOCK
from mapmore_cli.storage.seals import SEAL

RUN_RECORD = "run.json"  # tells seconds and times, so its bytes differ from run to run
NEW = ("--set", "fit.max_terms=2", "--set", "segment.strain.count=3")
COMMANDS = {
    **{
        stage: (stage, "one.yaml", *NEW, "-q")
        for stage in ("ingest", "segment", "fit", "fuse", "validate", "report")
    },
    "run": ("run", "one.yaml", *NEW, "-q"),
    "freeze": ("freeze", "runs/one", "--tag", "new", "--archive", "archive"),
    "compare": (
        *("compare", "archive/one@old", "runs/one"),
        *("--figure", "drift.svg", "--allow-other-settings"),
    ),
    "export": ("export", "runs/one/model.h5", "--to", "c", "-o", "out", "-q"),
    "batch": ("batch", "one.yaml", "two.yaml", "--jobs", "2", "-q"),
    "cluster": ("batch", "one.yaml", "two.yaml", "--cluster-file", "../scheduler.json", "-q"),
}
SLOW = ("batch", "cluster")
# trials, of which one is of each slow command: their processes import everything anew, which takes
# long
BATCHES = 25
DONE = (0, 6)  # a missed limit is an end too
PATIENCE = 60.0  # seconds for a lock that a dying worker holds


def begin(folder, arguments, before=lambda: None):
    """Start a command in a fork, everything imported already; its process."""
    # until the fork is where it may be interrupted
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    child = os.fork()
    if child:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        return child
    code = 1
    try:
        os.setpgid(0, 0)
        os.chdir(folder)
        log = os.open(folder.parent / "log", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(log, 1)
        os.dup2(log, 2)
        sys.argv = ["mapmore", *arguments]
        # a shell that starts this in the background has it ignored
        signal.signal(signal.SIGINT, signal.default_int_handler)
        before()
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        mapmore()
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    except KeyboardInterrupt:
        code = 130
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)  # nothing of the parent's is cleared away here


def end_of(child):
    """Wait for a process; its exit code, or the negative number of the signal that ended it."""
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def contents(folder):
    """All files below a folder but locks and records."""
    paths = sorted(
        path
        for path in folder.rglob("*")
        if path.is_file() and path.name not in (LOCK, RUN_RECORD, SEAL, ".batch.lock")
    )
    return {path.relative_to(folder).as_posix(): content_of(path) for path in paths}


def content_of(path):
    """The bytes of a file. The page of runs says when they ended and how long they took, so that
    two of the same results differ: in its place stand its rows without that, and its own end.
    """
    text = path.read_bytes()
    rows = rows_of(path) if path.name == PAGE else None
    if not rows:
        return text
    rows = sorted((replace(row, ended=0.0, seconds={}) for row in rows), key=lambda row: row.run)
    return repr(rows).encode() + text[-20:]


def struck(how, child, delay):
    """Disturb a process from outside at a random instant: SIGKILL, or Ctrl-C, which the terminal
    sends to the whole group.
    """
    if how in ("killed", "two at once"):
        time.sleep(delay)
        os.kill(child, signal.SIGKILL)
    elif how == WORKER_KILLED:
        time.sleep(delay)
    elif how == "interrupted":
        time.sleep(delay)
        # it has ended, or has no group of its own yet
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(child, signal.SIGINT)


def little_room(size):
    """No file can grow beyond some kilobytes; what is said goes nowhere, since that is a file
    here.
    """
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def no_rights():
    """The folders of results may not be written; where root runs this, it gives up its privileges
    first.
    """
    for name in ("runs/one", "runs", "archive", "out", "."):
        if Path(name).is_dir():
            Path(name).chmod(0o555)
    if os.getuid() == 0:
        header, nothing = (ctypes.c_uint32 * 2)(0x20080522, 0), (ctypes.c_uint32 * 6)()
        if ctypes.CDLL(None, use_errno=True).capset(header, nothing):
            os._exit(99)


def as_nobody():
    """The command is run by another user, to whom nothing here belongs, and who may read it."""
    os.setgroups([])
    os.setresgid(NOBODY, NOBODY, NOBODY)
    os.setresuid(NOBODY, NOBODY, NOBODY)


def clock_set_back(after):
    """After some seconds the clock is set back by two hours, and with it the times of results."""
    from mapmore_cli.pipeline import runner

    began, stamps_of = time.monotonic(), runner.stamps_of
    now, now_ns = time.time, time.time_ns

    def back():
        return HOURS if time.monotonic() - began > after else 0

    def stamps_then(folder, outputs):
        for path in folder.rglob("*"):
            os.utime(path, ns=(time.time_ns(), time.time_ns()))
        return stamps_of(folder, outputs)

    time.time, time.time_ns = lambda: now() - back(), lambda: now_ns() - back() * 10**9
    runner.stamps_of = stamps_then


def restored(folder):
    for place in (folder, *(path for path in folder.rglob("*") if path.is_dir())):
        place.chmod(0o755)


DISTURBANCES = {
    "killed": 50,
    "interrupted": 15,
    "full disk": 10,
    "read-only": 5,
    "another user": 5,
    "clock set back": 5,
    "two at once": 10,
}
"""In per cent of the trials."""
NOBODY, HOURS = 65534, 7200
WORKER_KILLED = "worker killed"
"""What happens to a command on a cluster, always."""


@dataclass
class Cluster:
    """A scheduler of Dask and two workers, processes of their own that nobody starts again."""

    folder: Path
    workers: list[subprocess.Popen]

    def start(self, program, *arguments):
        """Start one of the programs of Dask."""
        line = f"from distributed.cli import {program} as one; one.main()"
        file = ("--scheduler-file", str(self.folder / "scheduler.json"), "--host", "127.0.0.1")
        with (self.folder / "dask.log").open("ab") as log:
            return subprocess.Popen(
                [sys.executable, "-W", "ignore", "-c", line, *file, "--no-dashboard", *arguments],
                stdout=log,
                stderr=log,
            )

    def fill(self):
        """Start workers until there are two."""
        while len(self.workers) < 2:
            here = ("--local-directory", str(self.folder), "--nthreads", "1", "--no-nanny")
            self.workers.append(self.start("dask_worker", *here))

    def kill_one(self, number):
        """Kill a worker, and start another in its place."""
        ended(self.workers.pop(number))
        self.fill()


def ended(process):
    process.kill()
    process.wait()


@contextmanager
def cluster_in(folder):
    """A scheduler and two workers, as long as they are needed."""
    found = Cluster(folder, [])
    scheduler = found.start("dask_scheduler", "--port", "0")
    try:
        while not (folder / "scheduler.json").is_file() and scheduler.poll() is None:
            time.sleep(0.1)
        found.fill()
        yield found
    finally:
        for process in (scheduler, *found.workers):
            ended(process)


@dataclass(frozen=True)
class Bench:
    """Where every trial of one command starts, what it leaves undisturbed, and how many seconds it
    takes.
    """

    start: Path
    after: dict[str, bytes]
    seconds: float


def prepare(root, name):
    start, done = root / f"{name} start", root / f"{name} done"
    shutil.copytree(root / "old", start)
    if name in ("freeze", "compare", "export", *SLOW):
        assert end_of(begin(start, COMMANDS["run"])) in DONE
    shutil.copytree(start, done)
    began = time.monotonic()
    assert end_of(begin(done, COMMANDS[name])) in DONE, (root / "log").read_text()
    return Bench(start, contents(done), time.monotonic() - began)


def trial(bench, name, how, chance, folder, cluster=None):
    """Disturb a command once; how it ended, and what is wrong afterwards."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(bench.start, folder)
    old = contents(folder)
    before = {
        "full disk": partial(little_room, chance.choice([0, 200, 3_000, 9_000, 20_000])),
        "read-only": no_rights,
        "another user": as_nobody,
        "clock set back": partial(clock_set_back, chance.uniform(0, bench.seconds)),
    }
    other = begin(folder, COMMANDS[name]) if how == "two at once" else None
    child = begin(folder, COMMANDS[name], before.get(how, lambda: None))
    struck(how, child, chance.uniform(0, 1.1 * bench.seconds))
    if how == WORKER_KILLED:
        cluster.kill_one(chance.choice((0, 1)))
    code = end_of(child)
    fit = {"another user": (7,), "clock set back": DONE, WORKER_KILLED: DONE}
    wrong = (
        []
        if code in fit.get(how, (*DONE, 4, 7, 130, -signal.SIGKILL, -signal.SIGINT))
        else [f"ended with {code}: {said(folder)}"]
    )
    if other is not None and (second := end_of(other)) not in (*DONE, 7):
        wrong.append(f"the other ended with {second}: {said(folder)}")
    restored(folder)
    for place, text in contents(folder).items():
        hidden = any(part.startswith((".tmp-", ".old-")) for part in Path(place).parts)
        if not hidden and text not in (old.get(place), bench.after.get(place)):
            wrong.append(f"{place} is neither the old nor the new one")
    for record in folder.rglob(RUN_RECORD):
        json.loads(record.read_text())
    again = repeated(folder, name)
    if again not in DONE and not (
        name == "freeze" and again == 7 and (folder / "archive" / "one@new").is_dir()
    ):
        wrong.append(f"the next one ends with {again}: {said(folder)}")
    after = contents(folder)
    if after != bench.after:
        different = sorted(
            place for place in {*after, *bench.after} if after.get(place) != bench.after.get(place)
        )
        wrong.append(f"the next one leaves others: {', '.join(different)[:300]}")
    return f"ended with {code}", wrong


def repeated(folder, name):
    """Run the command again, as soon as no dying worker holds a run."""
    deadline = time.monotonic() + PATIENCE
    while (
        (code := end_of(begin(folder, COMMANDS[name]))) == 7
        and "another process" in said(folder)
        and time.monotonic() < deadline
    ):
        time.sleep(0.1)
    return code


def said(folder):
    """The first words of what the last command said."""
    return " ".join((folder.parent / "log").read_text(errors="replace").split())[:200]


def warm_up(folder, names):
    """Make the results of older settings, here: what is imported by and by is there for all
    forks.
    """
    for spec in ("one", "two")[: 1 + bool({*SLOW} & {*names})]:
        write_study(folder, spec)
        called(folder, ("run", f"{spec}.yaml", "-q"))
    called(folder, ("freeze", "runs/one", "--tag", "old", "--archive", "archive"))
    for name in ("compare", "export"):
        if name in names:
            called(folder, COMMANDS[name])
    shutil.rmtree(folder / "out", ignore_errors=True)
    (folder / "drift.svg").unlink(missing_ok=True)


def called(folder, arguments):
    here, log = Path.cwd(), folder.parent / "log"
    os.chdir(folder)
    try:
        with log.open("w") as stream, redirect_stdout(stream), redirect_stderr(stream):
            app([*arguments], prog_name="mapmore", standalone_mode=False)
    except SystemExit as end:
        if end.code not in DONE:
            raise RuntimeError(log.read_text()) from end
    finally:
        os.chdir(here)


def torture(count, seed, names=(*COMMANDS,)):
    """Disturb commands `count` times in turn; how the trials of every disturbance ended, and what
    was wrong.
    """
    shares = dict(DISTURBANCES)
    if os.getuid():
        del shares["another user"]  # nobody but root may become another; "read-only" is the same
    ends, wrong = {how: Counter[str]() for how in (*shares, WORKER_KILLED)}, list[str]()
    chance, quick = random.Random(seed), [name for name in names if name not in SLOW]
    slow = [name for name in names if name in SLOW]
    with (
        TemporaryDirectory() as place,
        cluster_in(Path(place)) if "cluster" in slow else nullcontext() as cluster,
    ):
        root = Path(place)
        root.chmod(0o755)
        old = root / "old"
        old.mkdir()
        warm_up(old, names)
        benches = {name: prepare(root, name) for name in names}
        for number in range(count):
            turn = number * len(slow) % BATCHES
            name = slow[number * len(slow) // BATCHES % len(slow)] if turn < len(slow) else None
            name = name or quick[number % len(quick)]
            how = chance.choices([*shares], [*shares.values()])[0]
            how = WORKER_KILLED if name == "cluster" else how
            if name in SLOW and how == "another user":
                how = "read-only"  # Python itself may lie where nobody else can start it
            end, found = trial(benches[name], name, how, chance, root / "trial", cluster)
            ends[how][end] += 1
            for one in found:
                wrong.append(f"{number}, {name}, {how}: {one}")
                print(wrong[-1], file=sys.stderr, flush=True)
            if (number + 1) % 10 == 0:
                progress = f"... {number + 1} of {count} trials, {len(wrong)} faults"
                print(progress, file=sys.stderr, flush=True)
    return ends, wrong


def main(count, seed):
    """Print the table; 1 where something was wrong."""
    there = importlib.util.find_spec("distributed")
    names = [name for name in COMMANDS if there or name != "cluster"]
    if not there:
        print("left out: `distributed` is not installed, so there is no cluster", file=sys.stderr)
    if os.getuid():
        print("left out: only root can run a command as another user", file=sys.stderr)
    began = time.monotonic()
    ends, wrong = torture(count, seed, names)
    print(f"{count} trials in {time.monotonic() - began:.0f} s")
    print("| disturbance | trials | how the command ended |\n|---|---:|---|")
    for how, found in ends.items():
        print(
            f"| {how} | {found.total()} | "
            f"{', '.join(f'{count} {end}' for end, count in sorted(found.items()))} |"
        )
    print(*wrong, sep="\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 16))
