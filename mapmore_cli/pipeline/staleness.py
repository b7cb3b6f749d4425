"""Which stages of a run are up to date, and why the others are not; and the runs that a stage
needs.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import BaseModel

from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.fitting.stage import Compared, Need, Stage, Variation
from mapmore_cli.spec.experiment import ExperimentSpec
from mapmore_cli.storage.run_record import StageRecord, Stamp, load_records, take_stamp

if TYPE_CHECKING:
    from mapmore_cli.spec.loader import LoadedSpec

MODEL_STAGE = "fuse"
"""The stage after which a run has the model that others read."""


@dataclass(frozen=True)
class Needed:
    """Another run: its path in the spec or its name there, its own spec, and the specs that led to
    it, outermost first.

    A run that is only `compared` with is never made anew by this one; one that is `built_on` is
    brought up to date as a whole, with its page; a `variation` has no page.
    """

    key: str
    loaded: LoadedSpec
    heirs: tuple[Path, ...]
    role: Literal["built_on", "compared", "variation"] = "built_on"


def needed_runs(stage: Stage, loaded: LoadedSpec, heirs: tuple[Path, ...]) -> list[Needed]:
    """Return the runs that a stage needs, in the order of the spec; raises as `runs_at`."""
    return runs_at(stage.needs(loaded.spec), loaded, heirs)


def runs_built_on(loaded: LoadedSpec, heirs: tuple[Path, ...]) -> list[Needed]:
    """Return the runs of `needs:`, whose reports belong to this run's; raises as `runs_at`."""
    needs = loaded.spec.needs
    return runs_at(
        [path for path in (needs.static, needs.damping) if path is not None], loaded, heirs
    )


def runs_at(needs: Sequence[Need], loaded: LoadedSpec, heirs: tuple[Path, ...]) -> list[Needed]:
    """Return the runs of the specs at some paths from a spec's folder, and of variations of the
    spec itself.

    Raises SpecError where runs need each other in a circle, or a needed spec is missing or wrong.
    """
    from mapmore_cli.spec.loader import load

    found = []
    chain = (*heirs, loaded.path.resolve())
    for need in needs:
        if isinstance(need, Variation):
            found.append(Needed(need.name, _varied(loaded, need), chain, "variation"))
            continue
        path = need.path if isinstance(need, Compared) else need
        other = loaded.folder / path
        if other.resolve() in chain:
            circle = " -> ".join(spec.name for spec in (*chain, other))
            raise SpecError(
                f"{loaded.path}: runs need each other in a circle: {circle}", "remove one of them"
            )
        found.append(
            Needed(
                path, load(other), chain, "compared" if isinstance(need, Compared) else "built_on"
            )
        )
    return found


def _varied(loaded: LoadedSpec, variation: Variation) -> LoadedSpec:
    """Return the spec with other settings, and without competitors: it is one, and those of the
    spec may not suit it.
    """
    from mapmore_cli.spec.loader import load
    from mapmore_cli.spec.yaml_loader import as_overrides

    own = as_overrides(
        {
            "name": f"{loaded.spec.name}.{variation.name}",
            "validate.against": [],
            "validate.intervals": False,
        }
    )
    try:
        return load(loaded.path, (*loaded.overrides, *variation.overrides, *own))
    except SpecError as error:
        raise SpecError(
            f"{loaded.path}: as `{variation.name}`, with other settings: {error.message}",
            error.remedy,
        ) from error


SHORT_MARK = 12
"""Digits of the fingerprint of another run that a reason shows."""

LONGEST_REASON = 6
"""Changes that a reason lists before it only counts the rest."""


@dataclass(frozen=True)
class Plan:
    """What a stage would be made from now, beside what it was made from.

    `part` is the slice of the spec, `slice` the same as JSON values. `outputs` are the stamps of
    the committed files that still exist. `reason` says why the stage has to run, None where it is
    up to date.
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
    """Yield the plan of every stage up to `until`, in order, from the files as they are now;
    `heirs` are the specs that need this one.

    Raises DataError where a source is missing or cannot be read.
    """
    previous: Plan | None = None
    for stage in stages:
        known = records.get(stage.name)
        part = stage.reads(loaded.spec)
        needed = needed_runs(stage, loaded, heirs)
        chosen = {
            **plain(part),
            **{f"run {run.key}": _mark_of(run, stages, run_dir.parent, rehash) for run in needed},
        }
        before = previous.fingerprint if previous else ""
        inputs = _source_stamps(stage, loaded, known, rehash)
        mark = fingerprint(
            stage.name,
            stage.revision,
            chosen,
            before,
            {path: stamp.sha256 for path, stamp in inputs.items()},
        )
        outputs = _output_stamps(run_dir, known, rehash)
        plan = Plan(stage, part, chosen, mark, before, inputs, outputs, tuple(needed))
        reasons = ["forced"] if force else _reasons(plan, known, previous)
        shown = [
            *reasons[:LONGEST_REASON],
            *(
                [f"and {len(reasons) - LONGEST_REASON} more"]
                if len(reasons) > LONGEST_REASON
                else []
            ),
        ]
        previous = replace(plan, reason="; ".join(shown) or None)
        yield previous
        if stage.name == until:
            return


def as_found(loaded: LoadedSpec, run_dir: Path) -> LoadedSpec:
    """Return the spec with the structure that the search of its run found; as it is where it asks
    for none, or none was found yet.
    """
    if loaded.spec.model.type != "auto":
        return loaded
    from mapmore_cli.annexes.search.stage import as_found

    return as_found(loaded, run_dir)


def _mark_of(run: Needed, stages: Sequence[Stage], runs: Path, rehash: bool) -> str:
    """Fingerprint of the model of another run, whether it exists yet or not; of a compared run, of
    the model that it has.
    """
    run_dir = runs / run.loaded.spec.name
    records = load_records(run_dir, lambda _message: None)
    if run.role == "compared" and MODEL_STAGE in records:
        return records[MODEL_STAGE].fingerprint[:SHORT_MARK]
    *_, last = plan_stages(
        stages,
        MODEL_STAGE,
        as_found(run.loaded, run_dir),
        run_dir,
        records,
        rehash,
        False,
        run.heirs,
    )
    return last.fingerprint[:SHORT_MARK]


def _reasons(plan: Plan, known: StageRecord | None, previous: Plan | None) -> list[str]:
    """Everything that differs from the committed entry."""
    if known is None:
        return ["never ran"]
    reasons = (
        [f"stage revision {known.revision} -> {plan.stage.revision}"]
        if known.revision != plan.stage.revision
        else []
    )
    reasons += slice_differences(plan.stage.name, known.slice, plan.slice)
    reasons += _file_differences("source", known.inputs, plan.inputs)
    if previous and known.before != plan.before:
        reasons.append(f"follows from {previous.stage.name}")
    if not reasons and known.fingerprint != plan.fingerprint:
        reasons.append("run.json does not fit its own entries")
    recorded = {path for name in known.outputs for path in (name, name.split("/", 1)[0])}
    missing = (
        f"output missing: {output}" for output in plan.stage.outputs if output not in recorded
    )
    return [*reasons, *_file_differences("output", known.outputs, plan.outputs), *missing]


def _file_differences(
    what: str, known: Mapping[str, Stamp], found: Mapping[str, Stamp]
) -> list[str]:
    gone = "missing" if what == "output" else "removed"
    return [
        *(f"{what} {gone}: {path}" for path in known if path not in found),
        *(
            f"{what} changed: {path}"
            for path, stamp in found.items()
            if path in known and known[path].sha256 != stamp.sha256
        ),
        *(f"{what} added: {path}" for path in found if path not in known),
    ]


def _source_stamps(
    stage: Stage, loaded: LoadedSpec, known: StageRecord | None, rehash: bool
) -> dict[str, Stamp]:
    old = known.inputs if known else {}
    stamps = {}
    for source in stage.sources(loaded.spec, loaded.folder):
        path = Path(os.path.relpath(source, loaded.folder)).as_posix()
        try:
            stamps[path] = take_stamp(source, old.get(path), rehash)
        except OSError as fault:
            raise DataError(
                f"{path}: cannot be read ({fault.strerror})", "check the file and its permissions"
            ) from fault
    return dict(sorted(stamps.items()))


def _output_stamps(run_dir: Path, known: StageRecord | None, rehash: bool) -> dict[str, Stamp]:
    old = known.outputs if known else {}
    return {
        path: take_stamp(run_dir / path, stamp, rehash)
        for path, stamp in old.items()
        if (run_dir / path).is_file()
    }


LONGEST_VALUE = 60
"""Characters of a value that a difference shows."""

NOT_SET = "not set"


def plain(value: Any) -> Any:
    """Return a slice (frozen dataclasses, spec models and what they hold) as JSON values, under the
    names of the YAML file.
    """
    if isinstance(value, BaseModel):
        named = {
            field.alias or name: plain(getattr(value, name))
            for name, field in type(value).model_fields.items()
        }
        return named | plain(value.model_extra or {})
    if is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    return value


def fingerprint(
    name: str, revision: int, part: Any, before: str, contents: Mapping[str, str]
) -> str:
    """SHA-256 of a stage's name and revision, its slice `part`, the fingerprint `before` it, and
    the hashes of its sources by path.
    """
    whole = {
        "stage": name,
        "revision": revision,
        "slice": part,
        "before": before,
        "sources": contents,
    }
    canonical = json.dumps(whole, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(canonical.encode()).hexdigest()


def slice_differences(stage: str, old: Any, new: Any) -> list[str]:
    """Every changed key of a stage's slice with both values, as `fuse.z_s: 0.25 -> 0.3`."""
    if not isinstance(old, dict) or not isinstance(new, dict):
        return list(_differences(stage, old, new))
    return [
        text
        for key, *values in _pairs(old, new)
        for text in _differences(place_in_spec(key, stage), *values)
    ]


def _pairs(old: dict[str, Any], new: dict[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    """Yield every key of either with both values."""
    for key in new | old:
        yield key, old.get(key, NOT_SET), new.get(key, NOT_SET)


def place_in_spec(key: str, stage: str) -> str:
    """Where a key of a stage's slice stands in the YAML file: `levels` is `data.levels`, `against`
    is `validate.against`.
    """
    sections = {
        field.alias or name: field.annotation for name, field in ExperimentSpec.model_fields.items()
    }
    if key in sections:
        return key
    homes = [
        name
        for name, section in sections.items()
        if key in getattr(section, "model_fields", getattr(section, "__dataclass_fields__", ()))
    ]
    # `levels` of fuse stands inside its own section, so the first home is the one
    return f"{homes[0] if homes else stage}.{key}"


def _differences(place: str, old: Any, new: Any) -> Iterator[str]:
    if isinstance(old, dict) and isinstance(new, dict):
        for key, *values in _pairs(old, new):
            yield from _differences(f"{place}.{key}", *values)
    elif (
        isinstance(old, list)
        and isinstance(new, list)
        and len(old) == len(new)
        and any(isinstance(part, dict) for part in new)
    ):
        for number, (before, after) in enumerate(zip(old, new, strict=True)):
            yield from _differences(f"{place}[{number}]", before, after)
    elif old != new:
        was, now = _shown(old), _shown(new)
        yield f"{place}: {was} -> {now}" if was != now else f"{place} changed"


def _shown(value: Any) -> str:
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= LONGEST_VALUE else f"{text[: LONGEST_VALUE - 1]}…"
