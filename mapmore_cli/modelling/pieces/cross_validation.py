"""What a model says of training data that were left out of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.errors import FitError
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.literature.backbone import fit_formula
from mapmore_cli.modelling.pieces.build import build
from mapmore_cli.modelling.pieces.model import simulate
from mapmore_cli.modelling.pieces.recipe import Recipe

BLOCKS = 5
"""Contiguous blocks of a curve where there are too few levels to leave one out; the inner ones are left out in turn."""

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
    numbers: Sequence[int] = (),
) -> LeftOut:
    """Predictions of left-out training data by models of the rest, backbone included.

    The curves of these `numbers` are left out in turn. Where none are given, each inner level is, since between levels is where a
    level-wise residual can do harm; with fewer than three training levels, each inner block of the curves is.

    Raises
    ------
    FitError
        Where the backbone cannot be fitted without some of the data.
    """
    folds = _levels(curves, numbers) if numbers else _folds(curves, recipe)
    found: list[tuple[Array, Array, Array]] = []
    for number, left_out in enumerate(folds):
        training = [replace(c, held_out=c.held_out | out) for c, out in zip(curves, left_out, strict=True)]
        formula = None if backbone is None else fit_formula(backbone, training, recipe.target)
        if formula is not None and formula.failed:
            raise FitError(f"the fit of {formula.name} failed without some of the data", "take another backbone")
        model = build("fold", training, replace(recipe, fusing=replace(recipe.fusing, shrink=1.0)), quantities, formula)
        for curve, out in zip(curves, left_out, strict=True):
            if out.any():
                rows = {name: x[out] for name, x in curve.columns.items()}
                alone = np.zeros(int(out.sum()))
                if formula is not None:
                    alone = literature.get(formula.name).predict(formula.parameters, rows)
                found.append((rows[recipe.target], alone, simulate(model, rows).values - alone))
        progress(number + 1, len(folds))
    measured, alone, residual = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return LeftOut(measured, alone, residual, len(folds))


def inner_levels(curves: Sequence[Curve], recipe: Recipe) -> list[int]:
    """Numbers of the curves whose level lies between two others of the training data."""
    if recipe.cutting.level is None:
        return []
    return training_numbers(curves)[1:-1]


def training_numbers(curves: Sequence[Curve]) -> list[int]:
    """Numbers of the curves that train, in the order of their levels."""
    return [number for number, curve in enumerate(curves) if curve.training.any()]


def _levels(curves: Sequence[Curve], numbers: Sequence[int]) -> Folds:
    return [tuple(curve.training & (number == left) for number, curve in enumerate(curves)) for left in numbers]


def _folds(curves: Sequence[Curve], recipe: Recipe) -> Folds:
    inner = inner_levels(curves, recipe)
    if inner:
        return _levels(curves, inner)
    along = in_curve(curves, tuple(recipe.cutting.cuts), recipe.target, recipe.cutting.level)
    return [tuple(block(curve, along, number) for curve in curves) for number in range(1, BLOCKS - 1)]


def in_curve(curves: Sequence[Curve], segmented: Sequence[str], target: str, level: str | None) -> str:
    """The quantity along which curves are cut into blocks: the first segmented one, else the first by name that varies within them."""
    known = curves[0].columns
    return next(name for name in (*segmented, *sorted(known)) if name in known and name not in (target, level))


def block(curve: Curve, along: str, number: int) -> BoolArray:
    """The training samples in one of `BLOCKS` blocks of a curve, (n,), in the order of a quantity."""
    out = np.zeros(curve.size, dtype=bool)
    rows = np.flatnonzero(curve.training)
    order = rows[np.argsort(curve.columns[along][rows], kind="stable")]
    out[np.array_split(order, BLOCKS)[number]] = True
    return out
