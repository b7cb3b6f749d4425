"""Choose the backbone of a model by cross-validation.

The candidates are all static formulas of the study's inputs, and a model without a backbone. Each
inner level is left out once. (If all curves form one surface, each inner block along every input is
left out instead.) Without the left-out data, everything is done again for each candidate: the
formula is fitted, the curves are cut, the terms are chosen, and the factor of the residual is
chosen.

With three training levels or fewer, the choice would depend on chance: for measured muscles,
Sárosi's formula was chosen although the hinged formula has a tenth of its error. With so few
levels, the formula `FEW` is used without a comparison. If the data have no slack foot, `FEW` is
close to the same formula without a hinge.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import columns_at
from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.pieces.cross_validation import (
    Progress,
    inner_folds,
    inner_level_count,
    leave_out,
)
from mapmore_cli.modelling.pieces.recipe import Recipe

FEWEST_FOLDS = 2  # smallest number of folds with which formulas are compared
FEW = "sarosi_hinged"  # formula that is used if there are fewer than `FEWEST_FOLDS` folds
# Formulas are equally good if their errors exceed the smallest error by at most this fraction.
# Of equally good formulas, the formula with the fewest parameters is chosen.
# Larger fractions than 2 % gave worse models of measured muscles.
MARGIN = 0.02

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
    """Choose one of the `possible_backbones`. The criterion is the prediction error at inner levels
    of the training data that are left out of the fit.
    """
    names = possible_backbones(curves, recipe.target)
    part = "block" if recipe.level is None else "level"
    folds = inner_folds(curves, recipe)
    count = len(folds) if recipe.level is None else inner_level_count(curves, recipe)
    if count < FEWEST_FOLDS:
        backbone = FEW if FEW in names else None
        note = f"{count} inner training {part}(s) are too few to choose a backbone; "
        return BackboneChoice(backbone, f"{note}{backbone or 'none'} is used")
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
    """Return the names of all static formulas that can be the backbone. The inputs of such a
    formula are among the quantities of the curves, and the formula needs no dimension of the
    muscle. The first element of the result is None, for no backbone.
    """
    known = {name for name in curves[0].columns if name != target}
    usable = [
        formula.name
        for formula in map(literature.get, literature.names())
        if formula.component == "static"
        and not formula.dimensions
        and known.issuperset(formula.inputs)
    ]
    return None, *usable


def simplest_backbone(errors: Mapping[str | None, float]) -> str | None:
    """Return the name of the chosen backbone. Among all candidates whose error is within `MARGIN`
    of the smallest error, it has the fewest parameters. If several have the same number of
    parameters, return the candidate with the smallest error.
    """
    near = [name for name, error in errors.items() if error <= (1 + MARGIN) * min(errors.values())]

    def size(name: str | None) -> tuple[int, float]:
        return len(literature.get(name).parameters) if name else 0, errors[name]

    return min(near, key=size)


def thin(curve: Curve, along: str | None) -> Curve:
    """Return a curve with at most `SAMPLES` of the training samples, evenly spread in the order of
    the variable `along`. Held-out samples are removed.
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
