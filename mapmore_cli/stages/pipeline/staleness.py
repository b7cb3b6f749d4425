"""Which stages of a run are up to date, and why the others are not."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mapmore_cli.domain.errors import DataError
from mapmore_cli.stages.pipeline.fingerprint import fingerprint, plain, slice_differences
from mapmore_cli.stages.pipeline.needs import MODEL_STAGE, Needed, needed_runs
from mapmore_cli.stages.pipeline.stage import Stage
from mapmore_cli.storage.run_record import StageRecord, Stamp, load_records, take_stamp

if TYPE_CHECKING:
    from mapmore_cli.spec.loader import LoadedSpec

SHORT_MARK = 12
"""Digits of the fingerprint of another run that a reason shows."""

LONGEST_REASON = 6
"""Changes that a reason lists before it only counts the rest."""


@dataclass(frozen=True)
class Plan:
    """What a stage would be made from now, beside what it was made from.

    `part` is the slice of the spec, `slice` the same as JSON values. `outputs` are the stamps of the committed files that still exist.
    `reason` says why the stage has to run, None where it is up to date.
    """

    stage: Stage
    part: Any
    slice: Any
    fingerprint: str
    before: str
    inputs: Mapping[str, Stamp]
    outputs: Mapping[str, Stamp]
    needed: tuple[Needed, ...] = ()
    reason: str | None = None


def plan_stages(
    stages: Sequence[Stage],
    until: str,
    loaded: LoadedSpec,
    run_dir: Path,
    records: Mapping[str, StageRecord],
    rehash: bool,
    force: bool,
    heirs: tuple[Path, ...] = (),
) -> Iterator[Plan]:
    """The plan of every stage up to `until`, in order, from the files as they are now; `heirs` are the specs that need this one.

    Raises
    ------
    DataError
        Where a source is missing or cannot be read.
    """
    previous: Plan | None = None
    for stage in stages:
        known = records.get(stage.name)
        part = stage.reads(loaded.spec)
        needed = needed_runs(stage, loaded, heirs)
        chosen = {**plain(part), **{f"run {run.key}": _mark_of(run, stages, run_dir.parent, rehash) for run in needed}}
        before = previous.fingerprint if previous else ""
        inputs = _source_stamps(stage, loaded, known, rehash)
        mark = fingerprint(stage.name, stage.revision, chosen, before, {path: stamp.sha256 for path, stamp in inputs.items()})
        outputs = _output_stamps(run_dir, known, rehash)
        plan = Plan(stage, part, chosen, mark, before, inputs, outputs, tuple(needed))
        reasons = ["forced"] if force else _reasons(plan, known, previous)
        previous = replace(plan, reason=_joined(reasons) if reasons else None)
        yield previous
        if stage.name == until:
            return


def as_found(loaded: LoadedSpec, run_dir: Path) -> LoadedSpec:
    """The spec with the structure that the search of its run has found; as it is where it asks for none, or nothing was found yet."""
    if loaded.spec.model.type != "auto":
        return loaded
    from mapmore_cli.stages.searching import as_found

    return as_found(loaded, run_dir)


def _mark_of(run: Needed, stages: Sequence[Stage], runs: Path, rehash: bool) -> str:
    """Fingerprint of the model of another run, whether it exists yet or not; of a compared run, of the model that it has."""
    run_dir = runs / run.loaded.spec.name
    records = load_records(run_dir, lambda _message: None)
    if run.role == "compared" and MODEL_STAGE in records:
        return records[MODEL_STAGE].fingerprint[:SHORT_MARK]
    *_, last = plan_stages(stages, MODEL_STAGE, as_found(run.loaded, run_dir), run_dir, records, rehash, False, run.heirs)
    return last.fingerprint[:SHORT_MARK]


def _reasons(plan: Plan, known: StageRecord | None, previous: Plan | None) -> list[str]:
    """Everything that differs from the committed entry."""
    if known is None:
        return ["never ran"]
    reasons = [f"stage revision {known.revision} -> {plan.stage.revision}"] if known.revision != plan.stage.revision else []
    reasons += slice_differences(plan.stage.name, known.slice, plan.slice)
    reasons += _file_differences("source", known.inputs, plan.inputs)
    if previous and known.before != plan.before:
        reasons.append(f"follows from {previous.stage.name}")
    if not reasons and known.fingerprint != plan.fingerprint:
        reasons.append("run.json does not fit its own entries")
    return [*reasons, *_output_differences(plan.stage, known.outputs, plan.outputs)]


def _output_differences(stage: Stage, known: Mapping[str, Stamp], found: Mapping[str, Stamp]) -> list[str]:
    changed = _file_differences("output", known, found)
    recorded = {path for name in known for path in (name, name.split("/", 1)[0])}
    return [*changed, *(f"output missing: {output}" for output in stage.outputs if output not in recorded)]


def _file_differences(what: str, known: Mapping[str, Stamp], found: Mapping[str, Stamp]) -> list[str]:
    gone = "missing" if what == "output" else "removed"
    return [
        *(f"{what} {gone}: {path}" for path in known if path not in found),
        *(f"{what} changed: {path}" for path, stamp in found.items() if path in known and known[path].sha256 != stamp.sha256),
        *(f"{what} added: {path}" for path in found if path not in known),
    ]


def _source_stamps(stage: Stage, loaded: LoadedSpec, known: StageRecord | None, rehash: bool) -> dict[str, Stamp]:
    old = known.inputs if known else {}
    stamps = {}
    for source in stage.sources(loaded.spec, loaded.folder):
        path = Path(os.path.relpath(source, loaded.folder)).as_posix()
        try:
            stamps[path] = take_stamp(source, old.get(path), rehash)
        except OSError as fault:
            raise DataError(f"{path}: cannot be read ({fault.strerror})", "check the file and its permissions") from fault
    return dict(sorted(stamps.items()))


def _output_stamps(run_dir: Path, known: StageRecord | None, rehash: bool) -> dict[str, Stamp]:
    old = known.outputs if known else {}
    return {path: take_stamp(run_dir / path, stamp, rehash) for path, stamp in old.items() if (run_dir / path).is_file()}


def _joined(reasons: Sequence[str]) -> str:
    shown = list(reasons[:LONGEST_REASON])
    rest = len(reasons) - len(shown)
    return "; ".join([*shown, f"and {rest} more"] if rest else shown)
