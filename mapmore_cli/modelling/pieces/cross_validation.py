"""What models of the rest say of training data that were left out of them: the share of a residual
on a backbone, and the backbone itself.

The residual is known at the training levels. Between them it is carried with the share `g + (1 -
g)(1 - 2t)^2` (`across_levels`), so that it counts in full at the levels whatever left-out levels
say about the way between. The residual of pooled data, one surface, counts everywhere with the
share g that left-out blocks support.

A backbone is chosen among every static formula of the study's inputs, and none. Each inner level
(of one surface: each inner block along every input) is left out in turn, and everything is done
anew without it: formula, cuts, terms, and then the share of the residual that serves best.
Outermost ones are no part of the choice, for there a model extrapolates; their error is told beside
it. With three training levels or fewer the choice would be chance (on measured muscles it took
Sárosi's formula where the hinged one has a tenth of its error). There `FEW` is taken, which keeps
to the plain formula where data have no slack foot.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.errors import FitError, MapmoreError
from mapmore_cli.domain.models import FoldError, Model, Pieces
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.expressions import candidate
from mapmore_cli.modelling.literature.backbone import fit_formula, pooled
from mapmore_cli.modelling.pieces.build import build, multiplied, names_in
from mapmore_cli.modelling.pieces.model import simulate
from mapmore_cli.modelling.pieces.recipe import Cuts, Recipe

# contiguous blocks of a curve or a surface where there are too few levels to leave one out; the
# inner ones are left out in turn
BLOCKS = 5

BACKBONE, RESIDUAL, SHRUNKEN = "backbone", "backbone + residual", "backbone + shrunken residual"

Folds = list[tuple[BoolArray, ...]]
"""For every fold and curve, the training samples that are left out."""

Progress = Callable[[int, int], None]
"""Told how many folds of how many are done."""


@dataclass(frozen=True)
class LeftOut:
    """Every training sample that was left out of some fold, (n,) each: as measured, and as the
    fold's model without it says.

    The model says `backbone` plus the `residual` of the pieces.
    """

    measured: Array
    backbone: Array
    residual: Array
    folds: int

    def rmse(self, share: float) -> float:
        """Error of the backbone with a share of the residual."""
        return float(np.sqrt(np.mean((self.backbone + share * self.residual - self.measured) ** 2)))

    @property
    def share(self) -> float:
        """`g = clip(sum(f r) / sum(f^2), 0, 1)`: least squares of what the backbone left, r, on
        what the pieces predicted of it, f.
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
) -> LeftOut:
    """Predictions of left-out training data by models of the rest, backbone included.

    Raises FitError where the backbone cannot be fitted without some of the data.
    """
    found = []
    for left_out in folds:
        found.append(of_fold(curves, left_out, recipe, quantities, backbone))
        progress(len(found), len(folds))
    return together(found)


def of_fold(
    curves: Sequence[Curve],
    left_out: Sequence[BoolArray],
    recipe: Recipe,
    quantities: Mapping[str, Quantity],
    backbone: str | None,
) -> LeftOut:
    """Return what a model of the rest says of one fold; raises FitError where the backbone cannot
    be fitted without it.
    """
    training = _rest(curves, left_out)
    formula = (
        None if backbone is None else fit_formula(backbone, training, recipe.target, advice=False)
    )
    if formula is not None and formula.failed:
        raise FitError(
            f"the fit of {formula.name} failed without some of the data", "take another backbone"
        )
    model = build("fold", training, _of_fewer_samples(recipe), quantities, formula)
    rows = pooled(list(zip(curves, left_out, strict=True)))
    measured = rows[recipe.target]
    alone = (
        np.zeros(len(measured))
        if formula is None
        else literature.of(formula).predict(formula.parameters, rows)
    )
    return LeftOut(measured, alone, simulate(model, rows).values - alone, 1)


def _rest(curves: Sequence[Curve], left_out: Sequence[BoolArray]) -> list[Curve]:
    return [replace(c, held_out=c.held_out | out) for c, out in zip(curves, left_out, strict=True)]


def _of_fewer_samples(recipe: Recipe) -> Recipe:
    """Return the recipe with all of the residual, which joins segments that lack samples only since
    some are left out.
    """
    cuts, least = dict(recipe.cuts), recipe.fit.max_terms + 1
    for name, cut in recipe.cuts.items():
        if isinstance(cut, Cuts) and cut.joins:
            cuts[name] = replace(cut, min_samples=max(cut.least, least))
    return replace(recipe, cuts=cuts)


def together(parts: Sequence[LeftOut]) -> LeftOut:
    """Several folds as one."""
    measured, alone, residual = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("measured", "backbone", "residual")
    )
    return LeftOut(measured, alone, residual, sum(part.folds for part in parts))


def inner_levels(curves: Sequence[Curve], recipe: Recipe) -> int:
    """How many curves have a level between two others of the training data."""
    return (
        0
        if recipe.level is None
        else max(sum(bool(curve.training.any()) for curve in curves) - 2, 0)
    )


def inner_folds(curves: Sequence[Curve], recipe: Recipe) -> Folds:
    """Return what is left out in turn: data that lie between others.

    - Each inner level, since between levels is where a level-wise residual can do harm.
    - With fewer than three training levels, each inner block of the curves along the variable that
      is cut.
    - Where curves are pooled into one surface, each of these blocks, and the inner levels where the
      curves have some. A single curve, as
      a table, has inner blocks along every input of the surface.
    """
    return [fold for along in _along(curves, recipe) for fold in along[1:-1]]


def outer_folds(curves: Sequence[Curve], recipe: Recipe) -> Folds:
    """Return the lowest and the highest level or block in place of the inner ones: there a model
    extrapolates.
    """
    return [fold for along in _along(curves, recipe) for fold in (along[0], along[-1])]


def _along(curves: Sequence[Curve], recipe: Recipe) -> list[Folds]:
    """Return the folds along every quantity that has at least three, in ascending order."""
    numbers = [number for number, curve in enumerate(curves) if curve.training.any()]
    levels = [
        tuple(curve.training & (number == left) for number, curve in enumerate(curves))
        for left in numbers
    ]
    if recipe.level is not None and len(levels) > 2:
        return [levels]
    if len(levels) == 1:
        inputs = {*names_in(map(candidate, recipe.dictionary)), *recipe.cuts} - {
            recipe.level,
            recipe.pooled,
        }
        found = [_blocks(curves, name) for name in sorted(inputs)]
    else:
        along = in_curve(curves, tuple(recipe.cuts), recipe.target, recipe.level)
        every = [tuple(block(curve, along, number) for curve in curves) for number in range(BLOCKS)]
        found = [[fold for fold in every if any(out.any() for out in fold)]]
    found += [levels] if recipe.pooled is not None else []
    return [folds for folds in found if len(folds) > 2]


def in_curve(
    curves: Sequence[Curve], segmented: Sequence[str], target: str, level: str | None
) -> str:
    """Return the quantity along which curves are cut into blocks: the first segmented one, else the
    first by name that varies in them.
    """
    known = curves[0].columns
    return next(
        name
        for name in (*segmented, *sorted(known))
        if name in known and name not in (target, level)
    )


def block(curve: Curve, along: str, number: int) -> BoolArray:
    """Return the training samples in one of `BLOCKS` blocks of a curve, (n,), in the order of a
    quantity.
    """
    out = np.zeros(curve.size, dtype=bool)
    rows = np.flatnonzero(curve.training)
    order = rows[np.argsort(curve.columns[along][rows], kind="stable")]
    out[np.array_split(order, BLOCKS)[number]] = True
    return out


def _blocks(curves: Sequence[Curve], name: str) -> Folds:
    """At most five contiguous blocks along a variable, which part no samples of one value."""
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
    """Return a model on a backbone, with as much of its residual as left-out training data support.

    - With three levels or more, inner levels are left out, and their `share` of the residual is
      carried between levels.
    - With fewer, inner blocks of the curves are left out, and the residual is dropped where it does
      harm there. With two, nothing is known
      between them: a residual that is kept counts at the levels alone.
    - Of one surface, inner blocks are left out, and all of the residual is multiplied by their
      `share`. Where there are no blocks, as along
      two values of an input, it is left as it is.
    """
    body, unit = model.body, model.output.unit
    assert isinstance(body, Pieces)
    assert body.backbone is not None
    name = body.backbone.name
    folds = inner_folds(curves, recipe)
    if not folds:
        return model
    left_out = leave_out(curves, recipe, quantities, body.backbone.formula, folds, progress)
    share, without, whole = left_out.share, left_out.rmse(0.0), left_out.rmse(1.0)
    both = f"{without:.4g} {unit} without it, {whole:.4g} {unit} with all of it"
    part = f", {left_out.rmse(share):.4g} {unit} with that share"
    shares, notes = {BACKBONE: 0.0, RESIDUAL: 1.0}, [*model.notes]
    if inner_levels(curves, recipe):
        shares[SHRUNKEN] = share
        body = replace(body, fusion=replace(body.fusion, shrink=share))
        carried = f"midway between levels, {share:.0%} of the residual on {name} is carried"
        notes.append(f"{carried}: on {left_out.folds} left-out inner level(s), {both}{part}")
    elif body.level is None and share > 0:
        shares[SHRUNKEN] = share
        body = replace(
            body,
            curves=tuple(
                replace(curve, segments=multiplied(curve.segments, share)) for curve in body.curves
            ),
        )
        part = "" if share == 1.0 else part
        notes.append(
            f"{share:.0%} of the residual on {name} counts: on {left_out.folds} left-out "
            f"inner blocks, {both}{part}"
        )
    elif body.level is None or not whole < without:
        body = replace(body, curves=tuple(replace(curve, segments=()) for curve in body.curves))
        errors = (
            f"{without:.4g} {unit}, with the residual {whole:.4g} {unit} ({left_out.folds} folds)"
        )
        notes.append(f"cross-validation keeps {name} alone: {errors}")
    elif len(body.curves) == 2:
        body = replace(body, fusion=replace(body.fusion, shrink=0.0))
        notes.append(
            f"two levels: midway between them {name} stands alone, since no inner level says "
            "how its residual runs there"
        )
    found = tuple(
        FoldError(choice, left_out.rmse(share), left_out.folds) for choice, share in shares.items()
    )
    return replace(model, body=replace(body, cross_validation=found), notes=tuple(notes))


FEW, FEWEST_FOLDS = (
    "sarosi_hinged",
    2,
)  # the formula that is taken where there are fewer folds than the fewest that choose
# of the least error, within which the formula with fewer parameters is taken. Wider margins lost on
# measured muscles
MARGIN = 0.02
SAMPLES = 300  # of every curve that the choice is made on, an even share in the order of the curve
TOLD = 4  # candidates that are told with their errors


@dataclass(frozen=True)
class Candidate:
    """A formula (None: no backbone) with its fused model's RMSE on left-out inner levels, and the
    share of the residual that it is for.

    Where not all folds were tried, since the first ones tell enough, the RMSE is what it comes to
    at least.
    """

    name: str | None
    rmse: float
    share: float
    tried: bool = True

    @property
    def parameters(self) -> int:
        """Number of the formula's parameters."""
        return 0 if self.name is None else len(literature.get(self.name).parameters)

    @property
    def label(self) -> str:
        """The name as told."""
        return self.name or "no backbone"


class Choice(NamedTuple):
    """The formula that was chosen, None for no backbone, and on what grounds."""

    name: str | None
    note: str


def choose_backbone(
    curves: Sequence[Curve],
    recipe: Recipe,
    quantities: Mapping[str, Quantity],
    progress: Progress = lambda _done, _total: None,
) -> Choice:
    """Choose among `candidates` by left-out inner levels of the training data."""
    names = candidates(curves, recipe.target)
    part = "block" if recipe.level is None else "level"
    folds = (
        len(inner_folds(curves, recipe)) if recipe.level is None else inner_levels(curves, recipe)
    )
    if folds < FEWEST_FOLDS:
        taken = FEW if FEW in names else None
        why = (
            f"{folds} inner training {part}(s) are too few to choose a backbone by; "
            f"{taken or 'none'} is taken"
        )
        return Choice(taken, f"{why}, as wherever they are" if taken else why)
    thinned = [thin(curve, next(iter(recipe.cuts), None)) for curve in curves]
    found = _raced(names, thinned, recipe, quantities, progress)
    if not found:
        return Choice(
            None, "no backbone: no formula could be fitted without a level, nor pieces alone"
        )
    ranked, unit = sorted(found, key=lambda one: one.rmse), quantities[recipe.target].unit
    tried = [one for one in ranked if one.tried]
    best, chosen = tried[0], simplest(tried)
    others = [one for one in ranked if one is not chosen][:TOLD]
    beside = ", ".join(
        f"{one.label} {'' if one.tried else 'over '}{one.rmse:.4g}" for one in others
    )
    simpler = (
        ""
        if chosen is best
        else f"; it has fewer parameters than {best.label}, and errs within {MARGIN:.0%} of it"
    )
    try:
        outermost = leave_out(
            thinned, recipe, quantities, chosen.name, outer_folds(thinned, recipe)
        ).rmse(chosen.share)
        beyond = f". With an outermost {part} left out it errs by {outermost:.4g} {unit}"
    except MapmoreError:  # it cannot be fitted without
        beyond = ""
    note = (
        f"backbone {chosen.label} is chosen: with each of {folds} inner training {part}s left "
        "out in turn, the fused model errs by "
        f"{chosen.rmse:.4g} {unit} ({beside}){simpler}{beyond}"
    )
    return Choice(chosen.name, note)


def candidates(curves: Sequence[Curve], target: str) -> tuple[str | None, ...]:
    """None, and every static formula that is fitted to the target and finds its inputs in the
    curves.
    """
    known = {name for name in curves[0].columns if name != target}
    formulas = [literature.get(name) for name in literature.names()]
    usable = [
        one
        for one in formulas
        if one.component == "static" and one.fitted_to == literature.TARGET and not one.dimensions
    ]
    return (None, *(one.name for one in usable if one.inputs and known.issuperset(one.inputs)))


def simplest(found: Sequence[Candidate]) -> Candidate:
    """Return the candidate with the fewest parameters of those within the margin of the least
    error, the better one of equals.
    """
    near = (1 + MARGIN) * min(one.rmse for one in found)
    return min(
        (one for one in found if one.rmse <= near), key=lambda one: (one.parameters, one.rmse)
    )


def thin(curve: Curve, along: str | None) -> Curve:
    """At most `SAMPLES` training samples of a curve, an even share in the order of a variable;
    held-out samples are left out.
    """
    rows = np.flatnonzero(curve.training)
    if along is not None:
        rows = rows[np.argsort(curve.columns[along][rows], kind="stable")]
    rows = np.sort(rows[:: max(1, -(-len(rows) // SAMPLES))])
    columns = {name: x[rows] for name, x in curve.columns.items()}
    return replace(
        curve,
        columns=columns,
        held_out=np.zeros(len(rows), dtype=np.bool_),
        at_rest=None,
        origin=None,
    )


def _raced(
    names: Sequence[str | None],
    curves: Sequence[Curve],
    recipe: Recipe,
    quantities: Mapping[str, Quantity],
    progress: Progress,
) -> list[Candidate]:
    """Return the candidates that can be fitted, each on as many folds as its choice depends on.

    A sum of squares only grows from fold to fold, whatever the share. So the candidate that errs
    least so far is tried on one more fold, until all that are left have gone beyond the margin of
    the best one.
    """
    folds = inner_folds(curves, recipe)
    samples = sum(int(out.sum()) for fold in folds for out in fold)
    said: dict[str | None, list[LeftOut]] = {name: [] for name in names}

    def tried(name: str | None) -> Candidate | None:
        """Return the candidate on one more fold, as if those to come added no error; None where it
        cannot be fitted without one.
        """
        own = said[name]
        try:
            own.append(of_fold(curves, folds[len(own)], recipe, quantities, name))
        except MapmoreError:
            return None
        left_out = together(own)
        share = 1.0 if name is None else left_out.share
        rmse = left_out.rmse(share) * float(np.sqrt(len(left_out.measured) / samples))
        return Candidate(name, rmse, share, len(own) == len(folds)) if np.isfinite(rmse) else None

    found = {name: candidate for name in names if (candidate := tried(name)) is not None}
    while found:
        best = min((one.rmse for one in found.values() if one.tried), default=np.inf)
        left = [one for one in found.values() if not one.tried and one.rmse <= (1 + MARGIN) * best]
        progress(max(len(said[name]) for name in found), len(folds))
        if not left:
            break
        name = min(left, key=lambda one: one.rmse).name
        further = tried(name)
        if further is None:
            del found[name]
        else:
            found[name] = further
    return list(found.values())
