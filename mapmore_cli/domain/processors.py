"""The processors of this machine: the threads that libraries start, and work that is shared out to
copies of this process.

Only what tries many settings is shared out (`tune`), where two processors take about half the time.
A run has one process.
"""

from __future__ import annotations

import os
import signal
import sys
from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from itertools import chain
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from io import FileIO
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
    """`[work(item) for item in items]`, each item done by the process that is free first.

    The others are forks: copies that have the items already. What they return must be picklable,
    and whatever else they change is lost. What a copy does not deliver, for whatever reason, is
    done here, so that an error is raised as without copies.

    - `progress`: is told how many items are in work or done, of how many.
    - `processes`: how many there are with this one; by default as many as this machine has for them
      (`free_processors`).
    """
    count = max(1, min(len(items), free_processors() if processes is None else processes))
    with TemporaryFile(buffering=0) as queue:
        queue.write(array("q", range(count, len(items))))
        queue.seek(0)
        shares = [chain([first], _drawn(queue)) for first in range(count)]
        with ExitStack() as stack:
            copies = [stack.enter_context(_copy(work, items, share)) for share in shares[1:]]
            found = {}
            for number in shares[0] if items else ():
                found[number] = work(items[number])
                progress(number + 1, len(items))
            for copy in copies:
                found |= _received(copy)
    return [found[number] if number in found else work(item) for number, item in enumerate(items)]


def _drawn(queue: FileIO) -> Iterator[int]:
    """Yield the next number that no process has drawn: forks share their place in an open file."""
    while number := queue.read(8):
        yield int.from_bytes(number, sys.byteorder)


def free_processors() -> int:
    """How many processes work may be shared out to: one where copies are not safe, or where all
    processors are at work already.

    A fork of a process with threads may hang, and on macOS a fork without them too: only Linux has
    copies, of a process with one thread. A copy, a worker of a campaign, and a process that has
    some at work make none.
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
def _copy(work: Callable[[T], R], items: Sequence[T], share: Iterable[int]) -> Iterator[Connection]:
    """Set a fork to work on a share, and say where it tells what came of it; what is left of it
    ends with the context.
    """
    from multiprocessing import get_context

    fork = get_context("fork")
    receiver, sender = fork.Pipe(duplex=False)
    process = fork.Process(
        target=_deliver, args=(work, items, share, sender, os.getpid()), daemon=True
    )
    with receiver:
        heard = signal.pthread_sigmask(
            signal.SIG_BLOCK, {signal.SIGINT}
        )  # Ctrl-C is for the process that waits
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


def _deliver(
    work: Callable[[T], R],
    items: Sequence[T],
    share: Iterable[int],
    sender: Connection,
    parent: int,
) -> None:
    """Do the work of a fork. It ends without a word and without what others are to do at the
    end.
    """
    with suppress(BaseException):
        killed_with(parent)
        sender.send({number: work(items[number]) for number in share})
    os._exit(0)


def killed_with(parent: int) -> None:
    """Have this process killed by the system when its parent ends, in whatever way, where the
    system is Linux.
    """
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(_DEATH_SIGNAL, int(signal.SIGKILL), 0, 0, 0)
        if os.getppid() != parent:  # it ended before
            os._exit(1)


def _received(copy: Connection) -> dict[int, Any]:
    """Return what a fork delivered, by the numbers of the items; nothing where it ended before."""
    try:
        found: dict[int, Any] = copy.recv()
    except (EOFError, OSError):
        return {}
    return found
