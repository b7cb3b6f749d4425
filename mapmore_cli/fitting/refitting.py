"""Models made anew on part of the training data: folds that are left out in turn, and the errors
there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.domain.arrays import BoolArray, IntArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.domain.results import Forecast
from mapmore_cli.fitting.kinds.choices import ModelChoices, level_of
from mapmore_cli.modelling.forecast import forecast
from mapmore_cli.modelling.pieces.cross_validation import BLOCKS
from mapmore_cli.modelling.validation.metrics import divisor

FEWEST = 3
"""Levels or recordings from which on they are left out; with fewer, blocks are: a standard error of
one or two folds says nothing.
"""


def training_only(dataset: Dataset) -> Dataset:
    """Return the dataset without its held-out samples; curves that have no others are left out."""
    curves = [curve for curve in dataset.curves if curve.training.any()]
    return replace(dataset, curves=tuple(curve.at(~curve.held_out) for curve in curves))


@dataclass(frozen=True)
class Folds:
    """What settings are tried on: a `dataset` of training samples alone, and what every fold leaves
    out of each curve. Errors are divided by `scale`.
    """

    dataset: Dataset
    masks: Sequence[tuple[BoolArray, ...]]
    left_out: str
    scale: float
    full_scale: str


def folds_of(
    dataset: Dataset, choices: ModelChoices, normaliser: str, by_level: bool = False
) -> Folds:
    """Return the folds of training samples alone: inner levels where there are enough of them, else
    blocks.

    Where the study holds levels out (`by_level`), training levels are left out also of pooled
    curves, and the outer ones where there are fewer than three inner ones.

    Raises DataError where there are too few samples to leave a block out.
    """
    scale = divisor(dataset, normaliser)
    level = dataset.level if by_level else level_of(choices.levels, choices.segment)
    levels = sorted({curve.level for curve in dataset.curves if curve.level is not None})
    inner = levels[1:-1] if len(levels) >= FEWEST + 2 or not by_level else levels
    if not choices.over_time and level is not None and len(inner) >= FEWEST:
        folds = [
            tuple(curve.training & (curve.level == value) for curve in dataset.curves)
            for value in inner
        ]
        which = "inner training" if len(inner) < len(levels) else "training"
        left_out = f"each of the {len(inner)} {which} levels of {level}"
        return Folds(dataset, folds, left_out, scale.value, scale.name)
    along = None
    if not choices.over_time:
        along = next((name for name in choices.segment if name in dataset.quantities), None)
    folds = list(zip(*(_block_masks(curve, along) for curve in dataset.curves), strict=True))
    if any(not any(mask.any() for mask in fold) for fold in folds):
        raise DataError(
            f"no curve has {BLOCKS} training samples: no block can be left out",
            "keep more samples",
        )
    of = "curve" if along else "recording"
    left_out = f"each of {BLOCKS} contiguous blocks of the training samples of every {of}"
    return Folds(dataset, folds, left_out, scale.value, scale.name)


def _block_masks(curve: Curve, along: str | None) -> list[BoolArray]:
    """Return contiguous blocks of the training samples: along a quantity, or of each recording in
    the order of time.
    """
    if along is None:
        parts = [log[curve.training[log]] for log in curve.logs]
    else:
        rows = np.flatnonzero(curve.training)
        parts = [rows[np.argsort(curve.columns[along][rows], kind="stable")]]
    return contiguous(parts, BLOCKS, curve.size)


def contiguous(parts: Sequence[IntArray], count: int, size: int, times: int = 1) -> list[BoolArray]:
    """Return masks (size,) of the first, second, ... of `count` contiguous blocks of each part,
    `times` over.
    """
    split = [np.array_split(part, count * times) for part in parts]
    masks = []
    for number in range(count):
        mask = np.zeros(size, dtype=np.bool_)
        mask[np.concatenate([block for blocks in split for block in blocks[number::count]])] = True
        masks.append(mask)
    return masks


Missed = tuple[Curve, BoolArray, Forecast]
"""A curve, its samples that were left out of a fit, (n,), and what that model says of the curve."""


def without(dataset: Dataset, masks: Sequence[BoolArray]) -> Dataset:
    """Return the dataset with more samples of every curve held out."""
    curves = zip(dataset.curves, masks, strict=True)
    kept = tuple(replace(curve, held_out=curve.held_out | out) for curve, out in curves)
    return replace(dataset, curves=kept)


def missed_by(model: Model, dataset: Dataset, masks: Sequence[BoolArray]) -> list[Missed]:
    """Return every curve of which samples were left out, with what a model of the rest says."""
    curves = zip(dataset.curves, masks, strict=True)
    return [(curve, out, forecast(model, curve)) for curve, out in curves if out.any()]


def left_out_of(
    dataset: Dataset, masks: Sequence[BoolArray], remade: Callable[[Dataset], Model]
) -> list[Missed]:
    """Return every curve of which samples are left out, with what a model says that is `remade`
    without them. Raises as the fit does.
    """
    rest = without(dataset, masks)
    return missed_by(remade(rest), rest, masks)


def errors_of(folds: Folds, remade: Callable[[Dataset], Model]) -> list[float]:
    """Return NRMSE on each fold, of models that are `remade` without it; infinite where nothing
    finite was predicted. Raises as the fits do.
    """
    nrmse = []
    target = folds.dataset.target
    for masks in folds.masks:
        every = left_out_of(folds.dataset, masks, remade)
        errors = np.concatenate(
            [
                (output.values - curve.columns[target])[out & output.ready]
                for curve, out, output in every
            ]
        )
        error = float(np.sqrt(np.mean(errors**2))) / folds.scale if len(errors) else np.inf
        nrmse.append(error if np.isfinite(error) else float("inf"))
    return nrmse
