"""Does the residual on a backbone help? Asked of the training data alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.models import FoldError
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.backbone import fit_formula
from mapmore_cli.modelling.mapmore import build
from mapmore_cli.modelling.model import predict
from mapmore_cli.modelling.recipe import Recipe

BLOCKS = 5
"""Contiguous blocks of a curve where there are too few levels to leave one out; the inner ones are left out in turn."""

BACKBONE, RESIDUAL = "backbone", "backbone + residual"

Folds = list[tuple[BoolArray, ...]]
"""For every fold and curve, the training samples that are left out."""


def cross_validate(
    curves: Sequence[Curve],
    recipe: Recipe,
    quantities: Mapping[str, Quantity],
    backbone: str,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> tuple[FoldError, FoldError]:
    """Pooled left-out RMSE of the backbone alone and of the backbone with its residual model.

    Each inner level is left out in turn, since between levels is where a level-wise residual can do harm; with fewer than three training
    levels, each inner block of the curves is.
    """
    folds = _folds(curves, recipe)
    squares: dict[str, list[Array]] = {BACKBONE: [], RESIDUAL: []}
    for number, left_out in enumerate(folds):
        training = [replace(c, held_out=c.held_out | out) for c, out in zip(curves, left_out, strict=True)]
        formula = fit_formula(backbone, training, recipe.target)
        model = build("fold", training, recipe, quantities, formula)
        for curve, out in zip(curves, left_out, strict=True):
            rows = {name: x[out] for name, x in curve.columns.items()}
            if out.any():
                y = rows[recipe.target]
                squares[BACKBONE].append((literature.get(backbone).predict(formula.parameters, rows) - y) ** 2)
                squares[RESIDUAL].append((predict(model, rows) - y) ** 2)
        progress(number + 1, len(folds))
    errors = [FoldError(choice, float(np.sqrt(np.concatenate(s).mean())), len(folds)) for choice, s in squares.items()]
    return errors[0], errors[1]


def _folds(curves: Sequence[Curve], recipe: Recipe) -> Folds:
    training = [~curve.held_out for curve in curves]
    used = [number for number, mask in enumerate(training) if mask.any()]
    if recipe.level is not None and len(used) >= 3:
        return [tuple(mask & (number == left) for number, mask in enumerate(training)) for left in used[1:-1]]
    along = next(iter(recipe.cuts), None) or next(name for name in sorted(curves[0].columns) if name not in (recipe.target, recipe.level))
    return [tuple(_block(curve, along, block) for curve in curves) for block in range(1, BLOCKS - 1)]


def _block(curve: Curve, along: str, block: int) -> BoolArray:
    out = np.zeros(curve.size, dtype=bool)
    rows = np.flatnonzero(~curve.held_out)
    order = rows[np.argsort(curve.columns[along][rows], kind="stable")]
    out[np.array_split(order, BLOCKS)[block]] = True
    return out
