"""Worker processes on this machine: one job each at a time, and none that outlives the process
which started it.
"""

from __future__ import annotations

import os
import signal
import sys
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing import active_children, get_context, parent_process
from threading import Thread
from types import FrameType, TracebackType
from typing import NoReturn, Protocol, TypeVar

from mapmore_cli.domain.errors import MapmoreError, Stopped, WriteError
from mapmore_cli.domain.processors import killed_with

J = TypeVar("J")
T = TypeVar("T")

ATTEMPTS = 2
"""How often a job is started whose worker dies: once more may help where another program filled the
memory, and no more.
"""


class Workers(Protocol):
    """Where jobs are done: processes of this machine, or a cluster. A context manager, which ends
    its workers' jobs when it is left.
    """

    def __enter__(self) -> Workers: ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        where: TracebackType | None,
    ) -> None: ...

    def each(
        self, function: Callable[[J], T], jobs: Sequence[J]
    ) -> Iterator[tuple[int, T | BaseException]]:
        """Call `function` with every job, several at a time; yield the number of each with what
        came of it, as they end.
        """


@dataclass
class LocalWorkers:
    """At most `count` processes. A job whose worker dies is started once more, which `tell` is told
    with the job's number.
    """

    count: int
    tell: Callable[[int, str], None] = lambda _number, _message: None
    _pools: list[ProcessPoolExecutor] = field(
        default_factory=list
    )  # of one process each: one that dies takes no other job with it

    def __enter__(self) -> LocalWorkers:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        where: TracebackType | None,
    ) -> None:
        for worker in active_children() if kind is not None else ():
            worker.terminate()  # run folders can bear that at any instant
        for pool in self._pools:
            pool.shutdown(wait=False, cancel_futures=True)

    def each(
        self, function: Callable[[J], T], jobs: Sequence[J]
    ) -> Iterator[tuple[int, T | BaseException]]:
        """Do the jobs in the order that is given, as far as workers are free."""
        while len(self._pools) < min(self.count, len(jobs)):
            self._pools.append(_one_process())
        waiting, free = deque(range(len(jobs))), list(range(len(self._pools)))
        started: Counter[int] = Counter()
        running: dict[Future[T], tuple[int, int]] = {}
        while waiting or running:
            while waiting and free:
                number, place = waiting.popleft(), free.pop(0)
                started[number] += 1
                with _deaf_to_interrupts():
                    running[self._pools[place].submit(function, jobs[number])] = number, place
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                number, place = running.pop(future)
                free.append(place)
                error = future.exception()
                if not isinstance(error, BrokenProcessPool):
                    yield number, error or future.result()
                    continue
                self._pools[place].shutdown(wait=False)
                self._pools[place] = _one_process()
                if started[number] < ATTEMPTS:
                    self.tell(number, "its worker process died; it is started again")
                    waiting.appendleft(number)
                else:
                    yield number, worker_died(started[number])


def worker_died(times: int) -> MapmoreError:
    """Return what came of a job that no worker survived."""
    remedy = "see whether the system ended it for want of memory; fewer runs at a time need less"
    return MapmoreError(f"the process that worked on it died {times} times", remedy)


def _one_process() -> ProcessPoolExecutor:
    try:
        # Spawned, not forked: a fork of a process with BLAS threads or an open HDF5 file may hang.
        return ProcessPoolExecutor(
            1, mp_context=get_context("spawn"), initializer=end_with_parent, initargs=(os.getpid(),)
        )
    except OSError as fault:  # the system keeps the locks between processes as small files
        what = f"no worker process can be started: {os.strerror(fault.errno or 0)}"
        raise WriteError(
            what,
            "make room in shared memory (/dev/shm) and on the disk, or use `mapmore run` for "
            "each spec",
        ) from fault


def end_with_parent(parent: int) -> None:
    """Have this worker process killed when its parent ends, in whatever way: by the system where
    that is Linux, else by a thread.
    """
    killed_with(parent)
    Thread(target=_watch_parent, daemon=True).start()


def _watch_parent() -> NoReturn:
    """Wait for the end of a pipe that only the parent holds open. Run folders can bear an end at
    any instant.
    """
    watched = parent_process()
    if watched is not None:
        watched.join()
    os._exit(1)


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Let processes that start meanwhile hear no Ctrl-C: else each of them would answer it with a
    traceback. Here it waits.
    """
    if sys.platform == "win32":
        heard = signal.signal(signal.SIGINT, signal.SIG_IGN)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, heard)
    else:
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def stoppable() -> Iterator[None]:
    """Let SIGTERM and SIGHUP raise `Stopped`, so that what has begun is ended; a signal that is
    ignored, as under `nohup`, stays so.
    """

    def stop(number: int, _frame: FrameType | None) -> NoReturn:
        raise Stopped(number)

    wanted = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {number: signal.getsignal(number) for number in wanted}
    heard = [number for number, handler in before.items() if handler is signal.SIG_DFL]
    for number in heard:
        signal.signal(number, stop)
    try:
        yield
    finally:
        for number in heard:
            signal.signal(number, before[number])
