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
    """Restrict BLAS to one thread, so that sums are the same on every machine and runs do not
    compete for processors.

    A BLAS library that is already loaded is restricted by a call. A library that is loaded later,
    for example that of SciPy, reads environment variables when it is loaded.
    """
    with variables_set(dict.fromkeys(THREADS, "1")):
        loaded = "scipy.linalg" in sys.modules or "scipy.special" in sys.modules
        with _thread_pools(loaded).limit(limits=1):
            yield


@cache
def _thread_pools(_with_scipy: bool) -> ThreadpoolController:
    """Return the loaded libraries that use threads. The result is kept until SciPy is loaded,
    because the search for libraries takes longer than a small stage.
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
    """Start `count` worker processes by `method` (`fork` or `spawn`).

    They end when the context ends, or when this process ends for any reason. If an error or an
    interrupt ends the context, the worker processes are killed during their work.

    `work` is the function and the items for `_do_numbered`. Forks inherit `work` with the memory of
    this process, so that it need not be pickled.
    """
    from multiprocessing import active_children, get_context

    begin = partial(_begin, os.getpid(), work)
    try:
        pool = ProcessPoolExecutor(count, get_context(method), initializer=begin)
    # this system may have no locks between processes, or no space for the files of such locks
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
    """Prepare a worker process. It ignores Ctrl-C, because the parent process handles it."""
    global _shared
    _shared = work
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    warnings.simplefilter("ignore", PluginLeftOut)  # the parent process shows them
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(1, int(signal.SIGKILL), 0, 0, 0)  # PR_SET_PDEATHSIG
        if os.getppid() != parent:  # the parent process has already ended
            os._exit(1)
    else:
        Thread(target=_watch_parent, daemon=True).start()


def _watch_parent() -> NoReturn:
    """End this process when the parent process ends. It notices that end by a pipe that only the
    parent process holds open. Run folders remain valid, whenever the process ends.
    """
    from multiprocessing import parent_process

    if (watched := parent_process()) is not None:
        watched.join()
    os._exit(1)


@contextmanager
def deaf_to_interrupts() -> Iterator[None]:
    """Make processes that start within the context ignore Ctrl-C, because each of them would print
    a traceback. In this process, Ctrl-C is handled when the context ends.
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
    threads = "/proc/self/task"  # without /proc, this folder does not exist
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

    The results must be picklable; anything else that a fork changes is lost. If a fork returns no
    result for any reason, this process computes the result, so that errors are raised as without
    forks.

    - `progress`: function that is called with the number of finished items and the number of all
      items.
    - `workers`: number of forks; by default, the number of free processors (`free_processors`).
    """
    delivered: dict[int, R] = {}
    count = min(len(items), free_processors() if workers is None else workers)
    if count > 1:
        # if no worker process can be started, this process does all items below
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
