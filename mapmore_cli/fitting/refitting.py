"""Fit models again without a part of the training data, and predict this part."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import BoolArray, IntArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.domain.results import Forecast
from mapmore_cli.fitting.groups import regrouped
from mapmore_cli.modelling.forecast import forecast

FEWEST = 3
"""Smallest number of levels or recordings that are left out one by one. If there are fewer, blocks
are left out, because one or two folds give no standard error.
"""

Masks = tuple[BoolArray, ...]
"""Samples that are left out, as a mask for every curve."""


def contiguous(parts: Sequence[IntArray], count: int, size: int) -> list[BoolArray]:
    """Divide each array of row numbers in `parts` into `count` contiguous blocks. Return `count`
    masks, (size,) each: the first mask selects the first block of every array, the second mask the
    second block, and so on.
    """
    split = [np.array_split(part, count) for part in parts]
    masks = []
    for number in range(count):
        mask = np.zeros(size, dtype=np.bool_)
        mask[np.concatenate([blocks[number] for blocks in split])] = True
        masks.append(mask)
    return masks


Missed = tuple[Curve, BoolArray, Forecast]
"""A curve, its samples that were left out of a fit, (n,), and the forecast of the curve by that
model.
"""


def without(dataset: Dataset, masks: Sequence[BoolArray]) -> Dataset:
    """Return the dataset with the samples in `masks` held out, in addition to those that are held
    out already.
    """
    curves = zip(dataset.curves, masks, strict=True)
    kept = tuple(replace(curve, held_out=curve.held_out | out) for curve, out in curves)
    return replace(dataset, curves=kept)


def missed_by(model: Model, dataset: Dataset, masks: Sequence[BoolArray]) -> list[Missed]:
    """Return every curve that has left-out samples, with these samples and the forecast of the
    curve by `model`, which was fitted without these samples.
    """
    curves = zip(dataset.curves, masks, strict=True)
    return [(curve, out, forecast(model, curve)) for curve, out in curves if out.any()]


def left_out_of(
    dataset: Dataset, masks: Sequence[BoolArray], remade: Callable[[Dataset], Model]
) -> list[Missed]:
    """Estimate the effects of groups, and fit a model by calling `remade`, without the samples in
    `masks`. Return every curve that has left-out samples, with these samples and the model's
    forecast. Raises the same errors as the fit.
    """
    rest = regrouped(without(dataset, masks))
    return missed_by(remade(rest), rest, masks)


def folds_by_value(dataset: Dataset, group: str | None) -> list[Masks]:
    """Return a fold for every level, or for every value of `group`. A fold consists of one mask for
    each curve, which marks the left-out samples. Raises DataError if there is only one level or
    value, because no training data would be left.
    """
    of_curves = [
        np.full(curve.size, curve.level) if group is None else curve.columns[group]
        for curve in dataset.curves
    ]
    values = np.unique(np.concatenate(of_curves))
    if len(values) < 2:
        kind = "level" if group is None else "group"
        raise DataError(
            f"split.leave_one_{kind}_out: {group or dataset.level} is {values[0]:g} in all curves, "
            f"so that there is only one {kind}, and no training data would be left",
            "hold out recordings or a share of the samples instead"
            if group is None
            else "name the quantity that distinguishes the groups in `data.groups`",
        )
    return [tuple(of_curve == value for of_curve in of_curves) for value in values]
