"""Which formula the pieces stand on: the one whose fused model errs least on left-out training levels.

The candidates are few: every static formula of the study's inputs, and none. Each inner level (of one surface: each inner block along every
input) is left out in turn, and everything is done anew without it: formula, cuts, terms, and then the share of the residual that serves
best. Outermost ones are no part of the choice, for there a model extrapolates; their error is told beside it.

With three training levels or fewer, one fold or none is left, in which hardly any formula is determined: the choice would be chance (on
measured muscles it took Sárosi's formula where the hinged one has a tenth of its error). There `FEW` is taken, which keeps to the plain
formula where data have no slack foot.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.pieces import cross_validation
from mapmore_cli.modelling.pieces.cross_validation import LeftOut, Progress, inner_folds, inner_levels, leave_out, outer_folds
from mapmore_cli.modelling.pieces.recipe import Recipe

FEW, FEWEST_FOLDS = "sarosi_hinged", 2  # the formula that is taken where there are fewer folds than the fewest that choose
MARGIN = 0.02  # of the least error, within which the formula with fewer parameters is taken. Wider margins lost on measured muscles
SAMPLES = 300  # of every curve that the choice is made on, an even share in the order of the curve
TOLD = 4  # candidates that are told with their errors


@dataclass(frozen=True)
class Candidate:
    """A formula (None: no backbone) with its fused model's RMSE on left-out inner levels, and the share of the residual that it is for.

    Where not all folds were tried, since the first ones tell enough, the RMSE is what it comes to at least.
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


@dataclass(frozen=True)
class Choice:
    """The formula that was chosen, None for no backbone, and on what grounds."""

    name: str | None
    note: str


def choose_backbone(
    curves: Sequence[Curve], recipe: Recipe, quantities: Mapping[str, Quantity], progress: Progress = lambda _done, _total: None
) -> Choice:
    """Choose among `candidates` by left-out inner levels of the training data."""
    names = candidates(curves, recipe.target)
    part = "training block" if recipe.level is None else "training level"
    folds = len(inner_folds(curves, recipe)) if recipe.level is None else inner_levels(curves, recipe)
    if folds < FEWEST_FOLDS:
        taken = FEW if FEW in names else None
        why = f"{folds} inner {part}(s) are too few to choose a backbone by; {taken or 'none'} is taken"
        return Choice(taken, f"{why}, as wherever they are" if taken else why)
    thinned = [thin(curve, next(iter(recipe.cuts), None)) for curve in curves]
    found = _raced(names, _Folds(thinned, recipe, quantities), progress)
    if not found:
        return Choice(None, "no backbone: no formula could be fitted without a level, nor pieces alone")
    chosen, unit = simplest([one for one in found if one.tried]), quantities[recipe.target].unit
    others = sorted((one for one in found if one is not chosen), key=lambda one: one.rmse)[:TOLD]
    beside = ", ".join(f"{one.label} {'' if one.tried else 'over '}{one.rmse:.4g}" for one in others)
    best = min((one for one in found if one.tried), key=lambda one: one.rmse)
    simpler = "" if chosen is best else f"; it has fewer parameters than {best.label}, and errs within {MARGIN:.0%} of it"
    try:
        outermost = leave_out(thinned, recipe, quantities, chosen.name, outer_folds(thinned, recipe)).rmse(chosen.share)
        beyond = f". With an outermost {part.split()[-1]} left out it errs by {outermost:.4g} {unit}"
    except MapmoreError:  # it cannot be fitted without
        beyond = ""
    note = (
        f"backbone {chosen.label} is chosen: with each of {folds} inner {part}s left out in turn, the fused model errs by "
        f"{chosen.rmse:.4g} {unit} ({beside}){simpler}{beyond}"
    )
    return Choice(chosen.name, note)


def candidates(curves: Sequence[Curve], target: str) -> tuple[str | None, ...]:
    """None, and every static formula that is fitted to the target and finds its inputs in the curves."""
    known = {name for name in curves[0].columns if name != target}
    formulas = [literature.get(name) for name in literature.names()]
    usable = [one for one in formulas if one.component == "static" and one.fitted_to == literature.TARGET and not one.dimensions]
    return (None, *(one.name for one in usable if one.inputs and known.issuperset(one.inputs)))


def simplest(found: Sequence[Candidate]) -> Candidate:
    """Return the candidate with the fewest parameters of those within the margin of the least error, the better one of equals."""
    least = min(one.rmse for one in found)
    return min((one for one in found if one.rmse <= (1 + MARGIN) * least), key=lambda one: (one.parameters, one.rmse))


def thin(curve: Curve, along: str | None) -> Curve:
    """At most `SAMPLES` training samples of a curve, an even share in the order of a variable; held-out samples are left out."""
    rows = np.flatnonzero(curve.training)
    if along is not None:
        rows = rows[np.argsort(curve.columns[along][rows], kind="stable")]
    rows = np.sort(rows[:: max(1, -(-len(rows) // SAMPLES))])
    columns = {name: x[rows] for name, x in curve.columns.items()}
    return replace(curve, columns=columns, held_out=np.zeros(len(rows), dtype=np.bool_), at_rest=None, origin=None)


class _Folds:
    """The inner folds of a choice, and what candidates said of those that they were tried on."""

    def __init__(self, curves: Sequence[Curve], recipe: Recipe, quantities: Mapping[str, Quantity]) -> None:
        self.curves, self.recipe, self.quantities = curves, recipe, quantities
        self.folds = inner_folds(curves, recipe)
        self.samples = sum(int(out.sum()) for fold in self.folds for out in fold)
        self.said: dict[str | None, list[LeftOut]] = {}

    def tried(self, name: str | None) -> Candidate | None:
        """Return the candidate on one more fold, as if those to come added no error; None where it cannot be fitted without one."""
        said = self.said.setdefault(name, [])
        if len(said) == 1:  # it has come through the first: those that do are mostly tried on all
            cross_validation.fit_backbones(self.curves, self.folds, self.recipe, name)
        try:
            said.append(cross_validation.of_fold(self.curves, self.folds[len(said)], self.recipe, self.quantities, name))
        except MapmoreError:
            return None
        left_out = cross_validation.together(said)
        share = 1.0 if name is None else left_out.share
        rmse = left_out.rmse(share) * float(np.sqrt(len(left_out.measured) / self.samples))
        return Candidate(name, rmse, share, len(said) == len(self.folds)) if np.isfinite(rmse) else None


def _raced(names: Sequence[str | None], folds: _Folds, progress: Progress) -> list[Candidate]:
    """Return the candidates that can be fitted, each on as many folds as its choice depends on.

    A sum of squares only grows from fold to fold, whatever the share. So the candidate that errs least so far is tried on one more fold,
    until all that are left have gone beyond the margin of the best one.
    """
    found = {name: candidate for name in names if (candidate := folds.tried(name)) is not None}
    while found:
        best = min((one.rmse for one in found.values() if one.tried), default=np.inf)
        left = [one for one in found.values() if not one.tried and one.rmse <= (1 + MARGIN) * best]
        progress(max(len(folds.said[one.name]) for one in found.values()), len(folds.folds))
        if not left:
            break
        name = min(left, key=lambda one: one.rmse).name
        further = folds.tried(name)
        if further is None:
            del found[name]
        else:
            found[name] = further
    return list(found.values())
