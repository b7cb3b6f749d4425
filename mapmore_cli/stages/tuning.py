"""Settings against each other by training data alone: models that were made without some of it, and what they say of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.domain.errors import DataError, FitError, MapmoreError, SpecError, UsageError
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.domain.tuning import Trial, Tuning
from mapmore_cli.modelling.forecast import forecast
from mapmore_cli.modelling.kinds import parameters
from mapmore_cli.modelling.scores.rows import divisor
from mapmore_cli.modelling.scores.simplest import simplest_of
from mapmore_cli.spec.layers import as_overrides
from mapmore_cli.stages import fuse
from mapmore_cli.stages.ingestion.files import slice_of
from mapmore_cli.stages.kinds import maker_of
from mapmore_cli.stages.kinds.choices import ModelChoices, level_of
from mapmore_cli.stages.pipeline.runner import OnStage, Warn, bring_up_to_date
from mapmore_cli.storage.run_folder import RunFiles

if TYPE_CHECKING:
    from mapmore_cli.spec.loader import LoadedSpec
    from mapmore_cli.stages.pipeline.stage import Progress

FEWEST_INNER = 3
"""Inner training levels from which on levels are left out; with fewer, blocks are: a standard error of one or two folds says nothing."""

BLOCKS = 5
"""Contiguous blocks of every recording or curve."""

Folds = Sequence[tuple[BoolArray, ...]]
"""For every fold and curve the samples that are left out."""


@dataclass(frozen=True)
class Bench:
    """What all combinations are tried on: `dataset` holds nothing but training samples."""

    dataset: Dataset
    folds: Folds
    left_out: str
    scale: float
    full_scale: str


def tune(
    loaded: LoadedSpec,
    over: Mapping[str, Sequence[Any]],
    runs: Path,
    *,
    progress: Progress = lambda _what, _done, _total: None,
    warn: Warn = lambda _message: None,
    on_stage: OnStage = lambda _stage, _reason: None,
) -> Tuning:
    """Try every combination of settings (`over`, by their place in the spec) on training data that its models were made without.

    The data are ingested in the folder of the run; nothing else is written. Held-out samples are dropped before anything is computed.

    Raises
    ------
    UsageError
        Where a setting changes the data, so that errors could not be compared.
    SpecError, DataError, FitError
        Where the spec is wrong with some setting, or no combination can be fitted.
    """
    variants = list(_variants(loaded, over))
    outcome = bring_up_to_date(loaded, runs, "ingest", progress=progress, warn=warn, on_stage=on_stage)
    bench = bench_of(training_only(RunFiles(outcome.run_dir).dataset()), fuse.reads(loaded.spec), loaded.spec.validation.normaliser)
    trials = []
    for number, (settings, choices) in enumerate(variants):
        trials.append(_tried(settings, choices, bench))
        progress("combinations", number + 1, len(variants))
    return ranked(loaded.spec.name, bench, trials)


def _variants(loaded: LoadedSpec, over: Mapping[str, Sequence[Any]]) -> Iterator[tuple[dict[str, Any], ModelChoices]]:
    from mapmore_cli.spec.loader import load

    for values in product(*over.values()):
        settings = dict(zip(over, values, strict=True))
        spec = load(loaded.path, (*loaded.overrides, *as_overrides(settings))).spec
        if slice_of(spec) != slice_of(loaded.spec):
            named = ", ".join(over)
            raise UsageError(
                f"--over {named}: changes the data, so that errors could not be compared", "tune how the model is made of them"
            )
        choices = fuse.reads(spec)
        if maker_of(choices).refit is None:
            raise SpecError(f"{loaded.path}: a sum of other runs has no settings of its own", "tune the specs that it adds up")
        yield settings, choices


def training_only(dataset: Dataset) -> Dataset:
    """The dataset without its held-out samples; curves that have no others are left out."""
    return replace(dataset, curves=tuple(_kept(curve, ~curve.held_out) for curve in dataset.curves if curve.training.any()))


def _kept(curve: Curve, rows: BoolArray) -> Curve:
    """Some rows of a curve; of its recordings, those that still have any."""
    origin, recordings = None, curve.recordings
    if curve.origin is not None:
        left, origin = np.unique(curve.origin[rows], return_inverse=True)
        recordings = tuple(curve.recordings[number] for number in left)
    return replace(
        curve,
        columns={name: values[rows] for name, values in curve.columns.items()},
        held_out=curve.held_out[rows],
        recordings=recordings,
        at_rest=None if curve.at_rest is None else curve.at_rest[rows],
        origin=origin,
    )


def bench_of(dataset: Dataset, choices: ModelChoices, normaliser: str) -> Bench:
    """The folds of training samples alone: inner levels where there are enough of them, else blocks.

    Raises
    ------
    DataError
        Where there are too few samples to leave a block out.
    """
    level = None if choices.over_time else level_of(choices.levels, choices.segment)
    inner = sorted({curve.level for curve in dataset.curves if curve.level is not None})[1:-1]
    if level is not None and len(inner) >= FEWEST_INNER:
        folds: Folds = [tuple(curve.training & (curve.level == value) for curve in dataset.curves) for value in inner]
        left_out = f"each of the {len(inner)} inner training levels of {level}"
    else:
        along = None if choices.over_time else next((name for name in choices.segment if name in dataset.quantities), None)
        blocks = [_blocks(curve, along) for curve in dataset.curves]
        folds = [tuple(of[number] for of in blocks) for number in range(BLOCKS)]
        left_out = f"each of {BLOCKS} contiguous blocks of the training samples of every {'curve' if along else 'recording'}"
        if any(not any(mask.any() for mask in fold) for fold in folds):
            raise DataError(f"no curve has {BLOCKS} training samples: no block can be left out", "keep more samples")
    scale = divisor(dataset, normaliser)
    return Bench(dataset, folds, left_out, scale.value, scale.name)


def _blocks(curve: Curve, along: str | None) -> list[BoolArray]:
    """Contiguous blocks of the training samples: along a quantity, or of each recording in the order of time."""
    rows = np.flatnonzero(curve.training)
    if along is not None:
        parts: list[IntArray] = [rows[np.argsort(curve.columns[along][rows], kind="stable")]]
    else:
        parts = [log[curve.training[log]] for log in curve.logs]
    split = [np.array_split(part, BLOCKS) for part in parts]
    masks = []
    for number in range(BLOCKS):
        mask = np.zeros(curve.size, dtype=np.bool_)
        mask[np.concatenate([part[number] for part in split])] = True
        masks.append(mask)
    return masks


def _tried(settings: Mapping[str, Any], choices: ModelChoices, bench: Bench) -> Trial:
    """The errors on the folds, of models that were made without them; where a fit fails, why."""
    refit = maker_of(choices).refit
    assert refit is not None
    try:
        size = parameters(refit(choices, bench.dataset))
        errors = [_error(refit, choices, bench, fold) for fold in bench.folds]
    except MapmoreError as fault:
        return Trial(settings, failure=fault.message)
    lost = sum(not np.isfinite(error) for error in errors)
    if lost:
        return Trial(settings, size, failure=f"no finite prediction on {lost} of {len(errors)} folds")
    return Trial(settings, size, tuple(errors), float(np.mean(errors)))


def _error(refit: Any, choices: ModelChoices, bench: Bench, fold: tuple[BoolArray, ...]) -> float:
    """NRMSE on the samples of a fold."""
    curves = tuple(replace(curve, held_out=out) for curve, out in zip(bench.dataset.curves, fold, strict=True))
    model = refit(choices, replace(bench.dataset, curves=curves))
    squares: list[Array] = []
    for curve in curves:
        if curve.held_out.any():
            found = forecast(model, curve)
            rows = curve.held_out & found.ready
            squares.append((found.values[rows] - curve.columns[bench.dataset.target][rows]) ** 2)
    every = np.concatenate(squares)
    return float(np.sqrt(every.mean())) / bench.scale if len(every) else float("nan")


def ranked(name: str, bench: Bench, trials: Sequence[Trial]) -> Tuning:
    """The trials with what they err beyond the best, and the simplest within one standard error.

    Raises
    ------
    FitError
        Where none of them could be fitted.
    """
    usable = [number for number, trial in enumerate(trials) if trial.errors]
    if not usable:
        raise FitError(f"{name}: no combination could be fitted without some of the data: {trials[0].failure}", "try simpler settings")
    rank = simplest_of([trials[i].parameters for i in usable], np.array([trials[i].errors for i in usable]))
    told = list(trials)
    for place, number in enumerate(usable):
        told[number] = replace(trials[number], excess=float(rank.excess[place]), spread=float(rank.spread[place]))
    return Tuning(name, bench.left_out, bench.full_scale, tuple(told), told[usable[rank.best]], told[usable[rank.chosen]])
