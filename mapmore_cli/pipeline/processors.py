"""The processors of this machine: work in worker processes, of which each has one BLAS thread.

Everything that is done side by side goes through a `concurrent.futures.Executor`: combinations of
`tune` and structures of a search in forks of this process, runs of a campaign in processes that are
started again, or on a Dask cluster.
"""

from __future__ import annotations

import os
import signal
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, suppress
from functools import cache, partial
from threading import Thread
from typing import TYPE_CHECKING, NoReturn, TypeVar, cast

from mapmore_cli import THREADS
from mapmore_cli.domain.errors import WriteError
from mapmore_cli.domain.plugins import PluginLeftOut

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

T = TypeVar("T")
R = TypeVar("R")

MOST_PROCESSES = 4
"""Each of them may need as much memory as one."""


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Hold BLAS to one thread: the same sums on every machine, and no fight between runs for the
    processors.

    A library that is loaded already is told so. One that is loaded meanwhile, as SciPy's, reads it
    in the environment when it starts.
    """
    with variables_set(dict.fromkeys(THREADS, "1")):
        loaded = "scipy.linalg" in sys.modules or "scipy.special" in sys.modules
        with _thread_pools(loaded).limit(limits=1):
            yield


@cache
def _thread_pools(_with_scipy: bool) -> ThreadpoolController:
    """Return the libraries with threads; looked for once, and again when SciPy's has come too: it
    takes longer than a small stage.
    """
    import numpy  # noqa: F401 - has one of them
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


@contextmanager
def variables_set(variables: Mapping[str, str]) -> Iterator[None]:
    """Set variables of the environment for a while."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name, None)
            os.environ |= {} if value is None else {name: value}


@contextmanager
def processes(count: int, method: str, work: object = None) -> Iterator[ProcessPoolExecutor]:
    """Have `count` worker processes, made by `method` (`fork` or `spawn`).

    They end with the context, and with this process in whatever way it ends. Where an error or an
    interrupt ends the context, they are killed at work. `work` is what `_do_numbered` finds in
    forks, which have it without pickling.
    """
    from multiprocessing import active_children, get_context

    begin = partial(_begin, os.getpid(), work)
    try:
        pool = ProcessPoolExecutor(count, get_context(method), initializer=begin)
    # the system keeps the locks between processes as small files, or has none
    except (OSError, NotImplementedError) as fault:
        raise WriteError(
            f"a worker process cannot be started: {getattr(fault, 'strerror', None) or fault}",
            "free some shared memory (/dev/shm) and disk space",
        ) from fault
    with pool:
        try:
            yield pool
        except BaseException:
            for worker in active_children():
                worker.kill()
            raise


_shared: object = None
"""In a worker process: what all of them have."""


def _begin(parent: int, work: object) -> None:
    """Prepare a worker process: Ctrl-C is for the process that waits."""
    global _shared
    _shared = work
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    warnings.simplefilter("ignore", PluginLeftOut)  # the process that waits has told them
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(1, int(signal.SIGKILL), 0, 0, 0)  # PR_SET_PDEATHSIG
        if os.getppid() != parent:  # it ended before
            os._exit(1)
    else:
        Thread(target=_watch_parent, daemon=True).start()


def _watch_parent() -> NoReturn:
    """Wait for the end of a pipe that only the parent holds open. Run folders can bear an end at
    any instant.
    """
    from multiprocessing import parent_process

    if (watched := parent_process()) is not None:
        watched.join()
    os._exit(1)


@contextmanager
def deaf_to_interrupts() -> Iterator[None]:
    """Let processes that start meanwhile hear no Ctrl-C: else each of them would answer it with a
    traceback. Here it waits.
    """
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def free_processors() -> int:
    """Return how many processes work may be shared out to: one where forks are not safe, or where
    all processors are at work already.

    A fork of a process with threads may hang, and on macOS a fork without them too: only Linux has
    forks, of a process with one thread. A worker process makes none.
    """
    threads = "/proc/self/task"  # it is not there where /proc is not mounted
    if sys.platform != "linux" or not os.access(threads, os.R_OK):
        return 1
    if sum(1 for _ in os.scandir(threads)) != 1:
        return 1
    from multiprocessing import active_children, parent_process

    busy = parent_process() is not None or active_children()
    return 1 if busy else min(len(os.sched_getaffinity(0)), MOST_PROCESSES)


def shared_out(
    work: Callable[[T], R],
    items: Sequence[T],
    progress: Callable[[int, int], None] = lambda _done, _total: None,
    workers: int | None = None,
) -> list[R]:
    """Return `[work(item) for item in items]`, by forks of this process, which have the items
    already.

    What they return must be picklable, and whatever else they change is lost. What a fork does not
    deliver, for whatever reason, is done here, so that an error is raised as without forks.

    - `progress`: is told how many items are done, of how many.
    - `workers`: how many there are; by default as many as this machine has for them
      (`free_processors`).
    """
    delivered: dict[int, R] = {}
    count = min(len(items), free_processors() if workers is None else workers)
    if count > 1:
        # no room for a process: all is done here
        with suppress(OSError, WriteError), processes(count, "fork", (work, items)) as pool:
            with deaf_to_interrupts():
                futures = [pool.submit(_do_numbered, number) for number in range(len(items))]
            for number, future in enumerate(futures):
                if future.exception() is None:
                    delivered[number] = cast(R, future.result())
                progress(number + 1, len(items))
    results = []
    for number, item in enumerate(items):
        results.append(delivered[number] if number in delivered else work(item))
        if count <= 1:
            progress(number + 1, len(items))
    return results


def _do_numbered(number: int) -> object:
    """Do one of the items that this worker process has."""
    work, items = cast(tuple[Callable[[object], object], Sequence[object]], _shared)
    return work(items[number])
