"""Many runs at once, wherever the workers are; one that fails does not stop the rest."""

from __future__ import annotations

import time
from collections.abc import Generator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from mapmore_cli.stages.campaigns.processes import Workers, stoppable
from mapmore_cli.storage.run_folder import RunFiles

if TYPE_CHECKING:
    from mapmore_cli.domain.scores import Limit, Published, Validation


@dataclass(frozen=True)
class Job:
    """One run to do; a `patient` one waits where another process writes it."""

    config: Path
    runs: Path
    overrides: tuple[str, ...] = ()
    force: bool = False
    rehash: bool = False
    campaign: Path | None = None
    patient: bool = False

    def elsewhere(self) -> Job:
        """The same run on another machine: paths from the root, and patience with what an earlier, lost start of it still writes."""
        campaign = None if self.campaign is None else self.campaign.absolute()
        return replace(self, config=self.config.absolute(), runs=self.runs.absolute(), campaign=campaign, patient=True)


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


def run_all(jobs: Sequence[Job], workers: Workers) -> Generator[tuple[int, Finished | BaseException], None, None]:
    """Do the jobs and yield the number of each with what came of it, as they end; a signal to end ends them all.

    The runs that they need come first, one after the other: two jobs may need the same one.
    """
    with stoppable(), workers:
        for _, failure in workers.each(prepare_all, [jobs]):
            if failure is not None:
                raise failure
        yield from workers.each(run_one, jobs)


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
    outcome = bring_up_to_date(
        loaded, job.runs, force=job.force, rehash=job.rehash, warn=warnings.append, campaign=job.campaign, patient=job.patient
    )
    validation = RunFiles(outcome.run_dir).validation()
    held_to = limits(loaded.spec.validation.require, validation.scores)
    published = loaded.spec.report.published
    printed = published.numbers if published else None
    seconds = time.perf_counter() - started
    return Finished(outcome.name, outcome.run_dir, outcome.stages, validation, printed, held_to, (*validation.warnings, *warnings), seconds)
