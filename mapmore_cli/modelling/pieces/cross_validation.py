"""Cross-validate models on training data: leave parts of the data out of the fit, and predict these
parts.

Levels and blocks are left out only if they lie between others, because a model would have to
extrapolate to the outermost levels and blocks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, root_mean_square
from mapmore_cli.domain.errors import FitError
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.expressions import candidate
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.literature.backbone import fit_formula, pooled
from mapmore_cli.modelling.pieces.build import build
from mapmore_cli.modelling.pieces.recipe import Cuts, Recipe
from mapmore_cli.modelling.pieces.segment_fit import quantities_in

# With too few levels to leave one out, each curve is divided into this number of blocks.
# Each of the inner blocks of a curve is left out of one fit.
BLOCKS = 5

Folds = list[tuple[BoolArray, ...]]
"""For every fold, the training samples of every curve that are left out."""

Progress = Callable[[int, int], None]
"""Function that is called with the number of folds done and the number of all folds."""


@dataclass(frozen=True)
class LeftOutErrors:
    """Measured and predicted values of the training samples that were left out of a fit in turn,
    shape (n,) each.

    Each sample is predicted by a model that was fitted without this sample. The prediction is the
    sum of `backbone` and `residual`, which is the output of the pieces.
    """

    measured: Array
    backbone: Array
    residual: Array
    folds: int

    def rmse(self, share: float) -> float:
        """Return the RMSE of the prediction `backbone + share*residual`."""
        return root_mean_square(self.backbone + share * self.residual - self.measured)

    @property
    def share(self) -> float:
        """Factor `g = clip(sum(f r) / sum(f^2), 0, 1)` for the output of the pieces. Here, r is the
        residual of the backbone, and f is the prediction of r by the pieces. Of all factors from 0
        to 1, g gives the smallest squared difference between `g f` and r.
        """
        f = self.residual
        r = self.measured - self.backbone
        power = float(f @ f)
        return float(np.clip(f @ r / power, 0.0, 1.0)) if power > 0 else 0.0


def leave_out(
    curves: Sequence[Curve],
    recipe: Recipe,
    quantities: Mapping[str, Quantity],
    backbone: str | None,
    folds: Folds,
    progress: Progress = lambda _done, _total: None,
) -> LeftOutErrors:
    """Predict the training data of every fold with a model that is fitted to the other data. Return
    the measured values and the predictions, with the backbone and the pieces separately.

    Raises FitError if the backbone cannot be fitted without some of the data.
    """
    parts = []
    for left_out in folds:
        parts.append(_of_fold(curves, left_out, recipe, quantities, backbone))
        progress(len(parts), len(folds))
    measured, alone, residual = map(np.concatenate, zip(*parts, strict=True))
    return LeftOutErrors(measured, alone, residual, len(folds))


def _of_fold(
    curves: Sequence[Curve],
    left_out: Sequence[BoolArray],
    recipe: Recipe,
    quantities: Mapping[str, Quantity],
    backbone: str | None,
) -> tuple[Array, Array, Array]:
    """Return the measured target of one fold, its prediction by the backbone, and the prediction of
    the residual by the pieces.
    """
    training = [
        replace(curve, held_out=curve.held_out | out)
        for curve, out in zip(curves, left_out, strict=True)
    ]
    formula = None if backbone is None else fit_formula(backbone, training, recipe.target)
    if formula is not None and formula.failed:
        raise FitError(
            f"the fit of {formula.name} failed with a part of the data left out",
            "write another formula as `backbone`",
        )
    model = build("fold", training, _of_fewer_samples(recipe), quantities, formula)
    rows = pooled(list(zip(curves, left_out, strict=True)))
    measured = rows[recipe.target]
    alone = (
        np.zeros(len(measured))
        if formula is None
        else literature.of(formula).predict(formula.parameters, rows)
    )
    return measured, alone, predict(model, rows) - alone


def _of_fewer_samples(recipe: Recipe) -> Recipe:
    """Return the settings for fits in which one fold is left out. Segments in which too few samples
    remain are then joined with their neighbours.
    """
    cuts = dict(recipe.cuts)
    least = recipe.fit.max_terms + 1
    for name, cut in recipe.cuts.items():
        if isinstance(cut, Cuts) and cut.joins:
            cuts[name] = replace(cut, min_samples=max(cut.least, least))
    return replace(recipe, cuts=cuts)


def inner_level_count(curves: Sequence[Curve], recipe: Recipe) -> int:
    """Return the number of training curves whose level lies between two other training levels."""
    return (
        0
        if recipe.level is None
        else max(sum(bool(curve.training.any()) for curve in curves) - 2, 0)
    )


def inner_folds(curves: Sequence[Curve], recipe: Recipe) -> Folds:
    """Return the folds of a cross-validation. Each fold leaves out data that lie between other
    data, so that the model need not extrapolate.

    - With three training levels or more, each inner level is a fold. In this way, the errors
      between levels are tested, which a residual that is fitted level by level can increase.
    - With fewer than three training levels, each inner block of the curves along the segmented
      variable is a fold.
    - If curves are pooled into one surface, each inner block of the curves is a fold. If these
      curves have levels, each inner level is a further fold. A single curve, for example a table,
      is divided into blocks along every input of the surface, and each inner block is a fold.
    """
    return [fold for along in _folds_along(curves, recipe) for fold in along[1:-1]]


def _folds_along(curves: Sequence[Curve], recipe: Recipe) -> list[Folds]:
    """Return the folds along each quantity in ascending order, including the outermost folds."""
    numbers = [number for number, curve in enumerate(curves) if curve.training.any()]
    levels = [
        tuple(curve.training & (number == left) for number, curve in enumerate(curves))
        for left in numbers
    ]
    if recipe.level is not None and len(levels) > 2:
        return [levels]
    if len(levels) == 1:
        inputs = {*quantities_in(map(candidate, recipe.dictionary)), *recipe.cuts} - {
            recipe.level,
            recipe.pooled,
        }
        every_way = [_blocks_along(curves, name) for name in sorted(inputs)]
    else:
        every_way = [blocks_in(curves, recipe)]
    return every_way + ([levels] if recipe.pooled is not None else [])


def blocks_in(curves: Sequence[Curve], recipe: Recipe) -> Folds:
    """Return one fold for each of the `BLOCKS` blocks, in ascending order. The fold leaves out this
    block of every curve. Blocks are contiguous parts of a curve along the segmented variable.
    """
    along = in_curve(curves, tuple(recipe.cuts), recipe.target, recipe.level)
    every = [tuple(block(curve, along, number) for curve in curves) for number in range(BLOCKS)]
    return [fold for fold in every if any(out.any() for out in fold)]


def repeats_left_out(curves: Sequence[Curve]) -> Folds:
    """Return folds that leave out repeated recordings: each fold leaves out one training recording
    of every curve that has several.

    There are such folds only if the study itself holds out repeated recordings, that is, recordings
    at levels with other recordings for training. Otherwise, and if each curve has only one training
    recording, the result is empty.
    """
    trained = [[rows for rows in curve.stretches if curve.training[rows].any()] for curve in curves]
    if not any(
        recordings and any(curve.held_out[rows].all() for rows in curve.stretches)
        for curve, recordings in zip(curves, trained, strict=True)
    ):
        return []
    folds = []
    for number in range(max(map(len, trained))):
        fold = tuple(np.zeros(curve.size, dtype=np.bool_) for curve in curves)
        for out, curve, recordings in zip(fold, curves, trained, strict=True):
            if number < len(recordings) > 1:
                out[recordings[number]] = curve.training[recordings[number]]
        folds += [fold] if any(out.any() for out in fold) else []
    return folds


def in_curve(
    curves: Sequence[Curve], segmented: Sequence[str], target: str, level: str | None
) -> str:
    """Return the quantity along which curves are divided into blocks. It is the first segmented
    quantity. If no quantity is segmented, it is the first quantity in alphabetical order that is
    neither the target nor the level.
    """
    known = curves[0].columns
    return next(
        name
        for name in (*segmented, *sorted(known))
        if name in known and name not in (target, level)
    )


def block(curve: Curve, along: str, number: int) -> BoolArray:
    """Return a mask of the training samples in one of the `BLOCKS` blocks of a curve, shape (n,).
    The curve is divided into blocks in the order of the quantity `along`.
    """
    out = np.zeros(curve.size, dtype=bool)
    rows = np.flatnonzero(curve.training)
    order = rows[np.argsort(curve.columns[along][rows], kind="stable")]
    out[np.array_split(order, BLOCKS)[number]] = True
    return out


def _blocks_along(curves: Sequence[Curve], name: str) -> Folds:
    """Return at most five contiguous blocks along a variable. Samples with the same value are in
    the same block.
    """
    values = np.unique(np.concatenate([curve.columns[name][curve.training] for curve in curves]))
    ends = [(part[0], part[-1]) for part in np.array_split(values, min(BLOCKS, len(values)))]
    return [
        tuple(c.training & (c.columns[name] >= low) & (c.columns[name] <= high) for c in curves)
        for low, high in ends
    ]
