"""Leave out training data in folds, and measure the errors of models that were fitted without
them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.domain.arrays import BoolArray, root_mean_square
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.fitting.kinds.choices import ModelChoices, level_of
from mapmore_cli.fitting.refitting import FEWEST, contiguous, left_out_of
from mapmore_cli.modelling.pieces.cross_validation import BLOCKS
from mapmore_cli.modelling.validation.metrics import divisor
from mapmore_cli.modelling.validation.significance import NOTHING


def training_only(dataset: Dataset) -> Dataset:
    """Return the dataset without its held-out samples. Curves of which nothing remains are left
    out.
    """
    curves = [curve for curve in dataset.curves if curve.training.any()]
    return replace(dataset, curves=tuple(curve.at(~curve.held_out) for curve in curves))


@dataclass(frozen=True)
class Folds:
    """Data for comparing settings.

    - `dataset`: training samples only.
    - `masks`: for every fold, a mask for each curve, which is True for the samples that the fold
      leaves out.
    - `left_out`: what the folds leave out, in words.
    - `scale`, `full_scale`: the number by which errors are divided to make the NRMSE, and its name.
    """

    dataset: Dataset
    masks: Sequence[tuple[BoolArray, ...]]
    left_out: str
    scale: float
    full_scale: str


def folds_of(dataset: Dataset, choices: ModelChoices, normaliser: str, by_level: bool) -> Folds:
    """Return folds of the training samples.

    If there are enough inner levels, each fold leaves out one of them; otherwise, each fold leaves
    out a block of samples. If the study itself leaves out each level in turn (`by_level`), folds
    leave out levels even if one function is fitted to all curves together; with fewer than three
    inner levels, the two outer levels are then left out in turn, too.

    Raises DataError if there are too few samples to leave out a block.
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
            f"every curve has fewer than {BLOCKS} training samples; to compare settings, mapmore "
            f"divides each curve into {BLOCKS} blocks of samples and leaves out each block in turn",
            "loosen `data.keep`, hold out less, or add recordings",
        )
    of = "curve" if along else "recording"
    left_out = f"each of {BLOCKS} contiguous blocks of the training samples of every {of}"
    return Folds(dataset, folds, left_out, scale.value, scale.name)


def _block_masks(curve: Curve, along: str | None) -> list[BoolArray]:
    """Return masks of contiguous blocks of the training samples of a curve. Samples are sorted
    along the quantity `along` or, if it is None, in the order of time in each recording.
    """
    if along is None:
        parts = [log[curve.training[log]] for log in curve.logs]
    else:
        rows = np.flatnonzero(curve.training)
        parts = [rows[np.argsort(curve.columns[along][rows], kind="stable")]]
    return contiguous(parts, BLOCKS, curve.size)


def errors_of(folds: Folds, remade: Callable[[Dataset], Model]) -> list[float]:
    """Return the NRMSE on each fold. For each fold, `remade` fits a model without the samples of
    the fold. The NRMSE is infinite if the model predicts no finite value. Raises the errors of the
    fits.
    """
    nrmse = []
    target = folds.dataset.target
    for masks in folds.masks:
        every = left_out_of(folds.dataset, masks, remade)
        errors = np.concatenate(
            [
                (predicted.values - curve.columns[target])[out & predicted.ready]
                for curve, out, predicted in every
            ]
        )
        error = root_mean_square(errors) / folds.scale
        nrmse.append(error if np.isfinite(error) else float("inf"))
    return nrmse


def geometric_mean(errors: Sequence[float]) -> float:
    """Return the geometric mean of the errors over the folds."""
    return float(np.exp(np.mean(np.log(np.maximum(errors, NOTHING)))))
