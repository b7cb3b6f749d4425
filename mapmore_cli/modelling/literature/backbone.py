"""A formula of the literature as backbone, with MAPMORE explaining what it leaves.

M1's outlook asks for physics-based static terms: a known formula and a few local corrections keep the model readable.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling import literature


def pooled_training(curves: Sequence[Curve]) -> dict[str, np.ndarray]:
    """Columns of all training samples of all curves."""
    return {name: np.concatenate([c.columns[name][c.training] for c in curves]) for name in curves[0].columns}


def fit_formula(name: str, curves: Sequence[Curve], target: str, method: str | None = None) -> FormulaFit:
    """Fit a formula to the training samples of all curves."""
    columns = pooled_training(curves)
    return literature.get(name).fit(columns, columns[target], method)


def residual_of(curve: Curve, target: str, backbone: FormulaFit | None) -> Curve:
    """The curve with its target replaced by what the backbone leaves; unchanged without one."""
    if backbone is None:
        return curve
    rest = curve.columns[target] - literature.get(backbone.name).predict(backbone.parameters, curve.columns)
    return replace(curve, columns={**curve.columns, target: rest})
