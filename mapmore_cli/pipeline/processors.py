"""Use the processors of this machine: distribute work over worker processes with one BLAS thread
each.

All parallel work uses a `concurrent.futures.Executor`. The combinations of `tune` and the
structures of a search are computed in forks of this process. The runs of a campaign are done in new
processes, or on a Dask cluster.
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
    """Restrict BLAS to one thread within the context. Sums are then the same on every machine, and
    runs do not compete for processors.

    A BLAS library that is already loaded is restricted by a call. A library that is loaded later,
    for example that of SciPy, reads environment variables when it is loaded.
    """
    with variables_set(dict.fromkeys(THREADS, "1")):
        loaded = "scipy.linalg" in sys.modules or "scipy.special" in sys.modules
        with _thread_pools(loaded).limit(limits=1):
            yield


@cache
def _thread_pools(_with_scipy: bool) -> ThreadpoolController:
    """Return a controller of all loaded libraries that use threads, such as BLAS. The result is
    cached, because the search for libraries takes longer than a small stage. It is computed again
    when `_with_scipy` changes, that is, when SciPy and its library have been loaded.
    """
    import numpy  # noqa: F401 - has one of them
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


@contextmanager
def variables_set(variables: Mapping[str, str]) -> Iterator[None]:
    """Set environment variables within the context, and restore them afterwards."""
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
    """Start `count` worker processes by `method` (`fork` or `spawn`), and return a pool of them.

    The worker processes end when the context ends, or when this process ends for any reason. If the
    context ends by an error or an interrupt, the worker processes are killed without waiting for
    their work.

    `work` is the function and the items for `_do_numbered`. Forks inherit `work` with the memory of
    this process, so that it need not be pickled.
    """
    from multiprocessing import active_children, get_context

    begin = partial(_begin, os.getpid(), work)
    try:
        pool = ProcessPoolExecutor(count, get_context(method), initializer=begin)
    # a pool needs locks between processes; the system may not support them, or may have no space
    # left for their files
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
"""In a worker process: the function and the items of `shared_out`, which the parent process has
passed on. In other processes: None.
"""


def _begin(parent: int, work: object) -> None:
    """Prepare a worker process. It ignores Ctrl-C, because the parent process handles it."""
    global _shared
    _shared = work
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    warnings.simplefilter("ignore", PluginLeftOut)  # the parent process shows these warnings
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(1, int(signal.SIGKILL), 0, 0, 0)  # PR_SET_PDEATHSIG
        if os.getppid() != parent:  # the parent process has already ended
            os._exit(1)
    else:
        Thread(target=_watch_parent, daemon=True).start()


def _watch_parent() -> NoReturn:
    """End this process when the parent process ends. The end is recognised by a pipe that only the
    parent process holds open. The process may be killed at any time, because run folders are valid
    after every step.
    """
    from multiprocessing import parent_process

    if (watched := parent_process()) is not None:
        watched.join()
    os._exit(1)


@contextmanager
def deaf_to_interrupts() -> Iterator[None]:
    """Make worker processes that start within the context ignore Ctrl-C from their start;
    otherwise, each of them would print a traceback. If Ctrl-C arrives within the context, this
    process handles it at the end of the context.
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
    """Return the number of processes to use for parallel work: the number of processors, but at
    most `MOST_PROCESSES`. Return 1 if the work must not be distributed, for two possible reasons:

    - Forks are not safe. A fork of a process with several threads may hang; on macOS, even a fork
      of a process with one thread may hang. Therefore, forks are used only on Linux, and only by a
      process with one thread.
    - This process is itself a worker process, or already has worker processes.
    """
    # folder with one entry for each thread of this process; some systems lack `/proc`
    threads = "/proc/self/task"
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
    """Return `[work(item) for item in items]`, computed in parallel by forks of this process. A
    fork has a copy of the memory, so that the items need not be sent to it.

    The results must be picklable. If a fork changes anything else, for example a global variable,
    this process does not see the change. If a fork fails for any reason and returns no result, this
    process computes the result itself, so that errors are raised as without forks.

    - `progress`: function that is called with the number of finished items and the number of all
      items.
    - `workers`: number of forks; by default, `free_processors()`.
    """
    delivered: dict[int, R] = {}
    count = min(len(items), free_processors() if workers is None else workers)
    if count > 1:
        # if no worker process can be started, this process computes all items below
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
    """Compute one item of `shared_out` in a worker process. `number` is the index of the item."""
    work, items = cast(tuple[Callable[[object], object], Sequence[object]], _shared)
    return work(items[number])
