"""A fused model as data: what model.h5 holds and what predicts without any recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.fits import FormulaFit, Scaling
from mapmore_cli.domain.memory import MemoryModel
from mapmore_cli.domain.recording import Quantity

Side = str | float
"""Behaviour beyond one limit: `continue`, `continue_linear`, `saturate`, `zero`, or a value (M2 eq 12)."""


@dataclass(frozen=True)
class SegmentFunction:
    """`f(x) = y_slope sum_k theta_k D_k(slope x + intercept) + y_intercept` (M2 eq 8).

    `theta`, its standard errors, `g` and `err` are `(k,)` in the order of selection, in scaled coordinates. `limits` is the range of its
    samples along every segmented variable.
    """

    id: str
    cell: tuple[int, ...]
    terms: tuple[str, ...]
    theta: Array
    theta_error: Array
    g: Array
    err: Array
    scaling: Scaling
    samples: int
    condition: float
    stop: str
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class CurveFunction:
    """The fused segment functions of one training curve."""

    curve: str
    level: float | None
    boundaries: tuple[Array, ...]  # one for each of the model's segmented variables
    limits: Mapping[str, tuple[float, float]]
    segments: tuple[SegmentFunction, ...]
    threshold: float | None = None  # along the aligned variable, where there is one


@dataclass(frozen=True)
class Fusion:
    """How the pieces are joined (M2 eq 9-12).

    `shrink` is the share g of the pieces on a backbone that is carried to the middle between two levels: `g + (1 - g)(1 - 2t)^2` at the
    place t between them.
    """

    transition: str  # linear | quadratic | cubic
    z_s: float
    extrapolation: Mapping[str, tuple[Side, Side]]  # below and above, for every input
    levels: str = "linear"  # linear | pchip
    aligned: str | None = None  # variable along which curves are aligned at their thresholds before they are interpolated
    shrink: float = 1.0


@dataclass(frozen=True)
class Signal:
    """An input that follows from another one over time: a `rate`, or the `direction` of motion that a rate tells.

    A rate is `factor` times the derivative by the time in seconds, over a `window` in seconds by polynomials of `order`, where the time
    comes in units of so many `seconds`; the direction has a `dead_band` in the unit of the rate. Numbers that a kind does not have are 0.
    """

    name: str
    kind: str  # rate | direction
    of: str
    window: float = 0.0
    order: int = 0
    factor: float = 1.0
    seconds: float = 1.0
    dead_band: float = 0.0


@dataclass(frozen=True)
class FoldError:
    """Cross-validation error of one choice: RMSE pooled over all left-out training samples, in the target's unit."""

    choice: str  # backbone | backbone + residual | backbone + shrunken residual
    rmse: float
    folds: int


@dataclass(frozen=True)
class Model:
    """A model `output = backbone(inputs) + sum_i f_i(E(x)) prod_j w_ij(x_j)` (M2 eq 9).

    Where the model is a formula alone, its curves have no segments but still say the training range; `backbone` is None where MAPMORE
    stands by itself. `cross_validation` says on what grounds the residual on a backbone was kept, shrunk or dropped; it is empty where
    nobody asked. `signals` are inputs that a record over time need not hold, each after those that it follows from. A dynamic model is the
    sum of its `summands`, a static and a damping model (M2 section 3), and has no pieces of its own. A model with `memory` has none
    either: it takes a recording with its `time`, from the first measured outputs where those are fed back.
    """

    name: str
    output: Quantity
    inputs: tuple[Quantity, ...]
    level: str | None
    variables: tuple[str, ...]  # segmented variables
    curves: tuple[CurveFunction, ...]
    fusion: Fusion
    backbone: FormulaFit | None = None
    cross_validation: tuple[FoldError, ...] = ()
    notes: tuple[str, ...] = ()
    signals: tuple[Signal, ...] = ()
    summands: tuple[Model, ...] = ()
    memory: MemoryModel | None = None

    @property
    def memories(self) -> tuple[MemoryModel, ...]:
        """Every part that has memory: its own, and those of its summands."""
        own = () if self.memory is None else (self.memory,)
        return (*own, *(memory for summand in self.summands for memory in summand.memories))


@dataclass(frozen=True)
class Equation:
    """One piece of a model in physical units: `id` is a segment's or a formula's."""

    id: str
    text: str
    latex: str
