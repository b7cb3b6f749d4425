"""Many runs at once, each in a worker process; one that fails does not stop the rest."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import active_children, get_context
from pathlib import Path
from typing import TYPE_CHECKING

from mapmore_cli.storage.run_folder import RunFiles

if TYPE_CHECKING:
    from mapmore_cli.domain.scores import Limit, Published, Validation


@dataclass(frozen=True)
class Job:
    """One run to do."""

    config: Path
    runs: Path
    overrides: tuple[str, ...] = ()
    force: bool = False
    rehash: bool = False
    campaign: Path | None = None


@dataclass(frozen=True)
class Finished:
    """A run that came to its end, after `seconds`, with the `limits` that its scores are held to."""

    name: str
    run_dir: Path
    stages: Mapping[str, str]
    validation: Validation
    published: Published | None
    limits: tuple[Limit, ...]
    warnings: tuple[str, ...]
    seconds: float = 0.0

    @property
    def missed(self) -> tuple[str, ...]:
        """The limits that it misses, each as a sentence."""
        return tuple(limit.sentence for limit in self.limits if not limit.kept)


def run_all(jobs: Sequence[Job], workers: int) -> Iterator[tuple[int, Finished | BaseException]]:
    """Do the jobs and yield the number of each with what came of it, as they end; an interrupt ends them all.

    The runs that they need come first, one after the other: two jobs may need the same one.
    """
    # Spawned, not forked: a fork of a process with BLAS threads or an open HDF5 file may hang.
    pool = ProcessPoolExecutor(min(workers, len(jobs)), mp_context=get_context("spawn"))
    try:
        with _deaf_to_interrupts():
            prepared = pool.submit(prepare_all, jobs)
        prepared.result()
        with _deaf_to_interrupts():
            futures: dict[Future[Finished], int] = {pool.submit(run_one, job): number for number, job in enumerate(jobs)}
        for future in as_completed(futures):
            yield futures[future], future.exception() or future.result()
    except KeyboardInterrupt:
        for worker in active_children():
            worker.terminate()  # run folders can bear that at any instant
        raise
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Ignore Ctrl-C, which processes that start meanwhile inherit: else each of them would answer it with a traceback."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def prepare_all(jobs: Sequence[Job]) -> None:
    """Bring the runs up to date that the jobs need. What goes wrong is told by the job that needs it."""
    from mapmore_cli.domain.errors import MapmoreError
    from mapmore_cli.spec.loader import load
    from mapmore_cli.stages.pipeline.runner import prepare

    for job in jobs:
        with suppress(MapmoreError):  # a spec that is wrong
            prepare(load(job.config, job.overrides), job.runs)


def run_one(job: Job) -> Finished:
    """Bring one run up to date and read its scores; raises what that raises."""
    from mapmore_cli.spec.loader import load
    from mapmore_cli.stages.pipeline.runner import bring_up_to_date
    from mapmore_cli.stages.validate import limits

    started = time.perf_counter()
    loaded = load(job.config, job.overrides)
    warnings: list[str] = []
    outcome = bring_up_to_date(loaded, job.runs, force=job.force, rehash=job.rehash, warn=warnings.append, campaign=job.campaign)
    validation = RunFiles(outcome.run_dir).validation()
    held_to = limits(loaded.spec.validation.require, validation.scores)
    published = loaded.spec.report.published
    printed = published.numbers if published else None
    seconds = time.perf_counter() - started
    return Finished(outcome.name, outcome.run_dir, outcome.stages, validation, printed, held_to, tuple(warnings), seconds)
