"""Work shared out to forks of a process: the same results in the same order, whatever happens to
the forks.
"""

import os
import signal
import sys

import common
import pytest

from mapmore_cli.pipeline.processors import MOST_PROCESSES, variables_set

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="forks are made on Linux only")

PROCESSORS = min(len(os.sched_getaffinity(0)), MOST_PROCESSES) if sys.platform == "linux" else 1
START = """
import os, signal, sys, threading, time
from multiprocessing import active_children
from mapmore_cli.pipeline.processors import free_processors, shared_out
me, items = os.getpid(), list(range(10))
"""


def python(script, threads="1", code=0):
    """What a script prints in a process of its own: this one has threads, of which a fork may
    hang.
    """
    environment = {"PYTHONPATH": os.pathsep.join(sys.path), "OPENBLAS_NUM_THREADS": threads}
    done = common.python(START + script, env=environment, timeout=60)
    assert (done.returncode, done.stderr) == (code, "")  # and nobody holds its output open any more
    return done.stdout.strip()


LARGE = "print([len(t) for t in shared_out(lambda n: 'x' * 10**6 * n, items, workers=3)])"
FORKS = "print([*{n == me for n in shared_out(lambda item: os.getpid(), items, workers=2)}])"
FAILS = """
try:
    shared_out(lambda item: 1 / (item - 5), items, workers=4)
except ZeroDivisionError:
    print(len(active_children()))
"""
INTERRUPTED = """
def work(item):
    if item == 0:
        os.kill(0, signal.SIGINT)  # to all of them, as Ctrl-C, of which a fork hears nothing
    signal.pause()
os.setpgrp()
try:
    shared_out(work, items, workers=3)
except KeyboardInterrupt:
    print(len(active_children()))
"""
REFUSED = """
def refuse():
    raise BlockingIOError(11, "no more processes")
os.fork = refuse
print(shared_out(str, items, workers=3) == list(map(str, items)))
"""
THREADS = """
alone = free_processors()
meanwhile = shared_out(lambda item: free_processors(), items, workers=2)
done = threading.Event()
threading.Thread(target=done.wait).start()
print(alone, meanwhile == [1] * 10, free_processors())
done.set()
"""
UNDELIVERED = """
def work(item):
    if item == 3 and os.getpid() != me:
        {end}
    return item + 1
print(shared_out(work, items, workers=4) == [item + 1 for item in items], len(active_children()))
"""
PROGRESS = """
told = []
shared_out(str, items, lambda done, total: told.append((done, total)), {workers})
print(told == [(n, 10) for n in range(1, 11)])
"""
ENDS = {
    "is killed": "os.kill(os.getpid(), signal.SIGKILL)",
    "ends": "os._exit(3)",
    "is short of memory": "raise MemoryError",
    "cannot send its result": "return lambda: item",
}


@pytest.mark.parametrize(
    ("script", "printed"),
    [
        pytest.param("print(shared_out(str, [], workers=4))", "[]", id="nothing out of nothing"),
        pytest.param(LARGE, str([10**6 * n for n in range(10)]), id="results larger than a pipe"),
        pytest.param(FAILS, "0", id="an error is that of the item"),
        pytest.param(INTERRUPTED, "0", id="no fork outlives an interruption"),
        pytest.param(FORKS, "[False]", id="the forks do the work"),
        pytest.param(REFUSED, "True", id="where no process can be made all is done here"),
        pytest.param(THREADS, f"{PROCESSORS} True 1", id="a process with threads has no forks"),
        *(
            pytest.param(PROGRESS.format(workers=count), "True", id=f"progress of {count}")
            for count in (1, 3, 12)
        ),
        *(
            pytest.param(UNDELIVERED.format(end=end), "True 0", id=f"a fork {what}")
            for what, end in ENDS.items()
        ),
    ],
)
def test_whatever_happens_to_the_forks(script, printed):
    """What a fork does not deliver is done by the process itself."""
    assert python(script) == printed


def test_a_fork_is_killed_with_the_process():
    script = """
def work(item):
    time.sleep(0.2)
    os.kill(me, signal.SIGKILL)
    signal.pause()
shared_out(work, items, workers=3)
"""
    python(script, code=-signal.SIGKILL)


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


def test_variables_are_set_for_a_while(monkeypatch):
    monkeypatch.setenv("MAPMORE_OLD", "before")
    monkeypatch.delenv("MAPMORE_NEW", raising=False)
    with variables_set({"MAPMORE_OLD": "1", "MAPMORE_NEW": "2"}):
        assert (os.environ["MAPMORE_OLD"], os.environ["MAPMORE_NEW"]) == ("1", "2")
    assert (os.environ["MAPMORE_OLD"], "MAPMORE_NEW" in os.environ) == ("before", False)
