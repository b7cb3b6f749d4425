"""Work shared out to copies of a process: the same results in the same order, whatever happens to
the copies.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from mapmore_cli.domain.processors import MOST_PROCESSES

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="copies are made on Linux only")

HERE = Path(__file__).parent
PROCESSORS = min(len(os.sched_getaffinity(0)), MOST_PROCESSES) if sys.platform == "linux" else 1
START = """
import os, signal, sys
from multiprocessing import active_children
from mapmore_cli.domain.processors import free_processors, shared_out
me, items = os.getpid(), list(range(10))
"""


def python(script: str, *arguments: object, threads: str = "1") -> str:
    """What a script prints in a process of its own: this one has threads, of which a fork may
    hang.
    """
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([*sys.path, str(HERE)]),
        "OPENBLAS_NUM_THREADS": threads,
    }
    command = [sys.executable, "-c", START + script, *map(str, arguments)]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    return done.stdout.strip()


FREE = """
import time
def work(item):
    if item == 1:
        time.sleep(1.0)  # of the copy
    return os.getpid()
found = shared_out(work, items, processes=2)
print([place for place, pid in enumerate(found) if pid != me])
"""
FAILS = """
try:
    shared_out(lambda item: 1 / (item - 5), items, processes=4)
except ZeroDivisionError:
    print(len(active_children()))
"""
INTERRUPTED = """
def work(item):
    if os.getpid() != me:
        signal.pause()
    os.kill(0, signal.SIGINT)  # to all of them, as Ctrl-C, of which a copy hears nothing
os.setpgrp()
try:
    shared_out(work, items, processes=3)
except KeyboardInterrupt:
    print(len(active_children()))
"""
REFUSED = """
def refuse():
    raise BlockingIOError(11, "no more processes")
os.fork = refuse
print(shared_out(str, items, processes=3) == list(map(str, items)))
"""
THREADS = """
import threading, time
def work(item):
    if os.getpid() != me:
        time.sleep(0.05)  # so that the other one is done before
    return free_processors()
alone = free_processors()
meanwhile = shared_out(work, items, processes=2)
done = threading.Event()
threading.Thread(target=done.wait).start()
print(alone, meanwhile == [1] * 10, free_processors())
done.set()
"""
LARGE = (
    "print([len(text) for text in shared_out(lambda item: 'x' * 10**6 * item, items, processes=3)])"
)
UNDELIVERED = """
def work(item):
    if item == 3 and os.getpid() != me:  # what the fourth process begins with
        {end}
    return item + 1
print(shared_out(work, items, processes=4) == [item + 1 for item in items], len(active_children()))
"""


@pytest.mark.parametrize(
    ("script", "printed"),
    [
        pytest.param(
            "print(shared_out(str, [], processes=4))", "[]", id="nothing is shared out of nothing"
        ),
        pytest.param(FREE, "[1]", id="the process that is free first takes the next item"),
        pytest.param(
            LARGE, str([10**6 * item for item in range(10)]), id="results larger than a pipe arrive"
        ),
        pytest.param(FAILS, "0", id="an error is that of the item"),
        pytest.param(INTERRUPTED, "0", id="no copy outlives an interruption"),
        pytest.param(REFUSED, "True", id="where no process can be made all is done here"),
        pytest.param(
            THREADS,
            f"{PROCESSORS} True 1",
            id="a process with threads or copies, and a copy, make none",
        ),
        pytest.param(
            UNDELIVERED.format(end="os.kill(os.getpid(), signal.SIGKILL)"),
            "True 0",
            id="a copy is killed",
        ),
        pytest.param(UNDELIVERED.format(end="os._exit(3)"), "True 0", id="a copy ends"),
        pytest.param(
            UNDELIVERED.format(end="raise MemoryError"), "True 0", id="a copy is short of memory"
        ),
        pytest.param(
            UNDELIVERED.format(end="return lambda: item"), "True 0", id="a result cannot be sent"
        ),
    ],
)
def test_whatever_happens_to_the_copies(script, printed):
    """What a copy does not deliver is done by the process itself."""
    assert python(script) == printed


@pytest.mark.parametrize("processes", [1, 2, 3, 10, 12])
def test_results_come_in_order_from_several_processes(processes):
    script = f"""
found = shared_out(lambda item: (item**2, os.getpid()), items, processes={processes})
assert [square for square, _ in found] == [item**2 for item in items], found
assert found[0][1] == me
assert not active_children()
print(len({{pid for _, pid in found}}))
"""
    assert python(script) == str(min(processes, 10))


def test_progress_is_told_up_to_the_last_item():
    script = "shared_out(str, items, lambda done, total: print(done, total), {})"
    assert python(script.format(1)).splitlines() == [f"{n} 10" for n in range(1, 11)]
    told = [int(line.split()[0]) for line in python(script.format(4)).splitlines()]
    assert told == sorted(set(told))
    assert told[-1] <= 10


def test_a_copy_is_killed_with_the_process():
    script = """
import time
def work(item):
    if os.getpid() != me:
        signal.pause()
    time.sleep(0.2)
    os.kill(me, signal.SIGKILL)
shared_out(work, items, processes=3)
"""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", START + script],
        env=environment,
        capture_output=True,
        timeout=30,
        check=False,
    )
    assert done.returncode == -signal.SIGKILL  # and nobody holds its output open any more


def test_the_command_line_has_one_thread_whatever_the_environment_says():
    script = """
import mapmore_cli.cli.app as app
from mapmore_cli.__main__ import main
def run():
    import numpy
    print(free_processors())
app.main = run
main()
"""
    assert python(script, threads="2") == str(PROCESSORS)
