"""The processors of this machine: the threads that libraries start, and work that is shared out to copies of this process.

Only what tries many settings is shared out (`tune`), where two processors take about half the time. A run has one process.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

T = TypeVar("T")
R = TypeVar("R")

THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""What libraries ask for the number of their threads when they start."""

MOST_PROCESSES = 4
"""Each of them may need as much memory as one."""

_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of Linux


def shared_out(
    work: Callable[[T], R],
    items: Sequence[T],
    progress: Callable[[int, int], None] = lambda _done, _total: None,
    processes: int | None = None,
) -> list[R]:
    """`[work(item) for item in items]`, with every n-th item done by each of n processes.

    The others are forks: copies that have the items already. What they return must be picklable, and whatever else they change is lost.
    What a copy does not deliver, for whatever reason, is done here, so that an error is raised as without copies.

    - `progress`: is told how many items are done, of how many, as far as this process sees it.
    - `processes`: how many there are with this one; by default as many as this machine has for them (`free_processors`).
    """
    count = max(1, min(len(items), free_processors() if processes is None else processes))
    shares = [items[start::count] for start in range(count)]

    def own_share() -> Iterator[R]:
        for number, item in enumerate(shares[0], start=1):
            yield work(item)
            progress(min(number * count, len(items)), len(items))

    with _copies(work, shares[1:]) as copies:
        own = list(own_share())
        parts = [own, *(_received(copy) or [work(item) for item in share] for copy, share in zip(copies, shares[1:], strict=True))]
    return [parts[place % count][place // count] for place in range(len(items))]


def free_processors() -> int:
    """How many processes work may be shared out to: one where copies are not safe, or where all processors are at work already.

    A fork of a process with threads may hang, and on macOS a fork without them too: only Linux has copies, of a process with one thread.
    A copy, a worker of a campaign, and a process that has some at work make none.
    """
    if sys.platform != "linux" or _threads() != 1:
        return 1
    from multiprocessing import active_children, parent_process

    taken = parent_process() is not None or active_children()
    return 1 if taken else min(len(os.sched_getaffinity(0)), MOST_PROCESSES)


def _threads() -> int | None:
    try:
        return sum(1 for _ in os.scandir("/proc/self/task"))
    except OSError:  # not mounted
        return None


@contextmanager
def _copies(work: Callable[[T], R], shares: Sequence[Sequence[T]]) -> Iterator[list[Connection]]:
    """Set forks to work, one on each share, and say where they tell what came of it; what is left of them ends with the context."""
    with ExitStack() as stack:
        yield [stack.enter_context(_copy(work, share)) for share in shares]


@contextmanager
def _copy(work: Callable[[T], R], share: Sequence[T]) -> Iterator[Connection]:
    from multiprocessing import get_context

    fork = get_context("fork")
    receiver, sender = fork.Pipe(duplex=False)
    process = fork.Process(target=_deliver, args=(work, share, sender, os.getpid()), daemon=True)
    with receiver:
        heard = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # Ctrl-C is for the process that waits
        try:
            with sender, suppress(OSError):  # no room for a process: nothing is delivered
                process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, heard)
        try:
            yield receiver
        finally:
            if process.pid is not None:
                process.terminate()
                process.join()


def _deliver(work: Callable[[T], R], share: Sequence[T], sender: Connection, parent: int) -> None:
    """Do the work of a fork. It ends without a word and without what others are to do at the end."""
    with suppress(BaseException):
        killed_with(parent)
        sender.send([work(item) for item in share])
    os._exit(0)


def killed_with(parent: int) -> None:
    """Have this process killed by the system when its parent ends, in whatever way, where the system is Linux."""
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(_DEATH_SIGNAL, int(signal.SIGKILL), 0, 0, 0)
        if os.getppid() != parent:  # it ended before
            os._exit(1)


def _received(copy: Connection) -> list[Any] | None:
    """Return what a fork delivered; None where it ended before."""
    try:
        found: list[Any] = copy.recv()
    except (EOFError, OSError):
        return None
    return found
