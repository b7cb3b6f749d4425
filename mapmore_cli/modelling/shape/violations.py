"""Where, and by how much, a model does not have a shape."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.program.model import program_of
from mapmore_cli.modelling.selection import Word
from mapmore_cli.modelling.shape.region import Region, grid_of
from mapmore_cli.modelling.shape.stencils import POINTS, Along, Asked

IMPLIED: Mapping[str, Mapping[str, Word]] = MappingProxyType(
    {
        kind: MappingProxyType({"pressure": "increasing", "strain": "decreasing"})
        for kind in ("mckibben", "peano")
    }
)
"""What the force of a kind of muscle does along its inputs, as `muscle.kind` names it."""

NODES = 2500
"""Nodes of the grid on which a model is looked at."""


@dataclass(frozen=True)
class Violation:
    """By how much the output falls where it must not, without a break along a grid line (`convex`:
    by how much it misses a chord), and where that is worst; 0 where it nowhere does.

    `share` is the part of the region where it does.
    """

    asked: Asked
    amount: float
    place: Mapping[str, float]
    share: float


def violations(
    model: Model, asked: Sequence[Asked], region: Region, nodes: int = NODES
) -> list[Violation]:
    """Return what the model does against each word, on a grid over the region."""
    grid = grid_of(region, program_of(model).knots, nodes)
    values, inside = predict(model, grid.columns), region.holds(grid.columns)
    return [_violation(grid.along(one, values, inside)) for one in asked]


def _violation(along: Along) -> Violation:
    asked, wrong = along.stencils.asked, along.rises < 0
    if not wrong.any():
        return Violation(asked, 0.0, {}, 0.0)
    fall = along.falls if POINTS[asked.word] == 2 else -along.rises
    worst = int(np.argmax(fall))
    place = {name: float(x[worst].mean()) for name, x in along.stencils.points.items()}
    return Violation(asked, float(fall[worst]), place, float(wrong.mean()))
