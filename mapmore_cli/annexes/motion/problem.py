"""What a model of motion is to be like: the keys of `model: {type: state_space}`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, Literal, NamedTuple

import numpy as np
from annotated_types import Interval, Len

from mapmore_cli.annexes.motion.body import REST, poles
from mapmore_cli.annexes.motion.simulation import response, stable
from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.domain.declared import (
    Contradiction,
    Difference,
    Either,
    Pair,
    Seconds,
    Settings,
    of_sibling,
)

QUARTER = 0.25  # of the longest piece: the longest time constant that is looked for


@dataclass(frozen=True)
class Bounds(Settings):
    """Where the particles of `solver: swarm` begin.

    The default holds every stable section: there P1 lies in -1..1 and P2 in -2..2, and `|1 - P1 -
    P2| < 4`.

    - `p1`: P1, as `[-1, 1]`
    - `p2`: P2, as `[-2, 2]`
    - `p3`: P3; four times the spans' ratio, either sign, by default, as `[-4, 4]`
    """

    p1: Pair = (-1.0, 1.0)
    p2: Pair = (-2.0, 2.0)
    p3: Pair | None = None

    def __post_init__(self) -> None:
        """Refuse bounds in the wrong order."""
        for name in ("p1", "p2", "p3"):
            ends = getattr(self, name)
            if ends is not None and ends[0] >= ends[1]:
                raise Contradiction(
                    f"`{name}`: the lower bound {ends[0]:g} is above the upper bound {ends[1]:g}",
                    "put the lower bound first",
                    name,
                )


@dataclass(frozen=True, kw_only=True)
class MotionSettings(Settings):
    """The keys of a model of motion.

    - `input`: the quantity that drives, as `voltage`
    - `sections`: inner boundaries along the input, or how many sections with equal shares of the
      samples, as `4`
    - `direction`: whether rise and fall of the input have sections of their own, as `true`
    - `switching`: `hard` runs every section on the whole input, `carried` passes the state on,
      `bumpless` also joins the sections and turns after `dead_band`, as `bumpless`
    - `start`: where a run begins, as `zero`
    - `mask`: the quantity whose direction says which training samples are those of rise and of
      fall, as `displacement`
    - `dead_band`: how far the input turns back before its direction changes, as `0.05`
    - `offset`: whether a section has a constant of its own, as `true`
    - `load`: the quantity that P3 and the constant depend on, where there is one, as `load`
    - `solver`: how sections are fitted: `swarm` is the particle swarm as published, as `swarm`
    - `slowest`: longest time constant of a section; a quarter of the longest training piece by
      default, which cannot tell a slower one from a drift, as `5 s`
    - `begin`: where the particles of the swarm begin; everywhere by default, as `{p1: [-1, 1]}`
    - `seed`: of the swarm's random numbers, of which every section draws its own, as `2`
    """

    input: str | None = None
    sections: Annotated[
        Annotated[Sequence[Annotated[float, of_sibling("input")]], Len(1)]
        | Annotated[int, Interval(ge=1)],
        Either(),
    ] = 1
    direction: bool = False
    switching: Literal["hard", "carried", "bumpless"] = "hard"
    start: Literal["rest", "zero"] = "rest"
    mask: Literal["input", "displacement"] = "input"
    dead_band: Annotated[float, Interval(ge=0), of_sibling("input", Difference)] = 0.0
    offset: bool = False
    load: str | None = None
    solver: Literal["least_squares", "swarm"] = "least_squares"
    slowest: Seconds | None = None
    begin: Bounds | None = None
    seed: Annotated[int, Interval(ge=0)] = 1


@dataclass(frozen=True, kw_only=True)
class MotionRecipe(MotionSettings):
    """The settings of one fit: the input is known, the `output` and the `step` between samples (s)
    are those of the records.
    """

    input: str
    output: str
    step: float

    def reach(self, longest: int) -> float:
        """Return the largest modulus of a pole, `exp(-step/slowest)`, where the longest piece has
        so many samples.
        """
        return math.exp(
            -self.step / (QUARTER * longest * self.step if self.slowest is None else self.slowest)
        )

    @property
    def drives(self) -> tuple[str, ...]:
        """Terms that drive every section, the input first. Sections that share a state need a
        constant each to meet at their boundaries.
        """
        constant = self.offset or self.switching == "bumpless"
        on_load = () if self.load is None else (self.load, f"{self.input}*{self.load}")
        return (self.input, *(("1",) if constant or on_load else ()), *on_load)


PENALTY = 1e3
"""Error of an unstable section, in root mean squares of the output, times the modulus of its pole:
it is worse than any stable one.
"""


@dataclass(frozen=True)
class Piece:
    """One piece of a record: drives (n, m), the input first, output (n,), the samples that count
    (n,), and the section that holds, (n,).
    """

    drives: Array
    y: Array
    counts: BoolArray
    holds: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))


class Found(NamedTuple):
    """Parameters of one section, their RMSE, how many simulations they took, and the lowest RMSE
    after each iteration.
    """

    p1: float
    p2: float
    weights: Array
    rmse: float
    evaluations: int
    history: Array


class Problem:
    """Error of the parameters of one section, which is simulated with the whole input of every
    piece; only its own samples count.

    - `reach`: largest modulus of a pole that is looked for.
    """

    def __init__(
        self,
        pieces: Sequence[Piece],
        reach: float = 1.0,
        start: str = REST,
        seed: Sequence[int] = (1,),
    ) -> None:
        self.start, self.reach = start, reach
        self.random = np.random.default_rng(seed)
        self.pieces = tuple(piece for piece in pieces if piece.counts.any())
        # a slice copies nothing
        self.own = [slice(None) if piece.counts.all() else piece.counts for piece in self.pieces]
        self.y = np.concatenate([piece.y[piece.counts] for piece in self.pieces])
        self.size = float(np.sqrt(np.mean(self.y**2))) or 1.0
        self.evaluations = 0

    def responses(self, p1: float, p2: float) -> Array:
        """Return outputs (n, m) at the own samples, of a section that each of the m drives alone
        moves with weight one.
        """
        self.evaluations += 1
        return np.concatenate(
            [
                response(p1, p2, piece.drives, self.start)[rows]
                for piece, rows in zip(self.pieces, self.own, strict=True)
            ]
        )

    def rmse(self, p1: float, p2: float, weights: Array | None = None) -> float:
        """Return the root mean squared error with these weights, or the best; large and finite for
        unstable sections, or those beyond the reach.
        """
        if not stable(p1, p2, self.reach if weights is None else 1.0):
            return PENALTY * self.size * max(abs(poles(p1, p2)[0]), 1.0)
        return _root_mean_square(
            self.projected(p1, p2)[1]
            if weights is None
            else _weighted(self.responses(p1, p2), weights) - self.y
        )

    def projected(self, p1: float, p2: float) -> tuple[Array, Array]:
        """Return the best weights (m,) for the poles, by linear least squares, and the residuals
        (n,) that they leave.
        """
        moved = self.responses(p1, p2)
        if moved.shape[1] == 1:
            column = moved[:, 0]
            square = float(column @ column)
            weights = np.array([float(column @ self.y) / square if square > 0 else 0.0])
        else:
            weights = np.linalg.lstsq(moved, self.y, rcond=None)[0]
        return weights, _weighted(moved, weights) - self.y

    def found(self, p1: float, p2: float, history: Sequence[float] | Array) -> Found:
        """Return what a search has come to, with the best weights for its poles; `history` are its
        errors in turn.
        """
        weights, residuals = self.projected(p1, p2)
        rmse, lowest = _root_mean_square(residuals), np.minimum.accumulate(history)
        return Found(p1, p2, weights, rmse, self.evaluations, lowest)


def _weighted(moved: Array, weights: Array) -> Array:
    """Return `moved @ weights`; the plain product is slow for a single column."""
    return moved[:, 0] * weights[0] if len(weights) == 1 else moved @ weights


def _root_mean_square(residuals: Array) -> float:
    return float(np.sqrt(residuals @ residuals / len(residuals)))
