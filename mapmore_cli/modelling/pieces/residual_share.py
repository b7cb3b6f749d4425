"""Choose the factor by which the residual of a backbone is multiplied, by cross-validation.

At a training level, the residual was measured and is used in full, even if the factor g is zero. At
the fraction t of the distance between two levels, the residual is multiplied by `g + (1 - g)(1 -
2t)^2` (`levels.across_levels`). The residual of pooled data (one surface) is multiplied by g
everywhere. The factor g is estimated from left-out levels or blocks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from mapmore_cli.domain.models import FoldError, Model, Pieces, SegmentFunction
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.modelling.pieces.cross_validation import (
    Progress,
    blocks_in,
    inner_folds,
    inner_level_count,
    leave_out,
    repeats_left_out,
)
from mapmore_cli.modelling.pieces.recipe import Recipe

BACKBONE, RESIDUAL, SHRUNKEN = "backbone", "backbone + residual", "backbone + shrunken residual"


def with_trusted_residual(
    model: Model,
    curves: Sequence[Curve],
    recipe: Recipe,
    quantities: Mapping[str, Quantity],
    progress: Progress = lambda _done, _total: None,
) -> Model:
    """Return a model with a backbone whose residual is reduced or removed, if this improves the
    predictions of left-out training data.

    - With three levels or more, each inner level is left out once. Between levels, the residual is
      multiplied by the resulting `share`. If this share is 0, the residual acts only at the levels,
      and a second test checks it there. The test leaves out repeats, or inner blocks of the curves
      if the study holds out no repeats. If the residual does not improve these predictions, it is
      removed completely.
    - With fewer levels, inner blocks of the curves are left out, and the residual is dropped if it
      makes their prediction worse. With two levels, no data show its effect between them, so that a
      residual that is kept counts only at the levels.
    - For one surface, inner blocks are left out, and the whole residual is multiplied by their
      `share`. If there are no blocks, for example along an input with two values, the residual is
      unchanged.
    """
    body, unit = model.body_of(Pieces), model.output.unit
    assert body.backbone is not None
    name, formula = body.backbone.name, body.backbone.formula
    folds = inner_folds(curves, recipe)
    if not folds:
        return model
    left_out = leave_out(curves, recipe, quantities, formula, folds, progress)
    share, without, whole = left_out.share, left_out.rmse(0.0), left_out.rmse(1.0)
    errors = (
        f"on {left_out.folds} left-out part(s) the error is {without:.4g} {unit} with the formula "
        f"alone, {whole:.4g} {unit} with the whole correction, {left_out.rmse(share):.4g} {unit} "
        f"with {share:.0%} of it"
    )
    as_good = f"`model: {{type: literature, name: {name}}}` is as good"
    shares, note = {BACKBONE: 0.0, RESIDUAL: 1.0}, ""
    if inner_level_count(curves, recipe):
        shares[SHRUNKEN] = share
        body = body.joined(shrink=share)
        note = (
            f"midway between levels, {share:.0%} of the correction of {name} by the segments is "
            f"used: {errors}"
        )
        if share == 0:
            helps = _helps_at_levels(curves, recipe, quantities, formula)
            body = body if helps else _times(body, 0.0)
            unused = (
                f"between levels, the correction of {name} by the segments is not used"
                if helps
                else f"the correction of {name} by the segments is left out"
            )
            note = f"{unused}, because {as_good}: {errors}"
    elif body.level is None and share > 0:
        shares[SHRUNKEN] = share
        body = _times(body, share)
        note = f"{share:.0%} of the correction of {name} by the segments is used: {errors}"
    elif body.level is None or not whole < without:
        body = _times(body, 0.0)
        note = f"the correction of {name} by the segments is left out, because {as_good}: {errors}"
    elif len(body.curves) == 2:
        body = body.joined(shrink=0.0)
        note = (
            f"midway between the two levels only {name} is used; measure a level between "
            "them to learn how its error changes there"
        )
    tried = tuple(
        FoldError(choice, left_out.rmse(share), left_out.folds) for choice, share in shares.items()
    )
    body = replace(body, cross_validation=tried)
    return replace(model, body=body, notes=(*model.notes, note) if note else model.notes)


def _helps_at_levels(
    curves: Sequence[Curve], recipe: Recipe, quantities: Mapping[str, Quantity], backbone: str
) -> bool:
    """Return True if the residual of the backbone improves the predictions of left-out data at the
    levels themselves. If the study holds out repeated recordings, each fold leaves out repeated
    recordings. Otherwise, each fold leaves out an inner block of every curve.
    """
    parts = repeats_left_out(curves) or blocks_in(curves, recipe)[1:-1]
    left_out = leave_out(curves, recipe, quantities, backbone, parts)
    return left_out.rmse(1.0) < left_out.rmse(0.0)


def _times(body: Pieces, share: float) -> Pieces:
    """Multiply the output of the pieces by `share`, and return the pieces. The factor is included
    in the scaling of each segment. If it is zero, all segments are removed.
    """

    def multiplied(segment: SegmentFunction) -> SegmentFunction:
        y_slope = segment.scaling.y_slope
        y_intercept = segment.scaling.y_intercept
        return replace(
            segment,
            scaling=replace(
                segment.scaling, y_slope=share * y_slope, y_intercept=share * y_intercept
            ),
        )

    curves = (
        replace(curve, segments=tuple(map(multiplied, curve.segments)) if share else ())
        for curve in body.curves
    )
    return replace(body, curves=tuple(curves))
