"""The error of one section over its own samples (P eq 13, with the square that it lacks)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.motion import REST
from mapmore_cli.modelling.motion.plane import radius, stable
from mapmore_cli.modelling.motion.simulation import response

PENALTY = 1e3
"""Error of an unstable section, in root mean squares of the output, times the modulus of its pole: it is worse than any stable one."""


@dataclass(frozen=True)
class Piece:
    """One piece of a record: drives (n, m), the input first, output (n,), and the samples that count, (n,)."""

    drives: Array
    y: Array
    counts: BoolArray


@dataclass(frozen=True)
class Found:
    """Parameters of one section, their RMSE, how many simulations they took, and the lowest RMSE after each iteration."""

    p1: float
    p2: float
    weights: Array
    rmse: float
    evaluations: int
    history: Array


class Problem:
    """Error of one section's parameters: it runs on the whole input of every piece, its own samples count."""

    def __init__(self, pieces: Sequence[Piece], reach: float = 1.0, start: str = REST, seed: Sequence[int] = (1,)) -> None:
        self.start = start
        self.random = np.random.default_rng(seed)
        self.reach = reach  # largest modulus of a pole that is looked for
        self.pieces = tuple(piece for piece in pieces if piece.counts.any())
        self.own = [slice(None) if piece.counts.all() else piece.counts for piece in self.pieces]  # a slice copies nothing
        self.y = np.concatenate([piece.y[piece.counts] for piece in self.pieces])
        self.size = float(np.sqrt(np.mean(self.y**2))) or 1.0
        self.evaluations = 0

    @property
    def drives(self) -> int:
        """Number of drives, m."""
        return int(self.pieces[0].drives.shape[1])

    def responses(self, p1: float, p2: float) -> Array:
        """Outputs (n, m) at the own samples, of a section that each drive alone moves with weight one."""
        self.evaluations += 1
        return np.concatenate([response(p1, p2, piece.drives, self.start)[own] for piece, own in zip(self.pieces, self.own, strict=True)])

    def rmse(self, p1: float, p2: float, weights: Array) -> float:
        """Root mean squared error; large and finite for unstable sections."""
        if not stable(p1, p2):
            return PENALTY * self.size * max(radius(p1, p2), 1.0)
        return _root_mean_square(_weighted(self.responses(p1, p2), weights) - self.y)

    def projected(self, p1: float, p2: float) -> tuple[Array, Array]:
        """The best weights (m,) for the poles, by linear least squares, and the residuals (n,) that they leave."""
        moved = self.responses(p1, p2)
        if moved.shape[1] == 1:
            column = moved[:, 0]
            square = float(column @ column)
            weights = np.array([float(column @ self.y) / square if square > 0 else 0.0])
        else:
            weights = np.linalg.lstsq(moved, self.y, rcond=None)[0]
        return weights, _weighted(moved, weights) - self.y

    def projected_rmse(self, p1: float, p2: float) -> float:
        """Root mean squared error with the best weights; large and finite for sections beyond the reach."""
        if not stable(p1, p2, self.reach):
            return PENALTY * self.size * max(radius(p1, p2), 1.0)
        return _root_mean_square(self.projected(p1, p2)[1])

    def found(self, p1: float, p2: float, history: Sequence[float]) -> Found:
        """What a search has come to, with the best weights for its poles."""
        weights, residuals = self.projected(p1, p2)
        return Found(p1, p2, weights, _root_mean_square(residuals), self.evaluations, np.asarray(history, dtype=np.float64))


def _weighted(moved: Array, weights: Array) -> Array:
    """`moved @ weights`, which is slow for a single column."""
    return moved[:, 0] * weights[0] if len(weights) == 1 else moved @ weights


def _root_mean_square(residuals: Array) -> float:
    return float(np.sqrt(residuals @ residuals / len(residuals)))
