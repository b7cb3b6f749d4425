"""Use a formula of the literature as a backbone: MAPMORE is fitted to the residual of this formula.

The paper M1 suggests physics-based terms in its outlook. A model that consists of a known formula
and a few local corrections is easy to read.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from hashlib import sha256
from types import MappingProxyType

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling import literature


def pooled(parts: Sequence[tuple[Curve, BoolArray]]) -> dict[str, Array]:
    """Return each column as one array, which contains the chosen samples of all curves one after
    the other.
    """
    return {
        name: np.concatenate([curve.columns[name][rows] for curve, rows in parts])
        for name in parts[0][0].columns
    }


def pooled_training(curves: Sequence[Curve]) -> dict[str, Array]:
    """Return each column as one array, which contains the training samples of all curves one after
    the other.
    """
    return pooled([(curve, curve.training) for curve in curves])


def fit_formula(
    name: str,
    curves: Sequence[Curve],
    target: str,
    method: str | None = None,
    lengths: Mapping[str, float | None] = MappingProxyType({}),
    starts: str | None = None,
    near: Mapping[str, float] | None = None,
) -> FormulaFit:
    """Fit a formula to the training samples of all curves.

    `lengths` holds the muscle's `length` and `diameter` in m, for formulas that need them. `starts`
    is the name of published starting values. `near` holds parameter values at which the search of
    the default method begins.
    """
    columns = pooled_training(curves)
    key = _digest(columns, name, target, method, starts, near, *lengths.items())
    if key not in _FITTED:
        formula = literature.get(name).of_muscle(lengths)
        if starts is not None:
            formula = formula.starting_from(starts)
        formula = replace(formula, near=near)
        if len(_FITTED) == MOST_KEPT:
            _FITTED.pop(next(iter(_FITTED)))
        _FITTED[key] = formula.fit(columns, columns[target], method)
    return _FITTED[key]


MOST_KEPT = 512
_FITTED: dict[bytes, FormulaFit] = {}
"""Cache of fits by everything that determines them. The backbone, its selection, the models without
left-out data, and the competitors often need the same fit.
"""


def _digest(columns: Columns, *how: object) -> bytes:
    digest = sha256(repr(how).encode())
    for column, values in columns.items():
        digest.update(column.encode() + np.ascontiguousarray(values).tobytes())
    return digest.digest()


def residual_of(curve: Curve, target: str, backbone: FormulaFit | None) -> Curve:
    """Return the curve with the output of the backbone subtracted from its target. Without a
    backbone, the curve is unchanged.
    """
    if backbone is None:
        return curve
    rest = curve.columns[target] - literature.of(backbone).predict(
        backbone.parameters, curve.columns
    )
    return replace(curve, columns={**curve.columns, target: rest})
