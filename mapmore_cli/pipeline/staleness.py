"""Decide which stages of a run are up to date, and why other stages must run. Also find the runs
that a stage needs.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from mapmore_cli.domain import plugins
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.fitting.stage import Need, Stage
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.pipeline.differences import fingerprint, recorded, slice_differences
from mapmore_cli.storage.run_record import (
    SEARCH_STAGE,
    Origin,
    StageRecord,
    Stamp,
    load_origin,
    load_records,
)
from mapmore_cli.storage.stamps import take_stamp
from mapmore_cli.study.loader import LoadedSpec, changed, load
from mapmore_cli.study.sections.results import Competitor
from mapmore_cli.study.yaml_dumper import as_overrides

MODEL_STAGE, PAGE_STAGE = "fuse", "report"
"""Stage that writes the model, which other runs may need, and stage that writes the page, which
shows the command that repeats the run.
"""

RESOLVED_SPEC = "experiment.yaml"
FOUND = "found.yaml"
"""File with the spec and its defaults, and file with the spec that a search found. The second one
is an ordinary spec with the structure that was found.
"""


def pipeline(searched: bool = False) -> tuple[Stage, ...]:
    """Return the six stages in order. If the structure of the model is `searched`, the stage
    `search` is added after the stage `ingest`. The modules of the stages are imported only when
    this function is called.
    """
    from mapmore_cli.pipeline import report, stages, validate

    known = (stages.SEGMENT, stages.FITTING, stages.FUSE, validate.STAGE, report.STAGE)
    if not searched:
        return (stages.INGEST, *known)
    return (stages.INGEST, plugins.load("stages", SEARCH_STAGE).STAGE, *known)


@dataclass(frozen=True)
class Needed:
    """Another run that a run needs. It has its own spec, and is in the same folder of runs.

    If this run builds on the other run, for example on its static model, all stages of the other
    run are brought up to date, including its page. If the other run only serves as a competitor, or
    is a variation of this run, only the stages that make its model are brought up to date.
    """

    need: Need
    loaded: LoadedSpec

    @property
    def last(self) -> str:
        """Name of the last stage that the other run must complete."""
        return MODEL_STAGE if self.need.compared or self.need.overrides else "report"

    def is_kept(self, runs: Path) -> bool:
        """Return True if the other run is not brought up to date, but its existing model is used.
        This is so if the other run only serves as a competitor and already has a model, because a
        comparison must not change another run.
        """
        return self.need.compared and MODEL_STAGE in load_records(runs / self.loaded.spec.name)


def needed_runs(stage: Stage, loaded: LoadedSpec) -> tuple[Needed, ...]:
    """Return the runs that a stage needs, in the order of the spec.

    Raises SpecError if a needed spec is missing or wrong.
    """
    return tuple(
        Needed(need, _varied(loaded, need) if need.overrides else load(loaded.folder / need.key))
        for need in stage.needs(loaded.spec)
    )


def named_runs(specs: Sequence[LoadedSpec]) -> set[str]:
    """Return the names of the runs of the given specs, and of all runs on which they build or with
    which they are compared.

    Raises SpecError if a needed spec is missing or wrong.
    """
    names, waiting = set[str](), [*specs]
    while waiting:
        loaded = waiting.pop()
        if loaded.spec.name not in names:
            names.add(loaded.spec.name)
            for stage in pipeline():
                waiting += [needed.loaded for needed in needed_runs(stage, loaded)]
    return names


def refuse_circle(loaded: LoadedSpec, heirs: tuple[Path, ...] = ()) -> None:
    """Raise SpecError if the models of runs need each other in a circle. `heirs` are the specs that
    led to this spec: each of them needs the next, and the last needs this spec.

    The circle may also begin at a competitor of the first spec, because the competitor needs the
    runs on which its model builds.
    """
    spec, chain = loaded.spec, (*heirs, loaded.path.resolve())
    paths = [spec.needs.static, spec.needs.damping, *(part.model for part in spec.model.sum or ())]
    if not heirs:
        rivals = spec.validation.against
        paths += [rival.run for rival in rivals if isinstance(rival, Competitor)]
    for path in filter(None, dict.fromkeys(paths)):
        other = loaded.folder / path
        if other.resolve() in chain:
            circle = " -> ".join(step.name for step in (*chain, other))
            raise SpecError(
                f"{loaded.name}: these runs need each other in a circle: {circle}",
                "change one of these specs so that it does not need the next run",
            )
        refuse_circle(load(other), chain)


def origin_of(loaded: LoadedSpec, run_dir: Path, campaign: Path | None = None) -> Origin:
    """Return the origin of a run: the spec, campaign and settings from which it is made now. If the
    run, or a variation of it, is repeated with the copy of the spec in the folder of the run, its
    origin remains the original spec, with the settings of both.
    """
    before = load_origin(run_dir)
    folder, run_folder = loaded.path.resolve().parent, run_dir.resolve()
    if (
        before is not None
        and loaded.path.name in (RESOLVED_SPEC, FOUND)
        and folder.parent == run_folder.parent
        # the name of a variation begins with the name of its study and a point
        and f"{run_folder.name}.".startswith(f"{folder.name}.")
    ):
        settings = [setting for setting in before.settings if setting not in loaded.overrides]
        return replace(before, settings=(*settings, *loaded.overrides))
    return Origin(
        _from(run_dir, loaded.path),
        _from(run_dir, campaign) if campaign else "",
        tuple(loaded.overrides),
    )


def _from(run_dir: Path, path: Path) -> str:
    """Return `path` relative to the run folder. If both paths have at most the root folder in
    common, return only the file name: the relative path would contain the names of private folders,
    and files of a run must not contain them. On Windows, paths on two drives have nothing in
    common.
    """
    path, run_dir = path.resolve(), run_dir.resolve()
    if path.parts[:2] != run_dir.parts[:2]:
        return path.name
    return Path(os.path.relpath(path, run_dir)).as_posix()


def _varied(loaded: LoadedSpec, variation: Need) -> LoadedSpec:
    """Return the spec of a variation: the spec of the study with other settings. A variation is a
    competitor of the study. It has no competitors itself, because those of the study may not suit
    its settings.
    """
    overrides = {
        "name": f"{loaded.spec.name}.{variation.key}",
        "validate.against": [],
        "validate.intervals": False,
    }
    try:
        return changed(loaded, (*variation.overrides, *as_overrides(overrides)))
    except SpecError as error:
        raise SpecError(
            f"{loaded.name}: with the settings of the competitor `{variation.key}`: "
            f"{error.message}",
            error.remedy,
        ) from error


SHORT_MARK = 12
"""Number of digits of another run's fingerprint that are shown in the reason why a stage must run.
"""

LONGEST_REASON = 6
"""Largest number of changes that are listed in the reason why a stage must run. Of further changes,
only the number is given.
"""


@dataclass(frozen=True)
class StagePlan:
    """Plan of a stage: the inputs and settings with which it would run now.

    - `loaded`: spec with which the stage would run. After a search, it has the structure that was
      found.
    - `part`: part of the spec that the stage reads.
    - `now`: entry that the stage would have in the record of the run. Its outputs are those files
      of the existing entry that still exist. It contains the present times of all files: if the
      stage is up to date, it replaces the existing entry, so that the files need not be read again
      next time.
    - `needed`: other runs that the stage needs.
    - `reason`: reason why the stage must run; None if it is up to date.
    """

    stage: Stage
    loaded: LoadedSpec
    part: object
    now: StageRecord
    needed: tuple[Needed, ...]
    reason: str | None


def plan_stages(
    stages: Sequence[Stage] | None,
    until: str,
    loaded: LoadedSpec,
    run_dir: Path,
    records: Mapping[str, StageRecord],
    rehash: bool,
    force: bool,
) -> Iterator[StagePlan]:
    """Yield the plan of every stage up to `until`, in order, from the files as they are now. If
    `stages` is not None, it replaces the stages of the `pipeline`.

    After a search, later stages use the structure that the search found. If the search has no
    result yet, or only that of an earlier spec or of earlier data, the plans of later stages are
    unknown, and the plan of the search is the last.

    Raises DataError if a source is missing or cannot be read.
    """
    before, previous = "", ""
    for stage in stages or pipeline(searched=loaded.spec.model.type == AUTO):
        known, part = records.get(stage.name), stage.reads(loaded.spec)
        needed = needed_runs(stage, loaded)
        chosen = recorded(part) | {
            f"run {run.need.key}": _model_mark(run, stages, run_dir.parent, rehash)
            for run in needed
        }
        if stage.name == PAGE_STAGE:
            origin = origin_of(loaded, run_dir)
            chosen["command"] = shlex.join([origin.spec, *origin.settings])
        inputs = _source_stamps(stage, loaded, known.inputs if known else {}, rehash)
        contents = {path: stamp.sha256 for path, stamp in inputs.items()}
        mark = fingerprint(stage.name, stage.revision, chosen, before, contents)
        outputs = {
            path: take_stamp(run_dir / path, stamp, rehash)
            for path, stamp in (known.outputs if known else {}).items()
            if (run_dir / path).is_file()
        }
        made = (known.tools, known.seconds, known.why) if known else ({}, 0.0, "")
        now = StageRecord(mark, stage.revision, before, chosen, inputs, outputs, *made)
        reasons = ["forced"] if force else _reasons(stage, known, now, previous)
        if more := reasons[LONGEST_REASON:]:
            reasons = [*reasons[:LONGEST_REASON], f"and {len(more)} more"]
        yield StagePlan(stage, loaded, part, now, needed, "; ".join(reasons) or None)
        before, previous = mark, stage.name
        if stage.name == until:
            return
        if stage.name == SEARCH_STAGE:
            finished = load_records(run_dir).get(SEARCH_STAGE)
            if finished is not None and finished.fingerprint == mark:
                loaded = as_found(loaded, run_dir)
            if loaded.spec.model.type == AUTO:
                return


def plans_of(
    run: Needed, stages: Sequence[Stage] | None, until: str, runs: Path, rehash: bool
) -> list[StagePlan]:
    """Return the plans of another run in the folder `runs`."""
    run_dir = runs / run.loaded.spec.name
    return list(
        plan_stages(stages, until, run.loaded, run_dir, load_records(run_dir), rehash, force=False)
    )


def as_found(loaded: LoadedSpec, run_dir: Path) -> LoadedSpec:
    """Return the spec with the structure that the search in its run folder found. Return the spec
    unchanged if it requests no search, or if no search has finished.
    """
    if loaded.spec.model.type != AUTO:
        return loaded
    with_structure: LoadedSpec = plugins.load("stages", SEARCH_STAGE).with_found(loaded, run_dir)
    return with_structure


def _model_mark(run: Needed, stages: Sequence[Stage] | None, runs: Path, rehash: bool) -> str:
    """Return the first digits of the fingerprint of another run's model. This is the fingerprint
    that the model would have if the run were brought up to date now; the model need not exist. If
    the other run only serves as a competitor and has a model, it is the fingerprint of this model.
    """
    if run.is_kept(runs):
        record = load_records(runs / run.loaded.spec.name)[MODEL_STAGE]
    else:
        record = plans_of(run, stages, MODEL_STAGE, runs, rehash)[-1].now
    return record.fingerprint[:SHORT_MARK]


def _reasons(stage: Stage, known: StageRecord | None, now: StageRecord, previous: str) -> list[str]:
    """Return the reasons why a stage must run again: the differences between its entry in
    `run.json` (`known`) and the entry that it would get if it ran now.
    """
    if known is None:
        return ["first time"]
    reasons = slice_differences(stage.name, known.slice, now.slice)
    if known.revision != now.revision:
        reasons.insert(0, f"stage revision {known.revision} -> {now.revision}")
    reasons += _file_differences("source", "removed", known.inputs, now.inputs)
    if previous and known.before != now.before:
        reasons.append(f"follows from {previous}")
    if not reasons and known.fingerprint != now.fingerprint:
        reasons.append("run.json is inconsistent: its fingerprint does not match its entries")
    reasons += _file_differences("output", "missing", known.outputs, now.outputs)
    recorded = {path for name in known.outputs for path in (name, name.split("/", 1)[0])}
    # a stage that wrote nothing, such as a report without formats, has no outputs in its entry
    missing = [output for output in stage.outputs if known.outputs and output not in recorded]
    return [*reasons, *(f"output missing: {output}" for output in missing)]


def _file_differences(
    kind: str, gone: str, known: Mapping[str, Stamp], now: Mapping[str, Stamp]
) -> list[str]:
    changed = [path for path in now if path in known and known[path].sha256 != now[path].sha256]
    return [
        *(f"{kind} {gone}: {path}" for path in known if path not in now),
        *(f"{kind} changed: {path}" for path in changed),
        *(f"{kind} added: {path}" for path in now if path not in known),
    ]


def _source_stamps(
    stage: Stage, loaded: LoadedSpec, known: Mapping[str, Stamp], rehash: bool
) -> dict[str, Stamp]:
    stamps = {}
    # recordings in memory have no files that could change
    for source in () if loaded.tables else stage.sources(loaded.spec, loaded.folder):
        path = Path(os.path.relpath(source, loaded.folder)).as_posix()
        try:
            stamps[path] = take_stamp(source, known.get(path), rehash)
        except OSError as fault:
            raise DataError(
                f"{path}: cannot be read ({fault.strerror})", "check the file and its permissions"
            ) from fault
    return dict(sorted(stamps.items()))
