"""Do jobs in worker processes of this machine. A signal to the main process can stop them."""

from __future__ import annotations

import signal
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import CancelledError, Future, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

from mapmore_cli.domain.errors import MapmoreError, Stopped
from mapmore_cli.pipeline.processors import R, T, deaf_to_interrupts, processes


def ended(futures: Mapping[Future[R], int]) -> Iterator[tuple[int, R | BaseException]]:
    """Yield the number of each job with its result or its error, in the order in which jobs end."""
    for future in as_completed(futures):
        try:
            yield futures[future], future.exception() or future.result()
        except CancelledError:
            lost = MapmoreError(
                "the scheduler ended or dropped this run",
                "start the command again; finished runs are not repeated",
            )
            yield futures[future], lost


def in_processes(
    work: Callable[[T], R],
    jobs: Mapping[int, T],
    count: int,
    tell: Callable[[int, str], None],
    *,
    again: bool = False,
) -> Generator[tuple[int, R | BaseException], None, None]:
    """Do numbered jobs in `count` new processes. As `ended` does, yield the number of each job with
    its result or its error, in the order in which jobs end.

    If a worker process dies, the jobs that have not ended stop as well. The first `count` of these
    jobs are then started again, one at a time, because the memory may have been too small for
    several. Before each of them, `tell` is called with its number and a message. After that, the
    others are done in `count` new processes. With `again`, the jobs have been started for the
    second time: if a worker dies now, its job gets an error.
    """
    if not jobs:  # a pool must have at least one process
        return
    left = dict(jobs)
    # Workers are spawned. A fork of a process with BLAS threads or an open HDF5 file may hang.
    with processes(min(count, len(jobs)), "spawn") as pool:
        with deaf_to_interrupts():
            futures = {pool.submit(work, job): number for number, job in jobs.items()}
        for number, outcome in ended(futures):
            if not isinstance(outcome, BrokenProcessPool):
                del left[number]
                yield number, outcome
    if again:
        for number in left:
            yield number, worker_died(2)
        return
    for number in list(left)[:count]:
        tell(number, "its worker process died; the run is started again")
        yield from in_processes(work, {number: left.pop(number)}, 1, tell, again=True)
    if left:
        yield from in_processes(work, left, count, tell)


def worker_died(times: int) -> MapmoreError:
    """Return the error that a job gets after its worker has died `times` times."""
    remedy = (
        "check whether the system ended it because memory was short; use fewer runs at a time "
        "(--jobs)"
    )
    return MapmoreError(f"the worker process of this run died {times} times", remedy)


@contextmanager
def stoppable() -> Iterator[None]:
    """Let SIGTERM and SIGHUP raise `Stopped`, so that work in progress ends properly. A signal that
    is ignored, for example under `nohup`, stays ignored.
    """

    def stop(number: int, _frame: FrameType | None) -> NoReturn:
        raise Stopped(number)

    wanted = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    heard = [number for number in wanted if signal.getsignal(number) is signal.SIG_DFL]
    for number in heard:
        signal.signal(number, stop)
    try:
        yield
    finally:
        for number in heard:
            signal.signal(number, signal.SIG_DFL)
