"""Do jobs on the workers of a running Dask cluster. The workers receive the paths of files and find
the files on a shared file system.

Only names of files, settings and scores go over the network. `distributed` is imported only here.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from secrets import token_hex
from threading import Lock
from typing import TYPE_CHECKING, Any

from mapmore_cli.annexes.campaigns.sealed import run_and_seal
from mapmore_cli.annexes.campaigns.workers import ended, worker_died
from mapmore_cli.domain.errors import MapmoreError, UsageError, Warn, WriteError
from mapmore_cli.pipeline.jobs import Finished, Job
from mapmore_cli.pipeline.processors import variables_set
from mapmore_cli.storage.atomic import TEMPORARY, refusals_told, write_own
from mapmore_cli.storage.run_record import tool_versions

if TYPE_CHECKING:
    from distributed import Client

CONNECT = "10s"
"""Time within which a scheduler must answer, as `distributed` writes it."""

_one_at_a_time = Lock()
"""Lock that lets a worker process do only one job at a time, because BLAS threads and environment
variables belong to the whole process.
"""


@dataclass(frozen=True)
class Shared:
    """Data that a worker needs in addition to its job: an empty file in the folder of runs, the
    version of mapmore, and the variables that specs may use. A worker that finds the file sees the
    same folder of runs as the client (the computer on which `mapmore batch` was started).
    """

    token: Path
    version: str
    environment: Mapping[str, str]

    def check(self) -> None:
        """Check that this process can do jobs. Raises WriteError if this process does not find the
        file `token`, because it then does not see the folder of runs of the client; and UsageError
        if its version of mapmore differs from the version of the client.
        """
        if tool_versions()["mapmore"] != self.version:
            raise UsageError(
                f"a worker of the cluster has mapmore {tool_versions()['mapmore']}, but "
                f"this computer has {self.version}",
                "install the same version everywhere",
            )
        if not self.token.is_file():
            raise WriteError(
                f"{self.token.parent}: a worker of the cluster does not see the same folder "
                "as this computer",
                "choose a folder with --runs that the workers share with this computer, at "
                "the same path",
            )


@contextmanager
def shared_folder(runs: Path) -> Iterator[Shared]:
    """Write an empty file into the folder of runs, by which workers check that they see this
    folder. At the end, delete the file. Jobs that have not begun by then are refused by the
    workers.
    """
    token = runs.absolute() / f"{TEMPORARY}{token_hex(6)}-shared"
    with refusals_told(runs):
        runs.mkdir(parents=True, exist_ok=True)
    write_own(token, "")
    ours = {name: value for name, value in os.environ.items() if name.startswith("MAPMORE_")}
    try:
        yield Shared(token, tool_versions()["mapmore"], ours)
    finally:
        token.unlink(missing_ok=True)


def run_on_cluster(
    jobs: Mapping[int, Job],
    scheduler: str | Path,
    runs: Path,
    tell: Callable[[int, str], None],
    say: Warn,
) -> Generator[tuple[int, Finished | BaseException], None, None]:
    """Do numbered jobs on the workers of a scheduler, which is given by its address or by the file
    that it wrote. As `workers.ended` does, yield the number of each job with its result or its
    error, in the order in which jobs end.

    If a worker dies, the scheduler starts its job again, at most as often as the setting
    `allowed-failures` of the scheduler says (3 by default). Each time, `tell` is called with the
    number of the job and a message. `say` is called with messages that concern no single job.
    """
    begun = Counter[int]()

    def count(event: tuple[Any, Any]) -> None:  # called in a thread of the client
        begun[event[1]] += 1
        if begun[event[1]] > 1:
            tell(event[1], "its worker died or was lost; the run is started again")

    with shared_folder(runs) as shared, _connected(scheduler) as client:
        client.subscribe_topic(shared.token.name, count)
        if not client.scheduler_info()["workers"]:
            say(f"{scheduler}: waiting for a worker")
            client.wait_for_workers(1)
        say(f"{scheduler}: {checked_workers(client, shared)} workers, which share {runs}")
        # A job also writes files, so Dask must not replace it by a stored result (`pure=False`).
        # A job that raised an error would raise it again, so it is not repeated (`retries=0`).
        executor = client.get_executor(pure=False, retries=0)
        futures = {
            executor.submit(_work, job.elsewhere(), shared, number): number
            for number, job in jobs.items()
        }
        for number, outcome in ended(futures):
            if type(outcome).__name__ == "KilledWorker":
                yield number, worker_died(getattr(outcome, "allowed_failures", 0) + 1)
            else:
                yield number, outcome


ATTEMPTS = 3
"""Largest number of times that all workers are checked. The check is repeated if a worker is lost
during it.
"""


def checked_workers(client: Client, shared: Shared, attempts: int = ATTEMPTS) -> int:
    """Check all workers, and return their number. Raises UsageError if they cannot run the jobs or
    if some are lost during the check, WriteError if they do not see the folder of runs.
    """
    from distributed.comm import CommClosedError

    try:
        return len(client.run(shared.check))
    except MapmoreError:
        raise
    except CommClosedError as fault:
        if attempts > 1:  # the scheduler removes a lost worker, and another may take its place
            client.wait_for_workers(1)
            return checked_workers(client, shared, attempts - 1)
        raise UsageError(
            f"workers of the cluster were lost {ATTEMPTS} times while they were checked",
            "look into their logs, and start them again",
        ) from fault
    # workers may raise any exception if the program does not run on them
    except Exception as fault:
        why = f"{type(fault).__name__}: {fault}".split("\n")[0]
        raise UsageError(
            f"the workers of the cluster cannot run mapmore ({why})",
            "install the same version of mapmore, with its extra `cluster`, for the scheduler, "
            "for the workers and on this computer",
        ) from fault


def _connected(scheduler: str | Path) -> Client:
    """Connect to a scheduler, and return the Dask client. Raises UsageError if the library is
    missing or no scheduler answers.
    """
    try:
        from distributed import Client
    except ImportError:
        raise UsageError(
            "a cluster needs dask and distributed, which are not installed",
            "install them with: pip install 'mapmore[cluster]'",
        ) from None
    where = {"address": scheduler}
    if isinstance(scheduler, Path):
        where = {"scheduler_file": str(scheduler)}
        # without this check, the client would wait until the file exists
        if not scheduler.is_file():
            raise UsageError(
                f"{scheduler}: this scheduler file does not exist",
                "start one with `dask scheduler --scheduler-file FILE`",
            )
    try:
        return Client(**where, timeout=CONNECT, set_as_default=False)
    except (OSError, ValueError, TypeError, KeyError) as fault:
        raise UsageError(
            f"{scheduler}: no Dask scheduler answers ({type(fault).__name__})",
            "start one with `dask scheduler`, or check the address",
        ) from fault


def _work(job: Job, shared: Shared, number: int) -> Finished:
    """Do a job on a worker of the cluster, and return its result."""
    from distributed import get_worker

    get_worker().log_event(shared.token.name, number)
    # the next job of this worker may come from another client, with other variables
    with _one_at_a_time, variables_set(shared.environment):
        shared.check()
        return run_and_seal(job)
