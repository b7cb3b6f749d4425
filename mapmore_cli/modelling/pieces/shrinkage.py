"""How far to trust what a backbone leaves, asked of the training data alone.

The residual is known at the training levels. Between them it is carried with the share `g + (1 - g)(1 - 2t)^2` (`fusion.carried_share`),
so that it counts in full at the levels whatever left-out levels say about the way between. The residual of pooled data, one surface,
counts everywhere with the share g that left-out blocks support.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.models import FoldError, Model, Pieces
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.modelling.pieces.build import multiplied
from mapmore_cli.modelling.pieces.cross_validation import LeftOut, inner_folds, inner_levels, leave_out
from mapmore_cli.modelling.pieces.recipe import Recipe

BACKBONE, RESIDUAL, SHRUNKEN = "backbone", "backbone + residual", "backbone + shrunken residual"


def with_trusted_residual(
    model: Model,
    curves: Sequence[Curve],
    recipe: Recipe,
    quantities: Mapping[str, Quantity],
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> Model:
    """Return a model on a backbone, with as much of its residual as left-out training data support.

    - With three levels or more, inner levels are left out, and `shrunken_share` of the residual is carried between levels.
    - With fewer, inner blocks of the curves are left out, and the residual is dropped where it does harm there. With two, nothing is known
      between them: a residual that is kept counts at the levels alone.
    - Of one surface, inner blocks are left out, and all of the residual is multiplied by its `shrunken_share`. Where there are no blocks,
      as along two values of an input, it is left as it is.
    """
    body, formula = _on_backbone(model)
    folds = inner_folds(curves, recipe)
    if not folds:
        return model
    left_out = leave_out(curves, recipe, quantities, formula.formula, progress, folds)
    if body.level is None:
        return _shrunken(model, left_out, shrunken_share(left_out))
    if inner_levels(curves, recipe):
        return _carried(model, left_out, shrunken_share(left_out))
    if left_out.rmse(1.0) < left_out.rmse(0.0):
        errors = _errors(left_out, {BACKBONE: 0.0, RESIDUAL: 1.0})
        kept = replace(model, body=replace(body, cross_validation=errors))
        return _only_at_levels(kept) if len(body.curves) == 2 else kept
    return _dropped(model, left_out)


def shrunken_share(left_out: LeftOut) -> float:
    """`g = clip(sum(f r) / sum(f^2), 0, 1)`: least squares of what the backbone left, r, on what the pieces predicted of it, f."""
    f, r = left_out.residual, left_out.measured - left_out.backbone
    power = float(f @ f)
    return float(np.clip(f @ r / power, 0.0, 1.0)) if power > 0 else 0.0


def _carried(model: Model, left_out: LeftOut, share: float) -> Model:
    body, formula = _on_backbone(model)
    unit = model.output.unit
    note = (
        f"midway between levels, {share:.0%} of the residual on {formula.name} is carried: on {left_out.folds} left-out inner "
        f"level(s), {left_out.rmse(0.0):.4g} {unit} without it, {left_out.rmse(1.0):.4g} {unit} with all of it, "
        f"{left_out.rmse(share):.4g} {unit} with that share"
    )
    errors = _errors(left_out, {BACKBONE: 0.0, RESIDUAL: 1.0, SHRUNKEN: share})
    carried = replace(body, fusion=replace(body.fusion, shrink=share), cross_validation=errors)
    return replace(model, body=carried, notes=(*model.notes, note))


def _shrunken(model: Model, left_out: LeftOut, share: float) -> Model:
    if share == 0.0:
        return _dropped(model, left_out)
    body, formula = _on_backbone(model)
    unit = model.output.unit
    part = "" if share == 1.0 else f", {left_out.rmse(share):.4g} {unit} with that share"
    note = (
        f"{share:.0%} of the residual on {formula.name} counts: on {left_out.folds} left-out inner blocks, {left_out.rmse(0.0):.4g} {unit} "
        f"without it, {left_out.rmse(1.0):.4g} {unit} with all of it{part}"
    )
    errors = _errors(left_out, {BACKBONE: 0.0, RESIDUAL: 1.0, SHRUNKEN: share})
    curves = tuple(replace(curve, segments=multiplied(curve.segments, share)) for curve in body.curves)
    return replace(model, body=replace(body, curves=curves, cross_validation=errors), notes=(*model.notes, note))


def _only_at_levels(model: Model) -> Model:
    body, formula = _on_backbone(model)
    note = f"two levels: midway between them {formula.name} stands alone, since no inner level says how its residual runs there"
    return replace(model, body=replace(body, fusion=replace(body.fusion, shrink=0.0)), notes=(*model.notes, note))


def _dropped(model: Model, left_out: LeftOut) -> Model:
    body, formula = _on_backbone(model)
    unit = model.output.unit
    note = (
        f"cross-validation keeps {formula.name} alone: {left_out.rmse(0.0):.4g} {unit}, "
        f"with the residual {left_out.rmse(1.0):.4g} {unit} ({left_out.folds} folds)"
    )
    bare = tuple(replace(curve, segments=()) for curve in body.curves)
    errors = _errors(left_out, {BACKBONE: 0.0, RESIDUAL: 1.0})
    return replace(model, body=replace(body, curves=bare, cross_validation=errors), notes=(*model.notes, note))


def _on_backbone(model: Model) -> tuple[Pieces, FormulaFit]:
    """Return the pieces of a model, and the formula that they stand on."""
    assert isinstance(model.body, Pieces)
    assert model.body.backbone is not None
    return model.body, model.body.backbone


def _errors(left_out: LeftOut, shares: Mapping[str, float]) -> tuple[FoldError, ...]:
    return tuple(FoldError(choice, left_out.rmse(share), left_out.folds) for choice, share in shares.items())
