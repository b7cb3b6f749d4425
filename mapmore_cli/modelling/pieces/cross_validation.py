"""Cross-validate models on training data, to choose the backbone and the factor by which the
residual of the backbone is multiplied.

At a training level, the residual was measured and is used in full, even if g is zero. At the
fraction t of the distance between two levels, the residual is multiplied by `g + (1 - g)(1 - 2t)^2`
(`across_levels`). The residual of pooled data (one surface) is multiplied by g everywhere. The
factor g is estimated from left-out levels or blocks.

The backbone is chosen among all static formulas of the study's inputs, and no backbone is one of
the choices. Each inner level (for one surface, each inner block along every input) is left out
once, and everything is done again without it: formula, cuts, terms, and then the best share of the
residual. The outermost levels take no part in the choice, because a model would have to extrapolate
to them. With three training levels or fewer, the choice would depend on chance: for measured
muscles, Sárosi's formula was chosen although the hinged formula has a tenth of its error. With so
few levels, the formula `FEW` is used, which is close to the plain formula if the data have no slack
foot.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, columns_at, root_mean_square
from mapmore_cli.domain.errors import FitError, MapmoreError
from mapmore_cli.domain.models import FoldError, Model, Pieces, SegmentFunction
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.expressions import candidate
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.literature.backbone import fit_formula, pooled
from mapmore_cli.modelling.pieces.build import build, quantities_in
from mapmore_cli.modelling.pieces.recipe import Cuts, Recipe

# number of contiguous blocks of a curve or a surface, if there are too few levels to leave one out
# Each inner block is left out once.
BLOCKS = 5

BACKBONE, RESIDUAL, SHRUNKEN = "backbone", "backbone + residual", "backbone + shrunken residual"

Folds = list[tuple[BoolArray, ...]]
"""For every fold, the training samples of every curve that are left out."""

Progress = Callable[[int, int], None]
"""Function that is called with the number of folds done and the number of all folds."""


@dataclass(frozen=True)
class LeftOutErrors:
    """Measured and predicted values of every training sample that was left out once, shape (n,)
    each.

    The predictions are from a fit without the sample. A prediction is the sum of `backbone` and
    of `residual`, which is the output of the pieces.
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
        f, r = self.residual, self.measured - self.backbone
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
    """Return the recipe for fits without one fold. In such fits, segments with too few remaining
    samples are joined with their neighbours.
    """
    cuts, least = dict(recipe.cuts), recipe.fit.max_terms + 1
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
    """Return the folds. Each fold leaves out data that lie between other data.

    - Each inner level is a fold, because a residual that is fitted level by level can increase
      errors between levels.
    - With fewer than three training levels, each inner block of the curves along the segmented
      variable is a fold.
    - For curves that are pooled into one surface, each inner block of the curves is a fold, and
      each inner level if the curves have levels. A single curve, for example a table, has inner
      blocks along every input of the surface.
    """
    return [fold for along in _folds_along(curves, recipe) for fold in along[1:-1]]


def _folds_along(curves: Sequence[Curve], recipe: Recipe) -> list[Folds]:
    """Return the inner folds along each quantity, without the quantities that have fewer than three
    folds. `along` holds the folds of each quantity in ascending order.
    """
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
        every_way = [_blocks_in(curves, recipe)]
    every_way += [levels] if recipe.pooled is not None else []
    return [folds for folds in every_way if len(folds) > 2]


def _blocks_in(curves: Sequence[Curve], recipe: Recipe) -> Folds:
    """Return folds that consist of the blocks of each curve along the segmented variable, in
    ascending order.
    """
    along = in_curve(curves, tuple(recipe.cuts), recipe.target, recipe.level)
    every = [tuple(block(curve, along, number) for curve in curves) for number in range(BLOCKS)]
    return [fold for fold in every if any(out.any() for out in fold)]


def repeats_left_out(curves: Sequence[Curve]) -> Folds:
    """Return the folds for a study that holds out repeated recordings: recordings at levels at
    which it also has training recordings. Each fold leaves out one training recording of every
    curve. For any other study, and if each curve has only one training recording, there are no
    folds.
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
            parts = repeats_left_out(curves) or _blocks_in(curves, recipe)[1:-1]
            inside = leave_out(curves, recipe, quantities, formula, parts)
            helps = inside.rmse(1.0) < inside.rmse(0.0)
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


def _times(body: Pieces, share: float) -> Pieces:
    """Return the pieces with their output multiplied by `share`. `share` is multiplied into the
    scalings of the segments. If it is zero, all segments are removed.
    """

    def multiplied(segment: SegmentFunction) -> SegmentFunction:
        y_slope, y_intercept = segment.scaling.y_slope, segment.scaling.y_intercept
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


FEW, FEWEST_FOLDS = "sarosi_hinged", 2
"""Formula that is used without a comparison if there are fewer than `FEWEST_FOLDS` folds."""

MARGIN = 0.02
"""Fraction of the smallest error within which the formula with fewer parameters is preferred. Wider
margins were worse on measured muscles.
"""

# largest number of samples of a curve for the choice of a backbone, evenly spread along the curve
SAMPLES = 300


class BackboneChoice(NamedTuple):
    """Result of the choice of a backbone: the name of a formula, or None for no backbone, and a
    note with the reason.
    """

    name: str | None
    note: str


def choose_backbone(
    curves: Sequence[Curve],
    recipe: Recipe,
    quantities: Mapping[str, Quantity],
    progress: Progress = lambda _done, _total: None,
) -> BackboneChoice:
    """Choose one of the `possible_backbones` by the prediction errors at left-out inner levels of
    the training data.
    """
    names = possible_backbones(curves, recipe.target)
    part = "block" if recipe.level is None else "level"
    folds = inner_folds(curves, recipe)
    count = len(folds) if recipe.level is None else inner_level_count(curves, recipe)
    if count < FEWEST_FOLDS:
        taken = FEW if FEW in names else None
        note = f"{count} inner training {part}(s) are too few to choose a backbone; "
        return BackboneChoice(taken, f"{note}{taken or 'none'} is used")
    thinned = [thin(curve, next(iter(recipe.cuts), None)) for curve in curves]
    folds = inner_folds(thinned, recipe)
    errors: dict[str | None, float] = {}
    for number, name in enumerate(names, start=1):
        with suppress(MapmoreError):  # without the fold, the fit of a formula may fail
            left_out = leave_out(thinned, recipe, quantities, name, folds)
            errors[name] = left_out.rmse(1.0 if name is None else left_out.share)
        progress(number, len(names))
    errors = {name: error for name, error in errors.items() if np.isfinite(error)}
    if not errors:
        return BackboneChoice(
            None,
            "no backbone is used: no formula and no model of segments could be fitted with "
            "a level left out",
        )
    chosen = simplest_backbone(errors)
    unit = quantities[recipe.target].unit
    others = sorted(errors.keys() - {chosen}, key=lambda name: errors[name])
    beside = ", ".join(f"{name or 'none'} {errors[name]:.4g}" for name in others)
    note = (
        f"backbone {chosen or 'none'} is chosen: it has the fewest parameters of those "
        f"within {MARGIN:.0%} of the least error. With each of {count} inner training "
        f"{part}s left out in turn, the error of the whole model is {errors[chosen]:.4g} "
        f"{unit} ({beside})"
    )
    return BackboneChoice(chosen, note)


def possible_backbones(curves: Sequence[Curve], target: str) -> tuple[str | None, ...]:
    """Return the names of all static formulas that can be fitted to the target because the curves
    have their inputs. None, which stands for no backbone, comes first.
    """
    known = {name for name in curves[0].columns if name != target}
    usable = [
        one.name
        for one in map(literature.get, literature.names())
        if one.component == "static" and not one.dimensions and known.issuperset(one.inputs)
    ]
    return None, *usable


def simplest_backbone(errors: Mapping[str | None, float]) -> str | None:
    """Return the formula with the fewest parameters among all formulas whose error is within
    `MARGIN` of the smallest error. If several have the same number of parameters, return the one
    with the smallest error.
    """
    near = [name for name, error in errors.items() if error <= (1 + MARGIN) * min(errors.values())]

    def size(name: str | None) -> tuple[int, float]:
        return len(literature.get(name).parameters) if name else 0, errors[name]

    return min(near, key=size)


def thin(curve: Curve, along: str | None) -> Curve:
    """Return at most `SAMPLES` training samples of a curve, evenly spread in the order of a
    variable, without the held-out samples.
    """
    rows = np.flatnonzero(curve.training)
    if along is not None:
        rows = rows[np.argsort(curve.columns[along][rows], kind="stable")]
    rows = np.sort(rows[:: max(1, -(-len(rows) // SAMPLES))])
    columns = columns_at(curve.columns, rows)
    return replace(
        curve,
        columns=columns,
        held_out=np.zeros(len(rows), dtype=np.bool_),
        at_rest=None,
        origin=None,
    )
