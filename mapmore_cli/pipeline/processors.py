"""Use the processors of this machine: distribute work over worker processes with one BLAS thread
each.

All parallel work goes through a `concurrent.futures.Executor`: combinations of `tune` and
structures of a search in forks of this process, runs of a campaign in new processes or on a Dask
cluster.
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
"""Largest number of worker processes, because each may need as much memory as this one."""


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Restrict BLAS to one thread, so that sums are the same on every machine and runs do not
    compete for processors.

    A library that is already loaded is restricted by a call. A library that is loaded later, such
    as SciPy's, reads the environment variables when it starts.
    """
    with variables_set(dict.fromkeys(THREADS, "1")):
        loaded = "scipy.linalg" in sys.modules or "scipy.special" in sys.modules
        with _thread_pools(loaded).limit(limits=1):
            yield


@cache
def _thread_pools(_with_scipy: bool) -> ThreadpoolController:
    """Return the libraries with threads. They are looked up only once, and again after SciPy is
    loaded, because looking them up takes longer than a small stage.
    """
    import numpy  # noqa: F401 - has one of them
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


@contextmanager
def variables_set(variables: Mapping[str, str]) -> Iterator[None]:
    """Set environment variables within the context."""
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
    """Start `count` worker processes by `method` (`fork` or `spawn`).

    They end with the context, and with this process, however it ends. If an error or an interrupt
    ends the context, they are killed during their work. Forks get `work`, the function and the
    items for `_do_numbered`, with the memory of this process, so that it need not be pickled.
    """
    from multiprocessing import active_children, get_context

    begin = partial(_begin, os.getpid(), work)
    try:
        pool = ProcessPoolExecutor(count, get_context(method), initializer=begin)
    # locks between processes may be missing on this system, or the small files in which it keeps
    # them cannot be made
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
"""In a worker process: the function and the items of the work, which it has from the parent
process.
"""


def _begin(parent: int, work: object) -> None:
    """Prepare a worker process, which ignores Ctrl-C because the waiting process handles it."""
    global _shared
    _shared = work
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    warnings.simplefilter("ignore", PluginLeftOut)  # the waiting process has already reported them
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(1, int(signal.SIGKILL), 0, 0, 0)  # PR_SET_PDEATHSIG
        if os.getppid() != parent:  # the parent process ended before this process was ready
            os._exit(1)
    else:
        Thread(target=_watch_parent, daemon=True).start()


def _watch_parent() -> NoReturn:
    """Wait for the end of a pipe that only the parent process holds open, and then end this
    process: the parent no longer exists. Run folders stay valid at any moment.
    """
    from multiprocessing import parent_process

    if (watched := parent_process()) is not None:
        watched.join()
    os._exit(1)


@contextmanager
def deaf_to_interrupts() -> Iterator[None]:
    """Let processes that start within the context ignore Ctrl-C, because each of them would print a
    traceback. In this process, Ctrl-C takes effect after the context.
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
    """Return the number of processes for parallel work: one if forks are not safe, or if all
    processors are busy.

    A fork of a process with threads may hang, and on macOS even one without threads. Therefore,
    forks are used only on Linux, and only by a process with one thread. A worker process starts no
    further processes.
    """
    threads = "/proc/self/task"  # the folder is missing if /proc is not mounted
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
    """Return `[work(item) for item in items]`, computed by forks of this process, which have the
    items already.

    The results must be picklable, and other changes by forks are lost. If a fork does not deliver a
    result, for whatever reason, this process computes it, so that errors are raised as without
    forks.

    - `progress`: called with the number of items done, and of all items.
    - `workers`: number of forks; by default, as many as this machine has free (`free_processors`).
    """
    delivered: dict[int, R] = {}
    count = min(len(items), free_processors() if workers is None else workers)
    if count > 1:
        # if there are no resources for processes, this process does all items below
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
    """Do one item of the work of `shared_out` in a worker process. `number` is the index of the
    item.
    """
    work, items = cast(tuple[Callable[[object], object], Sequence[object]], _shared)
    return work(items[number])
