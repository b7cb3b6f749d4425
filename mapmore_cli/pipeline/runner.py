"""Bring a run up to date: like make, with fingerprints instead of times.

A run folder is correct after every step: a stage builds its outputs beside the old ones, they are
moved in whole, and the stage's entry in `run.json`, written last, commits them. Whatever is not
committed runs again.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from mapmore_cli.checking import findings
from mapmore_cli.domain.errors import DataError, MapmoreError, RunWarning, SpecError, WriteError
from mapmore_cli.fitting.stage import Progress, Stage, Warn
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.pipeline.stage_maker import StageMaker
from mapmore_cli.pipeline.staleness import (
    MODEL_STAGE,
    Needed,
    Plan,
    as_found,
    needed_runs,
    plan_stages,
    runs_built_on,
)
from mapmore_cli.storage.atomic import write_text
from mapmore_cli.storage.run_folder import RunFiles, is_tidy, open_run_folder, recover, run_lock
from mapmore_cli.storage.run_record import (
    Origin,
    StageRecord,
    load_origin,
    load_records,
    save_records,
)

if TYPE_CHECKING:
    from mapmore_cli.spec.loader import LoadedSpec

RESOLVED_SPEC = "experiment.yaml"
FOUND = "found.yaml"
"""The spec with its defaults filled in; and where its structure was searched, an ordinary spec with
what was found.
"""

OnStage = Callable[[str, str | None], None]
"""`on_stage(stage, reason)`: called before a stage runs, or with None where it is up to date."""


@dataclass(frozen=True)
class RunOutcome:
    """What was done: `done` or `up-to-date` for every stage, and why for those that ran."""

    name: str
    run_dir: Path
    stages: Mapping[str, str]
    reasons: Mapping[str, str]


def pipeline() -> tuple[Stage, ...]:
    """Return the six stages in order; they are imported when they are first asked for."""
    from mapmore_cli.pipeline import report, stages, validate

    return (
        stages.INGEST,
        stages.SEGMENT,
        stages.FITTING,
        stages.FUSE,
        validate.STAGE,
        report.STAGE,
    )


def explain(
    loaded: LoadedSpec,
    runs: Path,
    until: str = "report",
    *,
    force: bool = False,
    rehash: bool = False,
    warn: Warn = lambda _message: None,
    stages: Sequence[Stage] | None = None,
) -> list[tuple[str, str | None]]:
    """Every stage up to `until` with the reason why it would run, None where it is up to date.
    Nothing is written.
    """
    every, run_dir = stages or pipeline(), runs / loaded.spec.name
    records = load_records(run_dir, warn)
    told: dict[str, str | None] = {}
    if searches(loaded, until):
        plans = plan_stages(search_stages(), SEARCH_STAGE, loaded, run_dir, records, rehash, force)
        told = {plan.stage.name: plan.reason for plan in plans}
        if any(told.values()):
            later = [stage.name for stage in every][1:]
            return [*told.items(), *((name, FOLLOWS) for name in later[: later.index(until) + 1])]
        loaded = as_found(loaded, run_dir)
    plans = plan_stages(every, until, loaded, run_dir, records, rehash, force)
    return list(
        (
            told | {plan.stage.name: plan.reason for plan in plans if plan.stage.name not in told}
        ).items()
    )


SEARCH_STAGE = "search"
"""The stage that finds the structure of a model; a spec that asks for none has no such stage."""
FOLLOWS = f"follows from {SEARCH_STAGE}"


def searches(loaded: LoadedSpec, until: str) -> bool:
    """Whether the structure has to be found before the stage `until`."""
    return loaded.spec.model.type == AUTO and until not in ("ingest", SEARCH_STAGE)


def search_stages() -> tuple[Stage, ...]:
    """Return what comes before the structure is known."""
    from mapmore_cli.annexes.search import stage as search
    from mapmore_cli.pipeline import stages

    return stages.INGEST, search.STAGE


def bring_up_to_date(
    loaded: LoadedSpec,
    runs: Path,
    until: str = "report",
    *,
    force: bool = False,
    rehash: bool = False,
    progress: Progress = lambda _what, _done, _total: None,
    warn: Warn = lambda _message: None,
    on_stage: OnStage = lambda _stage, _reason: None,
    stages: Sequence[Stage] | None = None,
    heirs: tuple[Path, ...] = (),
    campaign: Path | None = None,
    patient: bool = False,
    like: Path | None = None,
    check: bool = True,
) -> RunOutcome:
    """Run the stages up to `until` that are not up to date (all of them with `force`), in the
    folder `runs/NAME`.

    `rehash` reads sources and outputs again even where size and time are as they were. `stages` are
    those of `pipeline()` by default. Runs whose models a stage needs come first, in the same folder
    of runs; `heirs` are the specs that need this one. `campaign` is the file that the run belongs
    to. A `patient` one waits for another process that is writing the run. Results of the run in the
    folder `like` that have the fingerprints of this one's are taken over, unless by `force` all are
    made anew.

    After ingest, the rules of `checking` are applied, unless they were to the same: `warn` is told
    what they find, and what is an error for them ends the run, but not without `check`.

    Raises WriteError where the folder cannot be written or holds the run of another spec, the disk
    is full, or another process is writing the run; MapmoreError for whatever a stage found wrong;
    its outputs, and those of the stages after it, are then as they were.
    """
    run_dir = runs / loaded.spec.name
    open_run_folder(run_dir)

    def run_of(spec: LoadedSpec, every: Sequence[Stage], tell: OnStage, **searched: bool) -> _Run:
        origin = _origin(spec, run_dir, campaign)
        kept_from = None if force else like
        return _Run(
            spec,
            run_dir,
            origin,
            progress,
            warn,
            kept_from,
            every=every,
            on_stage=tell,
            check=check,
            **searched,
        )

    def settled(run: _Run, last: str) -> list[Plan]:
        others = runs_built_on(run.loaded, heirs) if last == run.every[-1].name else ()
        plans = run.settled(last, rehash, heirs, others) if not force else None
        if plans is None:
            with run_lock(run_dir, patient):
                plans = run.settle(last, force, rehash, heirs, others)
        return plans

    every = stages or pipeline()
    if searches(loaded, until):
        first = settled(run_of(loaded, search_stages(), on_stage), SEARCH_STAGE)
        renewed = any(plan.reason is not None for plan in first if plan.stage.name == SEARCH_STAGE)
        later = run_of(
            as_found(loaded, run_dir),
            every,
            _after_search(on_stage),
            searched=True,
            renewed=renewed,
        )
        plans = [*first, *(plan for plan in settled(later, until) if plan.stage.name != "ingest")]
    else:
        plans = settled(run_of(loaded, every, on_stage), until)
    reasons = {plan.stage.name: plan.reason for plan in plans if plan.reason is not None}
    done = {
        plan.stage.name: "done" if plan.stage.name in reasons else "up-to-date" for plan in plans
    }
    return RunOutcome(loaded.spec.name, run_dir, done, reasons)


def _after_search(on_stage: OnStage) -> OnStage:
    """Tell of the stages but ingest, which was told of before the search."""
    return lambda stage, reason: None if stage == "ingest" else on_stage(stage, reason)


def _origin(loaded: LoadedSpec, run_dir: Path, campaign: Path | None) -> Origin:
    """Where the run comes from now; WriteError where its folder holds a run of the same name from
    elsewhere, which still exists.
    """
    here = Origin(
        _from(run_dir, loaded.path),
        _from(run_dir, campaign) if campaign else "",
        tuple(loaded.overrides) if campaign else (),
    )
    before = load_origin(run_dir)
    if (
        before is not None
        and loaded.path.name in (RESOLVED_SPEC, FOUND)
        and loaded.path.resolve().parent.parent == run_dir.resolve().parent
    ):
        return before  # the resolved spec of a run of this folder is that run's own
    rival = here.rival_of(before, run_dir) if before is not None else None
    if rival is not None:
        raise WriteError(
            f"{run_dir}: holds the run '{loaded.spec.name}' of {rival}; this is a run of "
            f"{here.campaign or here.spec} (seen from there)",
            "give one of them another `name`, or choose another folder with --runs",
        )
    return here


def _from(run_dir: Path, path: Path) -> str:
    """Return the path from the run's folder; the name alone where the way leads over the root:
    files of a run name nobody's folders.
    """
    path, run_dir = path.resolve(), run_dir.resolve()
    if os.path.commonpath([path, run_dir]) == path.anchor:
        return path.name
    return Path(os.path.relpath(path, run_dir)).as_posix()


def prepare(loaded: LoadedSpec, runs: Path, check: bool = True) -> None:
    """Bring the runs of other specs up to date that a whole run needs, so that runs which share one
    can go on side by side.

    What goes wrong is told by the run that needs it.
    """
    every = pipeline()
    run_dir = runs / loaded.spec.name
    quiet = (lambda *_: None, lambda _: None)
    run = _Run(
        loaded,
        run_dir,
        _origin(loaded, run_dir, None),
        *quiet,
        every=every,
        on_stage=lambda *_: None,
        check=check,
    )
    for other in [
        *runs_built_on(loaded, ()),
        *(other for stage in every for other in needed_runs(stage, loaded, ())),
    ]:
        if other.role != "variation":  # which no other run shares
            with suppress(Exception):
                run.bring(other)


@dataclass(frozen=True, kw_only=True)
class _Run(StageMaker):
    """What makes the stages `every` of a run, where they are stale; `renewed` says whether its
    structure was searched just now.
    """

    every: Sequence[Stage]
    on_stage: OnStage
    check: bool
    renewed: bool = False

    def settled(
        self, until: str, rehash: bool, heirs: tuple[Path, ...], others: Sequence[Needed]
    ) -> list[Plan] | None:
        """Return the plans where nothing is to be done, seen without the lock of the run; None
        where something may be.

        Results are moved in whole and committed last, so what looks whole is. Where another process
        is at work, the lock decides.
        """
        records = load_records(self.run_dir, lambda _message: None)
        plans = self.planned(until, records, rehash, False, heirs)
        whole = (
            all(plan.reason is None for plan in plans)
            and _refreshed(records, plans) == records
            and all(self.found(plan) is not None for plan in self.to_check(plans))
            and load_origin(self.run_dir) == self.origin
            and self._has_spec()
            and is_tidy(self.run_dir)
            and all(
                self._is_current(other, until)
                and _is_whole(self.run_dir.parent / other.loaded.spec.name)
                for other in others
            )
        )
        if not whole:
            return None
        self.tell_outdated(plans)
        for plan in plans:
            self.on_stage(plan.stage.name, None)
        for plan in self.to_check(plans):
            self.tell(self.found(plan) or ())
        return plans

    def settle(
        self,
        until: str,
        force: bool,
        rehash: bool,
        heirs: tuple[Path, ...],
        others: Sequence[Needed],
    ) -> list[Plan]:
        """Do all that is to be done, the runs that this one is built on first; what was planned.
        The lock of the run is held.
        """
        recover(self.run_dir, _outputs(self.every))
        records = load_records(self.run_dir, self.warn)
        plans = self.planned(until, records, rehash, force, heirs)
        kept = _refreshed(records, plans)
        if (
            kept != records or load_origin(self.run_dir) != self.origin
        ):  # a new run as well: from now on the folder is known as a run's
            save_records(self.run_dir, self.loaded.spec.name, self.origin, kept)
        for other in others:
            self.bring(other)
        self.tell_outdated(plans)
        for plan in plans:
            self.on_stage(plan.stage.name, plan.reason)
            if plan.reason is not None:
                with self.faults_explained(plan):
                    kept = self.make(
                        plan,
                        plan.reason,
                        {other.key: self.bring(other) for other in plan.needed},
                        kept,
                    )
            if plan in self.to_check(plans):
                self.apply_rules(plan)
        self.write_spec()
        return plans

    def to_check(self, plans: Sequence[Plan]) -> list[Plan]:
        """Return the stage after which the rules are applied: ingest, but not where it is the last,
        or its data were searched already.
        """
        return [] if self.searched else [plan for plan in plans[:-1] if plan.stage is pipeline()[0]]

    def found(self, ingest: Plan) -> tuple[findings.Issue, ...] | None:
        """Return what the rules found in these data; None where that is not known, or ends the run:
        places in the spec may have moved.
        """
        issues = findings.kept(self.run_dir, findings.mark_of(self.loaded, ingest.fingerprint))
        return None if issues is None or (self.check and findings.refusal(issues)) else issues

    def apply_rules(self, ingest: Plan) -> None:
        """Apply the rules to the ingested data, unless they were, and tell what they find; raises
        what is an error for them.
        """
        issues = self.found(ingest)
        if issues is None:
            from mapmore_cli.checking.applied import issues_of

            issues = tuple(issues_of(self.loaded, RunFiles(self.run_dir).dataset()))
            self.tell(issues)
            findings.keep(self.run_dir, findings.mark_of(self.loaded, ingest.fingerprint), issues)
        else:
            self.tell(issues)

    def tell(self, issues: Sequence[findings.Issue]) -> None:
        """Warn of the findings; raise those that are errors, unless they do not count."""
        error = findings.refusal(issues) if self.check else None
        for issue in issues:
            if issue.severity != "error" or error is None:
                self.warn(issue.sentence)
        if error is not None:
            raise error

    @contextmanager
    def faults_explained(self, plan: Plan) -> Iterator[None]:
        """Say of data that cannot be sorted into curves what the rules find in the recordings: it
        may be why.
        """
        try:
            yield
        except (SpecError, DataError) as fault:
            if self.check and plan.stage is pipeline()[0]:
                from mapmore_cli.checking.applied import issues_without_curves

                why = [
                    f"{issue.place}: {issue.sentence}"
                    for issue in issues_without_curves(self.loaded)
                ]
                fault.message = "\n".join([fault.message, *why])
            raise

    def planned(
        self,
        until: str,
        records: Mapping[str, StageRecord],
        rehash: bool,
        force: bool,
        heirs: tuple[Path, ...],
    ) -> list[Plan]:
        """Return the plans; the page shows what was tried, so that it is made anew where that
        was.
        """
        plans = plan_stages(
            self.every, until, self.loaded, self.run_dir, records, rehash, force, heirs
        )
        last = self.every[-1].name
        return [
            replace(plan, reason=FOLLOWS)
            if self.renewed and plan.stage.name == last and plan.reason is None
            else plan
            for plan in plans
        ]

    def bring(self, other: Needed) -> Path:
        """Bring another run up to date in the same folder of runs; its folder. Nothing is locked
        where it is: others may be reading it.

        A run that this one is built on is brought up to date as a whole, so that its page tells of
        the model beside it. The model of a compared run stays as it is: a comparison must not
        change what it compares with.
        """
        name, runs = other.loaded.spec.name, self.run_dir.parent
        until = self.every[-1].name if other.role == "built_on" else MODEL_STAGE
        if self._is_current(other, until) or self._kept(other):
            self._mend(other, runs / name)
            return runs / name
        known = findings.sentences(self.run_dir)  # a variation has most of them as well
        try:
            return bring_up_to_date(
                other.loaded,
                runs,
                until,
                progress=self.progress,
                warn=lambda message: (
                    None if message in known else self.warn(RunWarning.of(name, message))
                ),
                on_stage=lambda stage, reason: self.on_stage(f"{name}: {stage}", reason),
                stages=self.every,
                heirs=other.heirs,
                like=self.run_dir if other.role == "variation" else None,
                check=self.check,
            ).run_dir
        except MapmoreError as error:
            error.message = f"{name}: {error.message}"
            raise

    def _mend(self, other: Needed, run_dir: Path) -> None:
        """Do what a process left undone that was killed after the last stage of another run. Where
        a process holds the run, it will.
        """
        if not _is_whole(run_dir):
            with suppress(WriteError), run_lock(run_dir):
                recover(run_dir, _outputs(self.every))
                replace(self, loaded=other.loaded, run_dir=run_dir).write_spec()

    def tell_outdated(self, plans: Sequence[Plan]) -> None:
        """Warn of compared runs whose models are kept though they would come out otherwise now."""
        for other in (other for plan in plans for other in plan.needed if self._kept(other)):
            if not self._is_current(other, MODEL_STAGE):
                changed = (
                    "its data or settings have changed since its model was made, which is "
                    "compared as it is"
                )
                self.warn(
                    f"{other.loaded.spec.name}: {changed}; `mapmore run {other.key}` brings "
                    "it up to date"
                )

    def _kept(self, other: Needed) -> bool:
        """Return True for a compared run that has a model."""
        return other.role == "compared" and MODEL_STAGE in load_records(
            self.run_dir.parent / other.loaded.spec.name, lambda _message: None
        )

    def _is_current(self, other: Needed, until: str) -> bool:
        run_dir = self.run_dir.parent / other.loaded.spec.name
        records = load_records(run_dir, lambda _message: None)
        plans = plan_stages(
            self.every,
            until,
            as_found(other.loaded, run_dir),
            run_dir,
            records,
            False,
            False,
            other.heirs,
        )
        return all(plan.reason is None for plan in plans)

    def write_spec(self) -> None:
        """Write `experiment.yaml`, which runs again where it lies, unless it is there already."""
        if not self._has_spec():
            for name, text in self._texts.items():
                write_text(self.run_dir / name, text)

    def _has_spec(self) -> bool:
        paths = {self.run_dir / name: text for name, text in self._texts.items()}
        return all(
            path.is_file() and path.read_bytes() == text.encode() for path, text in paths.items()
        )

    @cached_property
    def _texts(self) -> dict[str, str]:
        """The specs that belong to the run; none where its structure is not known yet."""
        if self.every[-1].name == SEARCH_STAGE:
            return {}
        found = (
            {FOUND: self.loaded.resolved_in(self.run_dir, given_only=True)} if self.searched else {}
        )
        return {RESOLVED_SPEC: self.loaded.resolved_in(self.run_dir), **found}


def _refreshed(records: Mapping[str, StageRecord], plans: Sequence[Plan]) -> dict[str, StageRecord]:
    """Return the records with today's file times, where the contents are still the same: the next
    run need not read them again.
    """
    current = {
        plan.stage.name: replace(records[plan.stage.name], inputs=plan.inputs, outputs=plan.outputs)
        for plan in plans
        if plan.reason is None
    }
    return {**records, **current}


def _is_whole(run_dir: Path) -> bool:
    """Whether the run in a folder has its spec, and nobody was killed or is at work there."""
    return is_tidy(run_dir) and (run_dir / RESOLVED_SPEC).is_file()


def _outputs(stages: Sequence[Stage]) -> list[str]:
    return [output for stage in stages for output in stage.outputs]
