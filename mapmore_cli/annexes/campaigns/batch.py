"""Many runs at once, wherever the workers are; one that fails does not stop the rest."""

from __future__ import annotations

import math
import time
from collections.abc import Generator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from mapmore_cli.annexes.campaigns.processes import Workers, stoppable
from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.fitting.stage import Variation
from mapmore_cli.pipeline.runner import RunOutcome, bring_up_to_date, pipeline, prepare
from mapmore_cli.pipeline.staleness import fingerprint, plain
from mapmore_cli.pipeline.validate import limits
from mapmore_cli.spec.loader import load
from mapmore_cli.storage.run_folder import RunFiles
from mapmore_cli.storage.run_record import load_records

if TYPE_CHECKING:
    from mapmore_cli.domain.scores import Limit, Published, ScoreTable
    from mapmore_cli.spec.loader import LoadedSpec


@dataclass(frozen=True)
class Job:
    """One run to do.

    - `config`, `runs`, `overrides`, `force`, `rehash`: as on the command line; `campaign` is the
      file that the run belongs to.
    - `patient`: whether it waits where another process writes it.
    - `leader`: the name of the first of the runs that read the same recordings in the same way;
      empty where it is the only one.
    - `leads`: whether it is that run itself.
    - `needs_others`: whether it needs runs of other specs.
    - `check`: whether it ends where `check` finds errors.
    - `seconds`: how long it took when it was done last; infinite where that is not known.
    """

    config: Path
    runs: Path
    overrides: tuple[str, ...] = ()
    force: bool = False
    rehash: bool = False
    campaign: Path | None = None
    patient: bool = False
    leader: str = ""
    leads: bool = False
    needs_others: bool = False
    check: bool = True
    seconds: float = math.inf

    def elsewhere(self) -> Job:
        """Return the same run on another machine: paths from the root, and patience with what an
        earlier, lost start of it still writes.
        """
        campaign = None if self.campaign is None else self.campaign.absolute()
        return replace(
            self,
            config=self.config.absolute(),
            runs=self.runs.absolute(),
            campaign=campaign,
            patient=True,
        )


@dataclass(frozen=True)
class Finished:
    """A run that came to its end, after `seconds`, with the `limits` that its scores are held
    to.
    """

    name: str
    run_dir: Path
    stages: Mapping[str, str]
    table: ScoreTable
    published: Published | None
    limits: tuple[Limit, ...]
    warnings: tuple[str, ...]
    seconds: float = 0.0

    @classmethod
    def of(
        cls, loaded: LoadedSpec, outcome: RunOutcome, told: Sequence[str], started: float
    ) -> Finished:
        """Return what came of a spec whose run is up to date; `told` are the warnings meanwhile,
        `started` is by `time.perf_counter`.
        """
        table = RunFiles(outcome.run_dir).scores()
        held_to = limits(loaded.spec.validation.require, table.scores)
        published = loaded.spec.report.published.numbers if loaded.spec.report.published else None
        seconds = time.perf_counter() - started
        return cls(
            outcome.name,
            outcome.run_dir,
            outcome.stages,
            table,
            published,
            held_to,
            (*table.warnings, *told),
            seconds,
        )

    @property
    def missed(self) -> tuple[str, ...]:
        """The limits that it misses, each as a sentence."""
        return tuple(limit.sentence for limit in self.limits if not limit.kept)


@dataclass(frozen=True)
class Reading:
    """What came of the recordings of a leader: whether they were read, and what was to be told of
    them.
    """

    stages: Mapping[str, str]
    warnings: tuple[str, ...]


def planned(jobs: Sequence[Job], specs: Sequence[LoadedSpec | None]) -> list[Job]:
    """Return the jobs, with their spec known: how long they took before, and in groups that read
    the same recordings in the same way.
    """
    stages = pipeline()
    groups: dict[str, list[int]] = {}
    found = list(jobs)
    for number, loaded in enumerate(specs):
        if loaded is not None:
            needs = [
                loaded.spec.needs.static,
                loaded.spec.needs.damping,
                *(need for stage in stages for need in stage.needs(loaded.spec)),
            ]
            others = any(need is not None and not isinstance(need, Variation) for need in needs)
            seconds = math.inf
            with suppress(MapmoreError):  # records of a newer format, which the run itself will say
                if records := load_records(
                    jobs[number].runs / loaded.spec.name, lambda _message: None
                ):
                    seconds = sum(record.seconds for record in records.values())
            found[number] = replace(jobs[number], needs_others=others, seconds=seconds)
            mark = fingerprint(
                stages[0].name,
                stages[0].revision,
                plain(stages[0].reads(loaded.spec)),
                str(loaded.folder),
                {},
            )
            groups.setdefault(mark, []).append(number)
    for first, *rest in (group for group in groups.values() if len(group) > 1):
        leader = specs[first]
        assert leader is not None
        for number in (first, *rest):
            found[number] = replace(found[number], leader=leader.spec.name, leads=number == first)
    return found


def run_all(
    jobs: Sequence[Job], workers: Workers
) -> Generator[tuple[int, Finished | BaseException], None, None]:
    """Do the jobs and yield the number of each with what came of it, as they end; a signal to end
    ends them all.

    The runs that they need come first, one after the other: two jobs may need the same one. Then
    the recordings are read that several jobs need, once each, and what is to be told of them is
    told of every run that takes them over. Of the runs themselves, those that took longest come
    first, so that no long one is left for the end.
    """
    longest_first = sorted(range(len(jobs)), key=lambda number: jobs[number].seconds, reverse=True)
    with stoppable(), workers:
        needing = [job for job in jobs if job.needs_others]
        for _, failure in workers.each(prepare_all, [needing] if needing else []):
            if failure is not None:
                raise failure
        leaders = [job for job in jobs if job.leads and not job.force]  # which takes nothing over
        read = {
            leaders[number].leader: reading for number, reading in workers.each(read_first, leaders)
        }
        for place, result in workers.each(run_one, [jobs[number] for number in longest_first]):
            number = longest_first[place]
            reading = read.get(jobs[number].leader)
            if isinstance(result, Finished) and isinstance(
                reading, Reading
            ):  # a failed reading is told by the run itself
                stages = (
                    {**result.stages, **reading.stages} if jobs[number].leads else result.stages
                )
                told = reading.warnings if stages["ingest"] == "done" else ()
                result = replace(
                    result, stages=stages, warnings=tuple(dict.fromkeys([*told, *result.warnings]))
                )
            yield number, result


def prepare_all(jobs: Sequence[Job]) -> None:
    """Bring the runs up to date that the jobs need. What goes wrong is told by the job that needs
    it.
    """
    for job in jobs:
        with suppress(MapmoreError):  # a spec that is wrong
            prepare(load(job.config, job.overrides), job.runs, job.check)


def read_first(job: Job) -> Reading:
    """Read the recordings of a run that others read too, who take over what this one finds; raises
    what that raises.
    """
    warnings: list[str] = []
    outcome = _brought(load(job.config, job.overrides), job, "ingest", warnings)
    return Reading(outcome.stages, tuple(warnings))


def run_one(job: Job) -> Finished:
    """Bring one run up to date and read its scores; raises what that raises."""
    started, warnings = time.perf_counter(), list[str]()
    loaded = load(job.config, job.overrides)
    outcome = _brought(
        loaded,
        job,
        "report",
        warnings,
        like=job.runs / job.leader if job.leader and not job.leads else None,
    )
    return Finished.of(loaded, outcome, warnings, started)


def _brought(
    loaded: LoadedSpec, job: Job, until: str, warnings: list[str], like: Path | None = None
) -> RunOutcome:
    return bring_up_to_date(
        loaded,
        job.runs,
        until,
        force=job.force,
        rehash=job.rehash,
        warn=warnings.append,
        campaign=job.campaign,
        patient=job.patient,
        like=like,
        check=job.check,
    )
