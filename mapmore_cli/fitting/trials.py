"""Training data left out in turn, and how far models that were made without them err there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.fitting.kinds.choices import ModelChoices, level_of
from mapmore_cli.modelling.forecast import forecast
from mapmore_cli.modelling.validation.metrics import divisor

FEWEST_INNER = 3
"""Inner training levels from which on levels are left out; with fewer, blocks are: a standard error of one or two folds says nothing."""

BLOCKS = 5
"""Contiguous blocks of every recording or curve."""

Refit = Callable[[ModelChoices, Dataset], Model]
"""Makes a model of the training samples of a dataset in one go."""

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


def training_only(dataset: Dataset) -> Dataset:
    """Return the dataset without its held-out samples; curves that have no others are left out."""
    return replace(dataset, curves=tuple(kept(curve, ~curve.held_out) for curve in dataset.curves if curve.training.any()))


def kept(curve: Curve, rows: BoolArray) -> Curve:
    """Return some rows of a curve; of its recordings, those that still have any."""
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


def bench_of(dataset: Dataset, choices: ModelChoices, normaliser: str, by_level: bool = False) -> Bench:
    """Return the folds of training samples alone: inner levels where there are enough of them, else blocks.

    Where the study holds levels out (`by_level`), training levels are left out also of pooled curves, and the outer ones where there are
    fewer than three inner ones.

    Raises DataError where there are too few samples to leave a block out.
    """
    level = None if choices.over_time else level_of(choices.levels, choices.segment)
    levels = sorted({curve.level for curve in dataset.curves if curve.level is not None})
    if by_level and not choices.over_time:
        level = dataset.level
    inner = levels[1:-1] if len(levels) >= FEWEST_INNER + 2 or not by_level else levels
    if level is not None and len(inner) >= FEWEST_INNER:
        folds: Folds = [tuple(curve.training & (curve.level == value) for curve in dataset.curves) for value in inner]
        left_out = f"each of the {len(inner)} {'inner ' if len(inner) < len(levels) else ''}training levels of {level}"
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


def errors_of(choices: ModelChoices, bench: Bench, refit: Refit) -> list[float]:
    """NRMSE on each fold, of models that `refit` makes without it; infinite where nothing finite was predicted. Raises as the fits do."""
    return [_error(choices, bench, fold, refit) for fold in bench.folds]


def _error(choices: ModelChoices, bench: Bench, fold: tuple[BoolArray, ...], refit: Refit) -> float:
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
    error = float(np.sqrt(every.mean())) / bench.scale if len(every) else float("inf")
    return error if np.isfinite(error) else float("inf")
