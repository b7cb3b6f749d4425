"""Workers of a Dask cluster that is running: they are sent paths, and find the files on a file
system that all of them share.

Nothing but names of files, settings and scores goes over the network. `distributed` is imported
only here.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from secrets import token_hex
from threading import Lock
from types import TracebackType
from typing import Any, TypeVar

from mapmore_cli.annexes.campaigns.processes import worker_died
from mapmore_cli.domain.errors import MapmoreError, UsageError, WriteError
from mapmore_cli.pipeline.stage_maker import variables_set
from mapmore_cli.storage.atomic import TEMPORARY, refusals_told, write_text
from mapmore_cli.storage.run_record import tool_versions

J = TypeVar("J")
T = TypeVar("T")

TOPIC = "mapmore"
"""Of the events by which workers tell which job they begin with."""

CONNECT = "10s"
"""How long a scheduler may take to answer."""

_one_at_a_time = (
    Lock()
)  # in a worker process: neither BLAS threads nor environment variables are a thread's own


@dataclass(frozen=True)
class Shared:
    """What a worker needs besides its job: a file that shows whether it sees the folder of runs,
    and variables that specs may name.
    """

    token: Path
    word: str
    environment: Mapping[str, str]

    def check(self) -> None:
        """Raise WriteError where this process does not see what the client wrote."""
        try:
            seen = self.token.read_text(encoding="utf-8")
        except OSError:
            seen = ""
        if seen != self.word:
            raise WriteError(
                f"{self.token.parent}: a worker of the cluster does not see this folder as "
                "the command does",
                "choose a folder with --runs that the workers share with this computer, at "
                "the same path",
            )


@dataclass
class ClusterWorkers:
    """The workers of the scheduler at `address`, or of the one whose `file` says where it is;
    `tell` is told of a job by its number.

    A worker that dies costs its job another start, by the scheduler, at most as often as its
    setting `allowed-failures` says (3). `say` is told what happens meanwhile, `warn` what to mend.
    """

    address: str | None
    file: Path | None
    runs: Path
    tell: Callable[[int, str], None]
    say: Callable[[str], None]
    warn: Callable[[str], None]
    _events: list[tuple[str, int]] = field(default_factory=list)  # filled by a thread of the client
    _begun: Counter[tuple[str, int]] = field(default_factory=Counter)

    @property
    def _place(self) -> str:
        return self.address or str(self.file)

    def __enter__(self) -> ClusterWorkers:
        word = token_hex(6)
        meant_for_us = {
            name: value for name, value in os.environ.items() if name.startswith("MAPMORE_")
        }
        self._shared = Shared(
            self.runs.absolute() / f"{TEMPORARY}{word}-shared", word, meant_for_us
        )
        with refusals_told(self.runs):
            self.runs.mkdir(parents=True, exist_ok=True)
        write_text(self._shared.token, word)
        try:
            self._client = _connected(self.address, self.file, self._place)
            self._client.subscribe_topic(TOPIC, lambda event: self._events.append(tuple(event[1])))
            self._check_workers()
        except BaseException:
            self.__exit__(None, None, None)
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        where: TracebackType | None,
    ) -> None:
        self._shared.token.unlink(missing_ok=True)  # without it, no job begins any more
        if hasattr(self, "_client"):
            self._client.close()

    def _check_workers(self) -> None:
        if not self._client.scheduler_info()["workers"]:
            self.say(f"{self._place}: waiting for a worker")
            self._client.wait_for_workers(1)
        try:
            greetings = self._client.run(_greet, self._shared)
        except MapmoreError:
            raise
        except (
            Exception
        ) as fault:  # workers on which the program does not run are the user's to mend
            what = (
                f"{self._place}: the workers cannot run mapmore ({type(fault).__name__}: {fault})"
            ).split("\n")[0]
            raise UsageError(
                what,
                "install the same mapmore with its extra `cluster` for the scheduler, the "
                "workers and here",
            ) from fault
        for worker, (versions, threads) in sorted(greetings.items()):
            if versions["mapmore"] != tool_versions()["mapmore"]:
                found = f"{versions['mapmore']}, and {tool_versions()['mapmore']} here"
                raise UsageError(
                    f"{worker}: this worker has mapmore {found}", "install one version everywhere"
                )
            if others := [
                name for name, version in tool_versions().items() if versions[name] != version
            ]:
                self.warn(
                    f"{worker}: has other versions of {', '.join(others)}: numbers may differ "
                    "in the last digits"
                )
            if threads > 1:
                self.warn(
                    f"{worker}: has {threads} threads and does one run at a time; start "
                    "workers with `--nthreads 1`"
                )
        self.say(f"{self._place}: {len(greetings)} workers, which share {self.runs}")

    def each(
        self, function: Callable[[J], T], jobs: Sequence[J]
    ) -> Iterator[tuple[int, T | BaseException]]:
        """Do the jobs in the order that the scheduler finds best."""
        from distributed import as_completed

        batch = token_hex(6)
        futures = {}
        for number, job in enumerate(jobs):
            arguments = (function, job, self._shared, (batch, number))
            # A job is no pure function, whose result might be kept, and one that raises would raise
            # again.
            futures[
                self._client.submit(
                    _work, *arguments, key=f"mapmore-{batch}-{number}", pure=False, retries=0
                )
            ] = number
        for future in as_completed(list(futures), loop=self._client.loop, raise_errors=False):
            self._tell_of_starts(batch)
            yield futures[future], _outcome(future, self._place)
            futures.pop(future)

    def _tell_of_starts(self, batch: str) -> None:
        while self._events:
            begun = self._events.pop(0)
            self._begun[begun] += 1
            if self._begun[begun] > 1 and begun[0] == batch:
                self.tell(begun[1], "its worker died or was lost; it is started again")


def _connected(address: str | None, file: Path | None, place: str) -> Any:
    """Return a client; UsageError where there is no library for it, or no scheduler."""
    try:
        from distributed import Client
    except ImportError:
        raise UsageError(
            "a cluster needs dask and distributed, which are not installed",
            "pip install 'mapmore[cluster]'",
        ) from None
    remedy = "start one with `dask scheduler`, or check the address"
    if file is not None and not file.is_file():  # the client would wait for it
        raise UsageError(
            f"{file}: there is no such file of a scheduler",
            "start one with `dask scheduler --scheduler-file FILE`",
        )
    try:
        where = {"address": address} if file is None else {"scheduler_file": str(file)}
        return Client(**where, timeout=CONNECT, set_as_default=False)
    except (OSError, ValueError, TypeError, KeyError) as fault:
        raise UsageError(
            f"{place}: no Dask scheduler answers ({type(fault).__name__})", remedy
        ) from fault


def _outcome(future: Any, place: str) -> Any:
    """Return what came of a job: its result or its error."""
    if future.cancelled() or future.status == "lost":
        return MapmoreError(
            f"{place}: the scheduler ended or dropped this run",
            "start it again; finished runs are not done anew",
        )
    if (error := future.exception()) is None:
        return future.result()
    if type(error).__name__ == "KilledWorker":
        return worker_died(error.allowed_failures + 1)
    return error


def _greet(shared: Shared, dask_worker: Any) -> tuple[dict[str, str], int]:
    """Return, on a worker, its versions and the number of its threads, once it is clear that it
    sees the folder of runs.
    """
    shared.check()
    return dict(tool_versions()), int(dask_worker.state.nthreads)


def _work(function: Callable[[J], T], job: J, shared: Shared, begun: tuple[str, int]) -> T:
    """Do a job, on a worker."""
    from distributed import get_worker

    get_worker().log_event(TOPIC, begun)
    with (
        _one_at_a_time,
        variables_set(shared.environment),
    ):  # the next job may come from another client
        shared.check()
        return function(job)
