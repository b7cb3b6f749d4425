"""Bring a run up to date: run the stages whose inputs have changed, as `make` does. Changes are
recognised by hashes instead of file times.

A run folder is valid after every step. A stage writes its new outputs beside the old outputs, and
they are then moved into place. The entry of the stage in `run.json` is written last and commits the
outputs. Anything that is not committed is done again.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypedDict

from mapmore_cli.checking import findings
from mapmore_cli.domain.errors import (
    DataError,
    MapmoreError,
    RunWarning,
    SpecError,
    Warn,
    WriteError,
)
from mapmore_cli.fitting.stage import Progress, Stage, Workspace
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.pipeline.processors import one_blas_thread
from mapmore_cli.pipeline.staleness import (
    FOUND,
    RESOLVED_SPEC,
    Needed,
    StagePlan,
    as_found,
    origin_of,
    pipeline,
    plan_stages,
    plans_of,
    refuse_circle,
)
from mapmore_cli.storage.atomic import holds, refusals_told, write_own
from mapmore_cli.storage.inputs import is_read
from mapmore_cli.storage.ownership import TRASH, is_as_written, to_trash
from mapmore_cli.storage.run_folder import (
    SEARCH,
    RunFiles,
    is_tidy,
    make_way,
    open_run_folder,
    recover,
    run_lock,
    stage_folder,
    swap_in,
)
from mapmore_cli.storage.run_record import (
    SEARCH_STAGE,
    Origin,
    StageRecord,
    Stamp,
    load_origin,
    load_records,
    save_records,
    tool_versions,
    written_files,
)
from mapmore_cli.storage.stamps import stamps_of, take_stamp
from mapmore_cli.study.loader import LoadedSpec

OnStage = Callable[[str, str | None], None]
"""Function `on_stage(stage, reason)` that is called before a stage runs, or with None if the stage
is up to date.
"""


@dataclass(frozen=True)
class RunOutcome:
    """Result of bringing a run up to date. `stages` holds, for every stage, `done` if it ran, and
    `up-to-date` if it did not have to. `reasons` holds, for every stage that ran, the reason why.
    """

    name: str
    run_dir: Path
    stages: Mapping[str, str]
    reasons: Mapping[str, str]


@dataclass(frozen=True)
class Options:
    """Options for bringing a run up to date.

    - `force`: True to repeat stages that are up to date.
    - `rehash`: True to compute the hashes of sources and outputs again, even if their size and time
      are unchanged.
    - `check`: True to stop the run if the rules of `checking` find an error.
    - `campaign`: file of the campaign to which the run belongs; None if it belongs to none.
    - `patient`: True to wait if another process is writing the run; False to raise an error.
    """

    force: bool = False
    rehash: bool = False
    check: bool = True
    campaign: Path | None = None
    patient: bool = False


AS_USUAL = Options()


def explain(
    loaded: LoadedSpec,
    runs: Path,
    until: str = "report",
    *,
    options: Options = AS_USUAL,
    warn: Warn = lambda _message: None,
    stages: Sequence[Stage] | None = None,
) -> list[tuple[str, str | None]]:
    """Return every stage up to `until` with the reason why it would run, or None if it is up to
    date. Nothing is written. Raises WriteError if the folder holds the run of another spec.
    """
    refuse_circle(loaded)
    run_dir = runs / loaded.spec.name
    _origin(loaded, run_dir, options.campaign)
    how = (run_dir, load_records(run_dir, warn), options.rehash, options.force)
    reasons = {plan.stage.name: plan.reason for plan in plan_stages(stages, until, loaded, *how)}
    # the stages after the search cannot be planned before the search has found a structure
    if until not in reasons:
        every = [stage.name for stage in pipeline()]
        reasons |= dict.fromkeys(every[1 : every.index(until) + 1], f"follows from {SEARCH_STAGE}")
    return list(reasons.items())


class Listeners(TypedDict):
    """Functions that `bring_up_to_date` calls to report on its work."""

    progress: Progress
    warn: Warn
    on_stage: OnStage


def bring_up_to_date(
    loaded: LoadedSpec,
    runs: Path,
    until: str = "report",
    *,
    options: Options = AS_USUAL,
    progress: Progress = lambda _what, _done, _total: None,
    warn: Warn = lambda _message: None,
    on_stage: OnStage = lambda _stage, _reason: None,
    stages: Sequence[Stage] | None = None,
) -> RunOutcome:
    """Run the stages up to `until` that are not up to date, in the folder `runs/NAME`.

    `stages` are those of `pipeline()` by default. If a stage needs other runs, they are brought up
    to date first, in the same folder of runs. After ingest, the rules of `checking` are applied,
    unless they have been applied to the same data; `warn` is called with their findings.

    Raises WriteError if the folder cannot be written or holds the run of another spec, if the disk
    is full, or if another process is writing the run. Raises MapmoreError if a stage fails; the
    outputs of this stage and of later stages are then unchanged.
    """
    refuse_circle(loaded)
    run_dir = runs / loaded.spec.name
    open_run_folder(run_dir)
    origin = _origin(loaded, run_dir, options.campaign)
    run = _Run(loaded, run_dir, stages, origin, options, progress, warn, on_stage)
    plans = run.settled(until)
    if plans is None:
        with run_lock(run_dir, options.patient):
            plans = run.settle(until)
    reasons = {plan.stage.name: plan.reason for plan in plans if plan.reason is not None}
    names = (plan.stage.name for plan in plans)
    done = {name: "done" if name in reasons else "up-to-date" for name in names}
    return RunOutcome(loaded.spec.name, run_dir, done, reasons)


def _origin(loaded: LoadedSpec, run_dir: Path, campaign: Path | None) -> Origin:
    """Return the origin of the run. Raises WriteError if the folder contains a run of the same name
    that was made from another spec, and if this other spec still exists.
    """
    here, before = origin_of(loaded, run_dir, campaign), load_origin(run_dir)
    rival = here.rival_of(before, run_dir) if before is not None else None
    if rival is not None:
        raise WriteError(
            f"{run_dir}: contains the run '{loaded.spec.name}' of {rival}, but this run of the "
            f"same name is of {here.campaign or here.spec} (paths are relative to that folder)",
            "give one of them another `name`, or use another folder with --runs",
        )
    return here


@dataclass(frozen=True)
class _Run:
    """A run in its folder, and the functions that report on its work. `stages` is None for the
    stages of the pipeline; other stages replace them. `written` holds stamps of further files that
    were written, but are not in the record of the run yet.
    """

    loaded: LoadedSpec
    run_dir: Path
    stages: Sequence[Stage] | None
    origin: Origin
    options: Options
    progress: Progress
    warn: Warn
    on_stage: OnStage
    written: dict[str, Stamp] = field(default_factory=dict)

    def settled(self, until: str) -> list[StagePlan] | None:
        """Return the plans of the stages if all stages are up to date; None if there may be work to
        do.

        The lock of the run is not taken, so that several processes can do this at the same time. It
        is safe, because results are moved into place as a whole, and their entry in the record is
        written last. If another process seems to be writing the run, the result is None, and the
        caller waits for the lock.
        """
        records, runs = load_records(self.run_dir), self.run_dir.parent
        # if the last stage has no record yet, it must run, so the sources need not be checked
        if until not in records:
            return None
        plans = list(self.planned(until, records))
        whole = (
            plans[-1].stage.name == until
            and all(plan.reason is None and plan.now == records[plan.stage.name] for plan in plans)
            and not any(self.checks(p, until) and self.known_findings(p) is None for p in plans)
            and load_origin(self.run_dir) == self.origin
            and not self.unwritten(until)
            and is_tidy(self.run_dir)
            and all(
                other.is_kept(runs) or self.is_current(other)
                for plan in plans
                for other in plan.needed
            )
        )
        if not whole:
            return None
        for plan in plans:
            self.on_stage(plan.stage.name, None)
            for other in plan.needed:
                self.bring(other)
            if self.checks(plan, until):
                self.tell(self.known_findings(plan) or ())
        return plans

    def settle(self, until: str) -> list[StagePlan]:
        """Run all stages that are out of date, and return the plans. The caller holds the lock of
        the run.
        """
        stages = self.stages or pipeline()
        recover(self.run_dir, [output for stage in stages for output in stage.outputs])
        records = load_records(self.run_dir, self.warn)
        if self.loaded.spec.model.type != AUTO and SEARCH_STAGE in records:
            self.set_search_aside(records)
            del records[SEARCH_STAGE]
        if load_origin(self.run_dir) != self.origin:
            # the record is written before the first stage runs, so that the folder is recognised
            # as a run folder
            self.save(records)
        plans, kept = list[StagePlan](), dict(records)
        for plan in self.planned(until, records):
            plans.append(plan)
            needed = {other.need.key: self.bring(other) for other in plan.needed}
            self.on_stage(plan.stage.name, plan.reason)
            name, now = plan.stage.name, plan.now
            if plan.reason is not None:
                try:
                    now = self.make(plan, needed)
                except (SpecError, DataError) as fault:
                    self.add_findings(fault, plan.stage)
                    raise
            if now != kept.get(name):
                kept[name] = now
                self.save(kept)
            if self.checks(plan, until):
                self.apply_rules(plan)
        for name, text in self.unwritten(until).items():
            self.write(name, text)
        if self.written:
            self.save(kept)
        return plans

    def set_search_aside(self, records: Mapping[str, StageRecord]) -> None:
        """Move the files of an earlier search to the trash, because the model now has another
        structure. Files of a search without a model stay (`mapmore tune` writes them). Files
        that were changed stay too, and so does the spec that was found if this command reads it.
        """
        segmented = records.get("segment")
        is_used = segmented is not None and segmented.before == records[SEARCH_STAGE].fingerprint
        names = [name for name in (SEARCH, FOUND) if self.is_own(name)]
        if (self.run_dir / FOUND).is_file() and not is_used:
            return
        if not names or any(is_read(self.run_dir / name) for name in names):
            return
        place = to_trash(self.run_dir, names)
        self.warn(
            f"{self.run_dir}: the spec requests no search any more; the results of the earlier "
            f"search ({', '.join(names)}) were moved to {place}"
        )

    def save(self, records: Mapping[str, StageRecord]) -> None:
        """Write the record, including the further files in `written`."""
        name = self.loaded.spec.name
        save_records(self.run_dir, name, self.origin, records, self.written)
        self.written.clear()

    def write(self, name: str, text: str) -> None:
        """Write a file of the run in addition to the outputs of its stages. If the file already
        contains this text, nothing is written.
        """
        path = self.run_dir / name
        if not holds(path, text.encode()):
            self.tell_taken(make_way(self.run_dir, name, written_files(self.run_dir)))
            write_own(path, text)
        self.written[name] = take_stamp(path)

    def tell_taken(self, paths: Sequence[str]) -> None:
        """Warn about files that were moved to the trash, because somebody changed them after the
        run wrote them, or because the run did not write them.
        """
        if paths:
            self.warn(
                f"{self.run_dir}: {', '.join(paths)} was changed after the run, or was not "
                "written by it. The new results replace it; the old files are in "
                f"{self.run_dir.parent / TRASH}"
            )

    def planned(self, until: str, records: Mapping[str, StageRecord]) -> Iterator[StagePlan]:
        """Yield the plans of the stages, one after the other. A plan is made only when it is
        requested, so that it depends on the results of the stages that have run by then.
        """
        how = (self.run_dir, records, self.options.rehash, self.options.force)
        return plan_stages(self.stages, until, self.loaded, *how)

    def make(self, plan: StagePlan, needed: Mapping[str, Path]) -> StageRecord:
        """Run one stage, move its outputs into the run folder, and return its entry for the record
        of the run. `needed` holds the folders of the other runs whose models the stage needs.
        """
        started, stage = time.perf_counter(), plan.stage
        with refusals_told(self.run_dir), stage_folder(self.run_dir, stage.name) as out:
            workspace = Workspace(
                self.run_dir,
                out,
                self.loaded.folder,
                self.progress,
                self.warn,
                needed,
                plan.loaded.resolved,
                self.loaded.spec.model.type == AUTO,
                self.loaded.tables,
            )
            with one_blas_thread():
                stage.run(plan.part, workspace)
            outputs = stamps_of(out, stage.outputs)
            known = written_files(self.run_dir)
            self.tell_taken(swap_in(out, self.run_dir, stage.outputs, known))
        seconds, why = round(time.perf_counter() - started, 3), plan.reason or ""
        return replace(plan.now, outputs=outputs, tools=tool_versions(), seconds=seconds, why=why)

    def checks(self, plan: StagePlan, until: str) -> bool:
        """Return True if the rules are applied after this stage. This is the stage ingest, unless
        it is the last stage that was requested.
        """
        return plan.stage is pipeline()[0] and plan.stage.name != until

    def known_findings(self, ingest: StagePlan) -> tuple[findings.Issue, ...] | None:
        """Return the findings that the rules had for the same data in an earlier run; None if none
        are stored. Return None also if a finding is an error that stops the run, because the line
        numbers in its message may have changed since.
        """
        issues = findings.kept(self.run_dir, findings.mark_of(self.loaded, ingest.now.fingerprint))
        ends = self.options.check and issues is not None and findings.refusal(issues)
        return None if ends or not self.is_own(findings.FINDINGS) else issues

    def apply_rules(self, ingest: StagePlan) -> None:
        """Apply the rules to the data that the stage ingest has read, and report the findings. If
        the rules were already applied to the same data, the stored findings are reported. Raises an
        error for a finding that is an error, unless the option `check` is False.
        """
        issues = self.known_findings(ingest)
        if issues is not None:
            self.tell(issues)
            return
        from mapmore_cli.checking.applied import issues_of

        issues = tuple(issues_of(self.loaded, RunFiles(self.run_dir).dataset()))
        self.tell(issues)
        mark = findings.mark_of(self.loaded, ingest.now.fingerprint)
        self.write(findings.FINDINGS, findings.as_text(mark, issues))

    def tell(self, issues: Sequence[findings.Issue]) -> None:
        """Report the findings as warnings. Raises an error for findings that are errors, unless the
        option `check` is False.
        """
        error = findings.refusal(issues) if self.options.check else None
        for issue in issues:
            if issue.severity != "error" or error is None:
                self.warn(issue.sentence)
        if error is not None:
            raise error

    def add_findings(self, fault: MapmoreError, stage: Stage) -> None:
        """Extend the message of an error of the stage ingest by the findings of the rules in the
        recordings. These findings may be the reason why no curves can be made.
        """
        if self.options.check and stage is pipeline()[0]:
            from mapmore_cli.checking.applied import issues_without_curves

            why = [
                f"{issue.place}: {issue.sentence}" for issue in issues_without_curves(self.loaded)
            ]
            fault.message = "\n".join([fault.message, *why])

    def bring(self, other: Needed) -> Path:
        """Bring another run up to date in the same folder of runs, and return its folder. If
        another process is writing this run, wait until it has finished.
        """
        name, runs = other.loaded.spec.name, self.run_dir.parent
        current = self.is_current(other)
        if other.is_kept(runs):
            if not current:
                self.warn(
                    f"{name}: its data or settings have changed since its model was made; "
                    f"the comparison uses the old model; `mapmore run {other.need.key}` "
                    "brings that run up to date"
                )
        elif not current:
            # a variation of this study often has the same findings; they are not reported again
            known = findings.sentences(self.run_dir)
            try:
                bring_up_to_date(
                    other.loaded,
                    runs,
                    other.last,
                    options=Options(check=self.options.check, patient=True),
                    progress=self.progress,
                    warn=lambda message: (
                        None if message in known else self.warn(RunWarning.of(name, message))
                    ),
                    on_stage=lambda stage, reason: self.on_stage(f"{name}: {stage}", reason),
                    stages=self.stages,
                )
            except MapmoreError as error:
                error.message = f"{name}: {error.message}"
                raise
        return runs / name

    def is_current(self, other: Needed) -> bool:
        """Return True if another run is up to date. Unless its model is used as it is, its folder
        must also contain its present spec. The result is False if a process is working in this
        folder, or was killed there.
        """
        runs = self.run_dir.parent
        there = replace(self, loaded=other.loaded, run_dir=runs / other.loaded.spec.name)
        before, now = load_origin(there.run_dir), origin_of(other.loaded, there.run_dir)
        if other.need.overrides and before is not None and before.spec != now.spec:
            return False  # the spec of the study, and of its variation, was renamed
        return (
            all(
                plan.reason is None
                for plan in plans_of(other, self.stages, other.last, runs, rehash=False)
            )
            and is_tidy(there.run_dir)
            and (other.is_kept(runs) or not there.unwritten(other.last))
        )

    def unwritten(self, until: str) -> dict[str, str]:
        """Return the texts of spec files in the run folder that are missing or not up to date, by
        file name. There are two such files: the spec with which the run can be repeated in its
        folder, and, after a search, the spec with the structure that was found. A file that is not
        in the record of the run, because the run was interrupted before, is returned too.
        """
        spec, texts = as_found(self.loaded, self.run_dir), dict[str, str]()
        if until != SEARCH_STAGE:
            texts[RESOLVED_SPEC] = spec.resolved_in(self.run_dir)
        if spec is not self.loaded:
            texts[FOUND] = spec.resolved_in(self.run_dir, given_only=True)
        return {
            name: text
            for name, text in texts.items()
            if not self.is_own(name) or not holds(self.run_dir / name, text.encode())
        }

    def is_own(self, name: str) -> bool:
        """Return True if the record of the run lists a file, and the file has not changed since."""
        return is_as_written(self.run_dir / name, written_files(self.run_dir).get(name))
