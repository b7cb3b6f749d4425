"""Define the settings of a model of motion, which are the keys of `model: {type: state_space}`, and
the error that its solvers minimise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

import numpy as np
from annotated_types import Interval, Len

from mapmore_cli.annexes.motion.body import REST, poles
from mapmore_cli.annexes.motion.simulation import response, stable
from mapmore_cli.domain.arrays import Array, BoolArray, IntArray, root_mean_square
from mapmore_cli.domain.declared import (
    Contradiction,
    Difference,
    Either,
    Pair,
    Seconds,
    Settings,
    of_sibling,
)

QUARTER = 0.25  # longest time constant that is searched, as a fraction of the longest piece


@dataclass(frozen=True)
class Bounds(Settings):
    """Ranges in which the particles of `solver: swarm` begin.

    In the equation of a section, P1 is the factor of the output two samples before, P2 is the
    factor of the output one sample before, and P3 is the factor of the input. By default, these
    ranges contain every stable section, for which P1 is in -1..1, P2 in -2..2, and `|1 - P1 - P2| <
    4`.

    - `p1`: Range of P1. Example: `[-1, 1]`
    - `p2`: Range of P2. Example: `[-2, 2]`
    - `p3`: Range of P3; by default, four times the ratio of the spans of output and input, with
      either sign. Example: `[-4, 4]`
    """

    p1: Pair = (-1.0, 1.0)
    p2: Pair = (-2.0, 2.0)
    p3: Pair | None = None

    def __post_init__(self) -> None:
        """Refuse bounds whose lower end is not below the upper end."""
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
    """Settings of a model of motion.

    - `input`: The quantity that drives the motion. Example: `voltage`
    - `sections`: Inner boundaries along the input, or the number of sections with equal numbers of
      samples. Example: `4`
    - `direction`: If true, rising and falling input have separate sections. Example: `true`
    - `switching`: How the model changes between sections. `hard` runs every section along the whole
      input and takes the output of the active one. `carried` passes the state on. `bumpless` also
      joins the sections so that the steady output does not jump, and changes direction after
      `dead_band`. Example: `bumpless`
    - `start`: Start of a run: at rest under the first input, or at zero. Example: `zero`
    - `mask`: With `direction: true`, the quantity whose direction divides the training samples into
      rise and fall. Example: `displacement`
    - `dead_band`: How far the input must turn back before its direction changes. It needs
      `direction: true` and `switching: bumpless`. Example: `0.05`
    - `offset`: If true, every section has its own constant. Example: `true`
    - `load`: A quantity on which the constant of a section and its factor of the input (P3) depend.
      Example: `load`
    - `solver`: How sections are fitted: by `least_squares`, or by the particle swarm of the paper
      (`swarm`). The swarm cannot find an `offset`, a `load` or `bumpless` switching. Example:
      `swarm`
    - `slowest`: Longest time constant of a section. By default, it is a quarter of the longest
      piece of training data, so that this piece is four time constants long and shows almost the
      whole change. Of a slower change, the piece does not show whether it ends (a time constant) or
      goes on (a drift). Example: `5 s`
    - `begin`: Ranges in which the particles of `solver: swarm` begin; by default, all stable
      sections. Example: `{p1: [-1, 1]}`
    - `seed`: Seed of the random numbers of `solver: swarm`; every section has its own numbers.
      Example: `2`
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
    """Settings of one fit, in which `input` is never None. The name of the `output` and the time
    `step` between samples, s, are taken from the dataset.
    """

    input: str
    output: str
    step: float

    def reach(self, longest: int) -> float:
        """Return the largest modulus of a pole that is searched, `exp(-step/slowest)`. `longest` is
        the number of samples of the longest piece.
        """
        return math.exp(
            -self.step / (QUARTER * longest * self.step if self.slowest is None else self.slowest)
        )

    @property
    def drives(self) -> tuple[str, ...]:
        """Terms that drive every section, the input first. If sections are joined (`bumpless`),
        each section needs a constant term, because otherwise their steady outputs could not be
        equal at the boundaries.
        """
        constant = self.offset or self.switching == "bumpless"
        on_load = () if self.load is None else (self.load, f"{self.input}*{self.load}")
        return (self.input, *(("1",) if constant or on_load else ()), *on_load)


PENALTY = 1e3
"""Error that is assigned to an unstable section, as a multiple of the root mean square of the
output. It is also multiplied by the modulus of the section's pole, and is larger than the error of
any stable section.
"""


@dataclass(frozen=True)
class Piece:
    """One piece of a recording with n samples.

    - `drives`: values of the m terms that drive a section, (n, m), with the input first.
    - `y`: measured output, (n,).
    - `counts`: True for the samples at which the error is computed, (n,).
    - `holds`: index of the active section, (n,).
    """

    drives: Array
    y: Array
    counts: BoolArray
    holds: IntArray


class Found(NamedTuple):
    """Parameters of one section, their RMSE, the number of simulations, and the smallest RMSE after
    each step of the search: an evaluation of the error by the solver `least_squares`, or the start
    and each iteration of `swarm`.
    """

    p1: float
    p2: float
    weights: Array
    rmse: float
    evaluations: int
    history: Array


class Problem:
    """Error of one section as a function of its parameters. The section is simulated with the whole
    input of every piece, but the error is computed only from the samples at which it is active.

    - `reach`: largest modulus of a pole that is searched.
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
        self.y = np.concatenate([piece.y[piece.counts] for piece in self.pieces])
        self.size = root_mean_square(self.y) or 1.0
        self.evaluations = 0

    def responses(self, p1: float, p2: float) -> Array:
        """Return the response of the section to each of its m drives, at the n samples at which it
        is active, (n, m). For column j, drive j has the weight one, and all other drives have the
        weight zero.
        """
        self.evaluations += 1
        return np.concatenate(
            [response(p1, p2, piece.drives, self.start)[piece.counts] for piece in self.pieces]
        )

    def rmse(self, p1: float, p2: float, weights: Array | None = None) -> float:
        """Return the root mean squared error with the given `weights`. If `weights` is None, return
        the error with the weights that minimise it.

        For an unstable section, return a large finite number. If `weights` is None, do the same for
        a section with a pole whose modulus is larger than `reach`.
        """
        if not stable(p1, p2, self.reach if weights is None else 1.0):
            return PENALTY * self.size * max(abs(poles(p1, p2)[0]), 1.0)
        return root_mean_square(
            self.projected(p1, p2)[1]
            if weights is None
            else _weighted(self.responses(p1, p2), weights) - self.y
        )

    def projected(self, p1: float, p2: float) -> tuple[Array, Array]:
        """Return the weights, (m,), that minimise the squared error for given P1 and P2, and the
        residuals with these weights, (n,). They are computed by linear least squares.
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
        """Return the result of a search that ended at P1 and P2, with the weights that minimise the
        error for them. `history` holds the errors that the search computed, in their order; the
        result contains the smallest error up to each of them.
        """
        weights, residuals = self.projected(p1, p2)
        rmse, lowest = root_mean_square(residuals), np.minimum.accumulate(history)
        return Found(p1, p2, weights, rmse, self.evaluations, lowest)


def _weighted(moved: Array, weights: Array) -> Array:
    """Return `moved @ weights`. A single column is multiplied by a number instead, because the
    matrix product is slow for it.
    """
    return moved[:, 0] * weights[0] if len(weights) == 1 else moved @ weights
