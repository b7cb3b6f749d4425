"""`model: {type: auto}`: structures tried on training data alone, the one that is taken, and the spec that it makes."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import TypeAdapter

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.domain.errors import FitError, MapmoreError
from mapmore_cli.domain.processors import shared_out
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.domain.search import Search, Tried
from mapmore_cli.fitting.kinds import maker_of
from mapmore_cli.fitting.kinds.choices import ModelChoices
from mapmore_cli.fitting.stage import Stage, Workspace
from mapmore_cli.fitting.trials import kept, training_only
from mapmore_cli.fitting.yardstick import black_boxes, note_of, strongest
from mapmore_cli.modelling.pieces.recipe import Fuse, Segmented
from mapmore_cli.modelling.search.candidate import Candidate
from mapmore_cli.modelling.search.choice import chosen_of
from mapmore_cli.modelling.search.families import FAMILIES
from mapmore_cli.modelling.search.situation import Situation, situation_of
from mapmore_cli.modelling.selection import AUTO, Fit
from mapmore_cli.spec.experiment import ExperimentSpec
from mapmore_cli.spec.sections.data import Holdout, Levels
from mapmore_cli.spec.sections.dictionary import DictionaryEntry
from mapmore_cli.spec.sections.model import ModelChoice
from mapmore_cli.storage.atomic import write_text

if TYPE_CHECKING:
    from mapmore_cli.fitting.stage import Progress, Warn
    from mapmore_cli.spec.loader import LoadedSpec

SEARCH = "search.json"
"""The file of what was tried, in the folder of a run."""

BLOCKS = 5
"""Contiguous blocks of every recording or curve that are left out in turn."""

MOST_PARTS = 6
"""Levels or recordings that are left out in turn, evenly chosen of more."""

MOST_SAMPLES, MOST_STEPS = 6_000, 12_000
"""Training samples that structures without memory are tried on, of more an even share; and those of any, of more the first part of every
block."""

WHOLE = 0.5
"""Share of the left-out samples that a structure predicts at least: long lags say nothing of short recordings."""


@dataclass(frozen=True)
class Slice:
    """What a search depends on."""

    levels: Levels | None
    model: ModelChoice
    fuse: Fuse
    lengths: Mapping[str, float | None]
    held_out: Holdout | None
    ignored: tuple[str, ...]
    by_level: bool


def reads(spec: ExperimentSpec) -> Slice:
    """The stage's slice of the spec; rates by which samples are kept are no inputs."""
    derived = {name for name, rule in spec.data.derive.items() if not isinstance(rule, str)}
    ignored = tuple(rule.quantity for rule in spec.data.keep if rule.quantity in derived)
    split = spec.data.split
    return Slice(spec.data.levels, spec.model, spec.fuse, spec.muscle.lengths, split.hold_out, ignored, split.leave_one_level_out)


def run(part: Slice, workspace: Workspace) -> None:
    """Search, and write what was tried."""
    dataset = workspace.files.dataset()
    found = search(dataset, part, workspace.progress)
    for note in found.notes:
        workspace.warn(note)
    write_text(workspace.out / SEARCH, json.dumps(_plain(asdict(found)), indent=1, ensure_ascii=False) + "\n")


STAGE = Stage(name="search", revision=1, outputs=(SEARCH,), reads=reads, run=run)


def _plain(value: Any) -> Any:
    """Numbers that JSON knows: null for NaN."""
    if isinstance(value, Mapping):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def read_search(path: Path) -> Search:
    """What a search wrote."""
    document = json.loads(path.read_text(encoding="utf-8"))

    def number(value: Any) -> Any:
        return float("nan") if value is None else value

    tried = tuple(
        Tried(**{**one, "errors": tuple(map(number, one["errors"])), **{k: number(one[k]) for k in ("error", "parts", "excess", "spread")}})
        for one in document["tried"]
    )
    return Search(**{**document, "tried": tried, "notes": tuple(document["notes"])})


def search(dataset: Dataset, part: Slice, progress: Progress = lambda _what, _done, _total: None) -> Search:
    """Try every candidate on left-out blocks of the training samples, and choose.

    Held-out samples are dropped before anything is computed.

    Raises
    ------
    FitError
        Where no structure could be fitted.
    """
    training = shortened(training_only(dataset))
    situation = situation_of(training, part.ignored, part.model.inputs)
    if part.by_level:
        situation = replace(situation, step=None)  # a model that runs along recordings cannot be fitted without a level
    listed = [
        (name, candidate) for name, family in FAMILIES.items() if family.applies(situation) for candidate in family.candidates(situation)
    ]
    bench = Bench.of(training, situation, part)
    clock = Clock.started(part.model.budget)
    outcomes = shared_out(lambda one: _tried(*one, bench, clock), listed, partial(progress, "structures"))
    tried = [outcome for outcome in outcomes if outcome is not None]
    return _measured(_chosen(tried, len(outcomes) - len(tried), bench, part), tried, bench, situation)


def _measured(found: Search, outcomes: Sequence[_Outcome], bench: Bench, situation: Situation) -> Search:
    """The search beside black boxes on the same blocks, with a word where one errs clearly less."""
    inputs, own = situation.inputs, found.found
    errors = black_boxes(bench.thinned, inputs, bench.thinned_blocks, situation.timed)
    residual = [np.full(curve.size, np.nan) for curve in bench.thinned.curves]
    for fold, (left, ready) in zip(bench.thinned_blocks, outcomes[found.chosen].blocks, strict=True):
        ends = np.cumsum([int(out.sum()) for out in fold])[:-1]
        for values, out, part, known in zip(residual, fold, np.split(left, ends), np.split(ready, ends), strict=True):
            values[out] = np.where(known, part, np.nan)
    hint = strongest(bench.thinned.curves, residual, inputs, situation.timed)
    told = note_of(errors, own.error * found.scale, hint)
    boxes = {name: error / found.scale for name, error in errors.items()}
    return replace(found, black_boxes=boxes or None, notes=(*found.notes, *((told,) if told else ())))


@dataclass(frozen=True)
class Clock:
    """The budget of a search: seconds of work of each process, so that a busy machine tries what an idle one does."""

    budget: float
    process: int
    began: float

    @classmethod
    def started(cls, budget: float) -> Clock:
        """The clock of this process and of its copies, whose own begin at zero."""
        return cls(budget, os.getpid(), time.process_time())

    @property
    def over(self) -> bool:
        """Whether this process has worked for longer."""
        return time.process_time() - (self.began if os.getpid() == self.process else 0.0) > self.budget


def _chosen(outcomes: Sequence[_Outcome], cut: int, bench: Bench, part: Slice) -> Search:
    """Score all structures on the rows that all of them predict, and take one."""
    usable = [number for number, one in enumerate(outcomes) if not one.tried.failure]
    if not usable:
        reasons = outcomes[0].tried.failure if outcomes else "there was no time for any"
        raise FitError(f"no structure could be fitted without some of the data: {reasons}", "name one, or raise `model.budget`")
    errors = _on_common_rows([outcomes[number].blocks for number in usable]) / bench.scale
    parts = _on_common_rows([outcomes[number].parts for number in usable]) / bench.scale if bench.parts else np.zeros((len(usable), 0))
    sizes = [outcomes[number].tried.parameters for number in usable]
    rank = chosen_of(sizes, errors, parts)
    tried = [one.tried for one in outcomes]
    for place, number in enumerate(usable):
        tried[number] = replace(
            tried[number],
            errors=tuple(errors[place].tolist()),
            error=float(np.sqrt(np.mean(errors[place] ** 2))),
            parts=float(np.sqrt(np.mean(parts[place] ** 2))) if parts.size else float("nan"),
            excess=float(rank.excess[place]),
            spread=float(rank.spread[place]),
        )
    notes = (f"the budget of {part.model.budget:g} s ended before {cut} of {cut + len(tried)} structures were tried",) if cut else ()
    return Search(
        "search",
        bench.dataset.target,
        bench.left_out,
        bench.parts_left_out,
        bench.scale,
        tuple(tried),
        usable[rank.best],
        usable[rank.chosen],
        cut,
        None,
        notes,
    )


def _on_common_rows(predicted: Sequence[Sequence[tuple[Array, BoolArray]]]) -> Array:
    """RMSE of every structure on every fold, on the rows that all structures predict, (s, f); infinite where a run diverged."""
    found = np.empty((len(predicted), len(predicted[0])))
    for fold in range(found.shape[1]):
        common = np.logical_and.reduce([one[fold][1] for one in predicted])
        for number, one in enumerate(predicted):
            squares = one[fold][0][common] ** 2
            error = float(np.sqrt(np.mean(squares))) if len(squares) else np.inf
            found[number, fold] = error if np.isfinite(error) else np.inf
    return found


@dataclass(frozen=True)
class Bench:
    """What all structures are tried on: training samples alone, what is left out of them in turn, and what errors are divided by."""

    dataset: Dataset
    thinned: Dataset
    blocks: tuple[Masks, ...]
    parts: tuple[Masks, ...]
    thinned_blocks: tuple[Masks, ...]
    thinned_parts: tuple[Masks, ...]
    left_out: str
    parts_left_out: str
    scale: float
    part: Slice

    @classmethod
    def of(cls, training: Dataset, situation: Situation, part: Slice) -> Bench:
        """The folds of training samples."""
        whole = training
        values = np.concatenate([curve.columns[training.target] for curve in training.curves])
        thinning = _thinning(whole)
        blocks, parts = _blocks(whole, situation.moving or situation.inputs), _parts(whole)
        name = "recording" if "time" in whole.curves[0].columns else "curve"
        which = "contiguous" if name == "recording" else f"inner ones of {BLOCKS + 2} contiguous"
        inner = f"each of {len(parts)} {'inner levels' if whole.level is not None else 'recordings'}" if parts else ""
        return cls(
            whole,
            replace(whole, curves=tuple(kept(curve, rows) for curve, rows in zip(whole.curves, thinning, strict=True))),
            blocks,
            parts,
            tuple(tuple(mask[rows] for mask, rows in zip(fold, thinning, strict=True)) for fold in blocks),
            tuple(tuple(mask[rows] for mask, rows in zip(fold, thinning, strict=True)) for fold in parts),
            f"each of {BLOCKS} {which} blocks of the training samples of every {name}",
            inner,
            float(np.ptp(values)) or 1.0,
            part,
        )


Masks = tuple[BoolArray, ...]
"""For every curve the samples that a fold leaves out."""


def shortened(dataset: Dataset) -> Dataset:
    """At most so many samples, where recordings are longer: of every block of every recording the first part, in one piece."""
    total = sum(curve.size for curve in dataset.curves)
    if total <= MOST_STEPS or "time" not in dataset.curves[0].columns:
        return dataset
    share = MOST_STEPS / total
    return replace(dataset, curves=tuple(kept(curve, _beginnings(curve, share)) for curve in dataset.curves))


def _beginnings(curve: Curve, share: float) -> BoolArray:
    """The first part of every block of every recording."""
    blocks = [block for log in curve.logs for block in np.array_split(log, BLOCKS)]
    mask = np.zeros(curve.size, dtype=np.bool_)
    mask[np.concatenate([block[: -int(-len(block) * share // 1)] for block in blocks])] = True
    return mask


def _thinning(dataset: Dataset) -> list[BoolArray]:
    """An even share of the samples of every curve."""
    most = max(MOST_SAMPLES // max(len(dataset.curves), 1), 1)
    return [np.arange(curve.size) % -(-curve.size // most) == 0 for curve in dataset.curves]


def _blocks(dataset: Dataset, inputs: Sequence[str]) -> tuple[Masks, ...]:
    """Contiguous blocks of every recording in the order of time; without a clock, inner ones of every curve along each of the inputs.

    What lies at the end of an input can only be extrapolated: that would decide, and is not what is asked.
    """
    if "time" in dataset.curves[0].columns:
        each = [_cut([log[curve.training[log]] for log in curve.logs], BLOCKS, curve.size) for curve in dataset.curves]
        return tuple(zip(*each, strict=True))
    folds: list[Masks] = []
    for name in inputs:
        sorted_rows = [np.argsort(curve.columns[name], kind="stable") for curve in dataset.curves]
        each = [_cut([rows], BLOCKS + 2, curve.size) for rows, curve in zip(sorted_rows, dataset.curves, strict=True)]
        folds += list(zip(*each, strict=True))[1:-1]
    return tuple(folds)


def _cut(parts: Sequence[IntArray], count: int, size: int) -> list[BoolArray]:
    """Masks of the first, second, ... of `count` contiguous blocks of each part."""
    split = [np.array_split(part, count) for part in parts]
    masks = []
    for number in range(count):
        mask = np.zeros(size, dtype=np.bool_)
        mask[np.concatenate([blocks[number] for blocks in split])] = True
        masks.append(mask)
    return masks


def _parts(dataset: Dataset) -> tuple[Masks, ...]:
    """Inner levels, or recordings where there are no levels; none where there are fewer than three of them."""
    numbers = [number for number, curve in enumerate(dataset.curves) if curve.training.any()]
    if dataset.level is not None:
        numbers = numbers[1:-1]
    if len(numbers) < 2:
        return ()
    if len(numbers) > MOST_PARTS:
        numbers = [numbers[place] for place in np.linspace(0, len(numbers) - 1, MOST_PARTS).round().astype(int)]
    return tuple(tuple(curve.training & (number == out) for number, curve in enumerate(dataset.curves)) for out in numbers)


@dataclass(frozen=True)
class _Outcome:
    """A structure with its left-out errors in every fold, (n,) each, and which of them it has."""

    tried: Tried
    blocks: Sequence[tuple[Array, BoolArray]] = ()
    parts: Sequence[tuple[Array, BoolArray]] = ()


def _tried(family: str, candidate: Candidate, bench: Bench, clock: Clock) -> _Outcome | None:
    """Fit a structure without each fold in turn; None where the time is over."""
    started = time.process_time()
    if clock.over:
        return None
    found = Tried(family, candidate.words, candidate.sections)
    try:
        choices = choices_of(candidate.sections, bench.part)
        slow = choices.over_time
        dataset, blocks, parts = (
            (bench.dataset, bench.blocks, bench.parts) if slow else (bench.thinned, bench.thinned_blocks, bench.thinned_parts)
        )
        places = [np.ones(curve.size, dtype=np.bool_) for curve in bench.dataset.curves]
        thinning = _thinning(bench.dataset) if slow else places
        of_blocks = [_left_out(choices, dataset, fold, thinning if slow else None) for fold in blocks]
        ready = np.concatenate([rows for _, rows in of_blocks])
        if ready.mean() < WHOLE:
            return _Outcome(replace(found, failure="needs a longer past than most left-out samples have", seconds=_since(started)))
        of_parts = [_left_out(choices, dataset, fold, thinning if slow else None) for fold in parts]
        size = parameters_of(choices, dataset)
    except MapmoreError as fault:
        return _Outcome(replace(found, failure=fault.message, seconds=_since(started)))
    return _Outcome(replace(found, parameters=size, seconds=_since(started)), of_blocks, of_parts)


def _since(started: float) -> float:
    return round(time.process_time() - started, 2)


def parameters_of(choices: ModelChoices, dataset: Dataset) -> int:
    """Free numbers of the model of all samples."""
    from mapmore_cli.modelling.kinds import parameters

    return parameters(refit(choices, dataset))


def refit(choices: ModelChoices, dataset: Dataset) -> Any:
    """A model of the training samples of a dataset."""
    refitted = maker_of(choices).refit
    assert refitted is not None
    return refitted(choices, dataset)


def _left_out(choices: ModelChoices, dataset: Dataset, fold: Masks, rows: Sequence[BoolArray] | None) -> tuple[Array, BoolArray]:
    """Errors of the model without a fold on the samples of the fold, and which of them it predicts; of an even share of `rows`."""
    from mapmore_cli.modelling.forecast import forecast

    curves = tuple(replace(curve, held_out=out) for curve, out in zip(dataset.curves, fold, strict=True))
    model = refit(choices, replace(dataset, curves=curves))
    errors, ready = [np.zeros(0)], [np.zeros(0, dtype=np.bool_)]
    for number, (curve, out) in enumerate(zip(curves, fold, strict=True)):
        if out.any():
            found = forecast(model, curve)
            counted = out if rows is None else out & rows[number]
            errors.append((found.values - curve.columns[dataset.target])[counted])
            ready.append(found.ready[counted])
    return np.concatenate(errors), np.concatenate(ready)


_ENTRIES = TypeAdapter(list[DictionaryEntry])
_CUTS = TypeAdapter(dict[str, Segmented])
_MODEL = TypeAdapter(ModelChoice)


def choices_of(sections: Mapping[str, Any], part: Slice) -> ModelChoices:
    """The sections of a candidate as the spec would have them."""
    segment = _CUTS.validate_python(sections.get("segment", {}))
    fuse = replace(part.fuse, **{key.partition(".")[2]: value for key, value in sections.items() if key.startswith("fuse.")})
    model = _MODEL.validate_python(sections.get("model", {}))
    from mapmore_cli.modelling import literature

    name = model.name or model.backbone
    needed = literature.get(name).dimensions if name not in (None, AUTO) else ()
    lengths = {key: value for key, value in part.lengths.items() if key in needed}
    entries = _ENTRIES.validate_python(sections.get("dictionary", []))
    return ModelChoices(part.levels, segment, entries, model, Fit(**sections.get("fit", {})), lengths, None, "search", fuse, (), ())


def settings_of(found: Search) -> dict[str, Any]:
    """The sections that were found, as settings on top of the spec."""
    empty: dict[str, Any] = {"segment": {}, "dictionary": [], "model": {"type": "mapmore"}, "fit": {}}
    return {**empty, **found.found.sections}


def as_found(loaded: LoadedSpec, run_dir: Path) -> LoadedSpec:
    """The spec with the structure that its search has found; as it is where nothing was found yet."""
    from mapmore_cli.spec.layers import as_overrides
    from mapmore_cli.spec.loader import load

    if not (run_dir / SEARCH).is_file():
        return loaded
    return load(loaded.path, (*loaded.overrides, *as_overrides(settings_of(read_search(run_dir / SEARCH)))))


def searched(
    loaded: LoadedSpec,
    runs: Path,
    budget: str | None = None,
    *,
    progress: Progress = lambda _what, _done, _total: None,
    warn: Warn = lambda _message: None,
    on_stage: Callable[[str, str | None], None] = lambda _stage, _reason: None,
) -> tuple[Search, Path]:
    """Search the structure of a study, whatever its spec says of it; what was tried, and the spec that was found.

    Raises
    ------
    SpecError, DataError, FitError
        Where the data cannot be read, or no structure can be fitted.
    """
    from mapmore_cli.pipeline.runner import FOUND, SEARCH_STAGE, bring_up_to_date, search_stages
    from mapmore_cli.spec.layers import as_overrides
    from mapmore_cli.spec.loader import load

    given: dict[str, Any] = (
        {"model.type": AUTO}
        if loaded.spec.model.type == AUTO
        else {"dictionary": None, "segment": None, "fit": None, "model": {"type": AUTO}}
    )
    asked = {} if budget is None else {"model.budget": budget}
    loaded = load(loaded.path, (*loaded.overrides, *as_overrides({**given, **asked})))
    outcome = bring_up_to_date(loaded, runs, SEARCH_STAGE, progress=progress, warn=warn, on_stage=on_stage, stages=search_stages())
    path = outcome.run_dir / FOUND
    write_text(path, as_found(loaded, outcome.run_dir).resolved_in(outcome.run_dir, given_only=True))
    return read_search(outcome.run_dir / SEARCH), path
