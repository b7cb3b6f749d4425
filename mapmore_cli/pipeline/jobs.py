"""Represent a run as a job, which a process of this machine or of another machine can do, and
represent its result.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from mapmore_cli.domain.errors import MapmoreError, WriteError
from mapmore_cli.pipeline.runner import AS_USUAL, Options, RunOutcome, bring_up_to_date
from mapmore_cli.pipeline.stages import recordings
from mapmore_cli.pipeline.validate import required_limits
from mapmore_cli.storage.inputs import files_read
from mapmore_cli.storage.run_folder import RunFiles
from mapmore_cli.storage.run_record import load_records
from mapmore_cli.study.loader import load

if TYPE_CHECKING:
    from mapmore_cli.domain.scores import Alert, Limit, Published, ScoreTable
    from mapmore_cli.study.loader import LoadedSpec


@dataclass(frozen=True)
class Job:
    """A run that must be brought up to date.

    - `config`, `overrides`: file of the spec, and settings that replace settings in it.
    - `runs`: folder of all runs.
    - `options`: options for bringing the run up to date.
    - `until`: last stage that is needed.
    """

    config: Path
    runs: Path
    overrides: tuple[str, ...] = ()
    options: Options = AS_USUAL
    until: str = "report"

    def elsewhere(self) -> Job:
        """Return the job in a form that another machine can do, with absolute paths.

        Such a job waits if another process is writing the same run. If the connection to a machine
        is lost, the job may be started again on another machine, while the first machine is still
        working on it.
        """
        campaign = self.options.campaign
        options = replace(
            self.options, patient=True, campaign=None if campaign is None else campaign.absolute()
        )
        return replace(
            self, config=self.config.absolute(), runs=self.runs.absolute(), options=options
        )


@dataclass(frozen=True)
class Finished:
    """Result of a completed run. `seconds` is the duration of the run, and `limits` are the limits
    that the spec sets for the scores (`validate.require`).
    """

    name: str
    run_dir: Path
    stages: Mapping[str, str]
    table: ScoreTable
    published: Published | None
    limits: tuple[Limit, ...]
    warnings: tuple[str, ...]
    seconds: float
    alerts: tuple[Alert, ...]

    @classmethod
    def of(
        cls, loaded: LoadedSpec, outcome: RunOutcome, warnings: Sequence[str], started: float
    ) -> Finished:
        """Return the result of a spec whose run is up to date, with the `warnings` of this run.
        `started` is the value of `time.perf_counter` at the start of the run.
        """
        table = RunFiles(outcome.run_dir).scores()
        published = loaded.spec.report.published
        return cls(
            outcome.name,
            outcome.run_dir,
            outcome.stages,
            table,
            None if published is None else published.numbers,
            required_limits(loaded.spec.validation.require, table.scores),
            (*table.warnings, *warnings),
            time.perf_counter() - started,
            _alerts(outcome, loaded.spec.unconfirmed),
        )

    @property
    def missed(self) -> tuple[str, ...]:
        """Sentences about the limits in `validate.require` that the scores do not keep, one for
        each limit.
        """
        return tuple(limit.sentence for limit in self.limits if not limit.kept)


def _alerts(outcome: RunOutcome, unconfirmed: Sequence[str]) -> tuple[Alert, ...]:
    """Return the warnings about the scores of a completed run, which are also on its page. If no
    stage had to run and the spec has no open questions (`unconfirmed`), the warnings are taken from
    the page of all runs, because this is quicker than reading the results.
    """
    from mapmore_cli.pipeline.runs_rows import known_alerts

    if {*outcome.stages.values()} == {"up-to-date"} and not unconfirmed:
        known = known_alerts(outcome.run_dir)
        if known is not None:
            return known
    from mapmore_cli.checking.findings import sentences
    from mapmore_cli.reporting.alerts import alerts_of

    files = RunFiles(outcome.run_dir)
    results = files.dataset(), files.model(), files.validation()
    search = files.search() if "search" in outcome.stages else None
    return alerts_of(*results, unconfirmed, sentences(files.folder), search)


def run_one(job: Job) -> Finished:
    """Bring one run up to date, and return its result with the scores. Raises the errors of the
    run.
    """
    started, warnings = time.perf_counter(), list[str]()
    with files_read():
        loaded = load(job.config, job.overrides)
        outcome = bring_up_to_date(
            loaded, job.runs, job.until, options=job.options, warn=warnings.append
        )
    return Finished.of(loaded, outcome, warnings, started)


def note_sources(job: Job, done: Finished | None) -> None:
    """Record the spec and the recordings of a job as files that the command reads
    (`storage.inputs`). This is necessary because another process reads them. `done` is the result
    of the job if its run is already up to date; otherwise, it is None.

    Raises WriteError if one of these files is an output of the command.
    """
    if done is not None:
        load_records(done.run_dir)
        return
    try:
        loaded = load(job.config, job.overrides)
        recordings(loaded.spec, loaded.folder)
    except WriteError:
        raise
    except MapmoreError:  # the recordings of a spec with a mistake are unknown
        return
