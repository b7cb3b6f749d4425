"""What a model says of training data that were left out of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.errors import FitError
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.literature.backbone import fit_ahead, fit_formula, pooled
from mapmore_cli.modelling.pieces.build import build
from mapmore_cli.modelling.pieces.fit import dictionary_inputs
from mapmore_cli.modelling.pieces.model import simulate
from mapmore_cli.modelling.pieces.recipe import Cut, Cuts, Recipe

BLOCKS = 5
"""Contiguous blocks of a curve or a surface where there are too few levels to leave one out; the inner ones are left out in turn."""

Folds = list[tuple[BoolArray, ...]]
"""For every fold and curve, the training samples that are left out."""


@dataclass(frozen=True)
class LeftOut:
    """Every training sample that was left out of some fold, (n,) each: as measured, and as the fold's model without it says."""

    measured: Array
    backbone: Array
    residual: Array  # of the pieces, which are added to the backbone
    folds: int

    def rmse(self, share: float) -> float:
        """Error of the backbone with a share of the residual."""
        return float(np.sqrt(np.mean((self.backbone + share * self.residual - self.measured) ** 2)))


def leave_out(
    curves: Sequence[Curve],
    recipe: Recipe,
    quantities: Mapping[str, Quantity],
    backbone: str | None,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
    folds: Folds | None = None,
) -> LeftOut:
    """Predictions of left-out training data by models of the rest, backbone included; of `inner_folds` where none are given.

    Raises FitError where the backbone cannot be fitted without some of the data.
    """
    folds = inner_folds(curves, recipe) if folds is None else folds
    fit_backbones(curves, folds, recipe, backbone)
    found = []
    for left_out in folds:
        found.append(of_fold(curves, left_out, recipe, quantities, backbone))
        progress(len(found), len(folds))
    return together(found)


def of_fold(
    curves: Sequence[Curve], left_out: Sequence[BoolArray], recipe: Recipe, quantities: Mapping[str, Quantity], backbone: str | None
) -> LeftOut:
    """Return what a model of the rest says of one fold; raises FitError where the backbone cannot be fitted without it."""
    training = _rest(curves, left_out)
    formula = None if backbone is None else fit_formula(backbone, training, recipe.target, advice=False)
    if formula is not None and formula.failed:
        raise FitError(f"the fit of {formula.name} failed without some of the data", "take another backbone")
    model = build("fold", training, _of_fewer_samples(recipe), quantities, formula)
    rows = pooled(list(zip(curves, left_out, strict=True)))
    measured = rows[recipe.target]
    alone = np.zeros(len(measured)) if formula is None else literature.of(formula).predict(formula.parameters, rows)
    return LeftOut(measured, alone, simulate(model, rows).values - alone, 1)


def fit_backbones(curves: Sequence[Curve], folds: Folds, recipe: Recipe, backbone: str | None) -> None:
    """Fit the backbone to the rest of every fold at once, where that is quicker than in `of_fold`, which finds the fits then."""
    if backbone is not None:
        fit_ahead(backbone, [_rest(curves, left_out) for left_out in folds], recipe.target, advice=False)


def _rest(curves: Sequence[Curve], left_out: Sequence[BoolArray]) -> list[Curve]:
    """Return the curves without the training samples of a fold."""
    return [replace(c, held_out=c.held_out | out) for c, out in zip(curves, left_out, strict=True)]


def _of_fewer_samples(recipe: Recipe) -> Recipe:
    """Return the recipe with all of the residual, which joins segments that lack samples only since some are left out."""
    least = recipe.fit.most_terms + 1

    def joining(cut: Cut) -> Cut:
        return replace(cut, min_samples=max(cut.least, least)) if isinstance(cut, Cuts) and cut.joins else cut

    cuts = {name: joining(cut) for name, cut in recipe.cuts.items()}
    return replace(recipe, cuts=cuts, fuse=replace(recipe.fuse, shrink=1.0))


def together(parts: Sequence[LeftOut]) -> LeftOut:
    """Several folds as one."""
    measured, alone, residual = (np.concatenate([getattr(part, name) for part in parts]) for name in ("measured", "backbone", "residual"))
    return LeftOut(measured, alone, residual, sum(part.folds for part in parts))


def inner_levels(curves: Sequence[Curve], recipe: Recipe) -> list[int]:
    """Numbers of the curves whose level lies between two others of the training data."""
    if recipe.level is None:
        return []
    return training_numbers(curves)[1:-1]


def training_numbers(curves: Sequence[Curve]) -> list[int]:
    """Numbers of the curves that train, in the order of their levels."""
    return [number for number, curve in enumerate(curves) if curve.training.any()]


def inner_folds(curves: Sequence[Curve], recipe: Recipe) -> Folds:
    """Return what is left out in turn: data that lie between others.

    - Each inner level, since between levels is where a level-wise residual can do harm.
    - With fewer than three training levels, each inner block of the curves along the variable that is cut.
    - Where curves are pooled into one surface, each of these blocks, and the inner levels where the curves have some. A single curve, as
      a table, has inner blocks along every input of the surface.
    """
    return [fold for along in _along(curves, recipe) for fold in along[1:-1]]


def outer_folds(curves: Sequence[Curve], recipe: Recipe) -> Folds:
    """Return the lowest and the highest level or block in place of the inner ones: there a model extrapolates."""
    return [fold for along in _along(curves, recipe) for fold in (along[0], along[-1])]


def _along(curves: Sequence[Curve], recipe: Recipe) -> list[Folds]:
    """Return the folds along every quantity that has at least three, in ascending order."""
    levels = _levels(curves, training_numbers(curves))
    if recipe.level is not None and len(levels) > 2:
        return [levels]
    inputs = sorted({*dictionary_inputs(recipe.dictionary), *recipe.cuts} - {recipe.level, recipe.pooled})
    if len(levels) == 1:
        found = [_blocks(curves, name) for name in inputs]
    else:
        found = [_blocks_of_each(curves, in_curve(curves, tuple(recipe.cuts), recipe.target, recipe.level))]
    found += [levels] if recipe.pooled is not None else []
    return [folds for folds in found if len(folds) > 2]


def _levels(curves: Sequence[Curve], numbers: Sequence[int]) -> Folds:
    return [tuple(curve.training & (number == left) for number, curve in enumerate(curves)) for left in numbers]


def _blocks_of_each(curves: Sequence[Curve], along: str) -> Folds:
    """Five contiguous blocks of every curve: those of one number are left out together."""
    folds = [tuple(block(curve, along, number) for curve in curves) for number in range(BLOCKS)]
    return [fold for fold in folds if any(out.any() for out in fold)]


def in_curve(curves: Sequence[Curve], segmented: Sequence[str], target: str, level: str | None) -> str:
    """Return the quantity along which curves are cut into blocks: the first segmented one, else the first by name that varies in them."""
    known = curves[0].columns
    return next(name for name in (*segmented, *sorted(known)) if name in known and name not in (target, level))


def block(curve: Curve, along: str, number: int) -> BoolArray:
    """Return the training samples in one of `BLOCKS` blocks of a curve, (n,), in the order of a quantity."""
    out = np.zeros(curve.size, dtype=bool)
    rows = np.flatnonzero(curve.training)
    order = rows[np.argsort(curve.columns[along][rows], kind="stable")]
    out[np.array_split(order, BLOCKS)[number]] = True
    return out


def _blocks(curves: Sequence[Curve], name: str) -> Folds:
    """At most five contiguous blocks along a variable, which part no samples of one value."""
    values = np.unique(np.concatenate([curve.columns[name][curve.training] for curve in curves]))
    parts = np.array_split(values, min(BLOCKS, len(values)))
    return [
        tuple(curve.training & (curve.columns[name] >= part[0]) & (curve.columns[name] <= part[-1]) for curve in curves) for part in parts
    ]
