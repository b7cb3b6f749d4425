"""A model as data: what model.h5 holds and what predicts without any recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.fits import FormulaFit, Scaling
from mapmore_cli.domain.memory import MemoryModel
from mapmore_cli.domain.motion import Motion
from mapmore_cli.domain.recording import Quantity, Signal
from mapmore_cli.domain.words import Joining

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


@dataclass(frozen=True, kw_only=True)
class Fusion(Joining):
    """How the pieces are joined (M2 eq 9-12).

    `hold: samples` holds a segment function beyond its samples by more than `z_s` of their width, as far as transition zones reach there;
    `none` leaves it as it is (M2 eq 9-11 to the letter). `domain` are the limits of the whole training domain for every input that
    extrapolation acts on there (M2 eq 12 as printed); an input that it lacks has each curve's own limits.

    `shrink` is the share g of the pieces on a backbone that is carried to the middle between two levels: `g + (1 - g)(1 - 2t)^2` at the
    place t between them.
    """

    extrapolation: Mapping[str, tuple[Side, Side]]  # below and above, for every input
    aligned: str | None = None  # variable along which curves are aligned at their thresholds before they are interpolated
    shrink: float = 1.0
    domain: Mapping[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class FoldError:
    """Cross-validation error of one choice: RMSE pooled over all left-out training samples, in the target's unit."""

    choice: str  # backbone | backbone + residual | backbone + shrunken residual
    rmse: float
    folds: int


@dataclass(frozen=True)
class CurveRange:
    """Training range of every input within one training curve; `level` is the curve's, None without levels."""

    curve: str
    level: float | None
    limits: Mapping[str, tuple[float, float]]


class Body:
    """Base of what a model consists of, by its kind: `modelling.kinds` says what each kind can do."""


@dataclass(frozen=True)
class Pieces(Body):
    """MAPMORE: `output = backbone(inputs) + sum_i f_i(E(x)) prod_j w_ij(x_j)` (M2 eq 9).

    Attributes
    ----------
    level
        The input that is constant within a curve and interpolated between curves; None where all curves are pooled.
    variables
        Segmented variables.
    backbone
        Formula that the pieces are added to; None where they stand by themselves. Curves have no segments where the residual on it was
        dropped.
    cross_validation
        On what grounds the residual on a backbone was kept, shrunk or dropped; empty where nobody asked.
    """

    level: str | None
    variables: tuple[str, ...]
    curves: tuple[CurveFunction, ...]
    fusion: Fusion
    backbone: FormulaFit | None = None
    cross_validation: tuple[FoldError, ...] = ()

    @property
    def ranges(self) -> tuple[CurveRange, ...]:
        """Training range of every curve."""
        return tuple(CurveRange(curve.curve, curve.level, curve.limits) for curve in self.curves)

    @property
    def segments(self) -> tuple[SegmentFunction, ...]:
        """Every segment function, curve by curve."""
        return tuple(segment for curve in self.curves for segment in curve.segments)


@dataclass(frozen=True)
class Formula(Body):
    """A formula of the literature as the whole model; `level` and `ranges` say where it was trained."""

    fit: FormulaFit
    level: str | None
    ranges: tuple[CurveRange, ...]

    @property
    def backbone(self) -> FormulaFit:
        """The formula."""
        return self.fit


@dataclass(frozen=True)
class Memory(Body):
    """A model with memory, on a backbone or by itself.

    It takes a recording with its `time`, from the first measured outputs where those are fed back.
    """

    model: MemoryModel
    ranges: tuple[CurveRange, ...]
    backbone: FormulaFit | None = None

    @property
    def memories(self) -> tuple[MemoryModel, ...]:
        """The one part that has memory."""
        return (self.model,)


@dataclass(frozen=True)
class StateSpace(Body):
    """A model of motion: linear sections along an input (P). It takes a recording with its `time`, and begins at rest."""

    motion: Motion
    ranges: tuple[CurveRange, ...]


@dataclass(frozen=True)
class Part:
    """A model in a sum: its output counts with a `sign`, +1 or -1.

    `inputs` says where an input of the part has another name in the sum: an expression of the sum's inputs, as `p1` or `-strain`.
    """

    model: Model
    sign: float = 1.0
    inputs: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Sum(Body):
    """Models that are added up, as a static and a damping model (M2 section 3)."""

    parts: tuple[Part, ...]

    @property
    def memories(self) -> tuple[MemoryModel, ...]:
        """The summands that have memory."""
        return tuple(memory for part in self.parts for memory in part.model.memories)


LeftOutKind = Literal["levels", "recordings", "blocks", "specimens"]
"""What was left out of the training data in turn."""


@dataclass(frozen=True)
class LeftOut:
    """How models of the rest missed each part of the training data that was left out of them: what intervals are made of.

    Attributes
    ----------
    curves
        How many levels, recordings or blocks train.
    parts
        Names of the k that were left out: of levels, those between two others.
    samples
        Samples of each, (k,).
    offset, scatter
        Mean of measured minus predicted over each part, and standard deviation about it, (k,), in the unit of the output.
    sizes
        Quantiles of the absolute residuals of each part at q even shares from 0 to 1, (k, q).
    places, repeats
        The levels that train, ascending, and how many recordings have each, (K,); empty where there are none.
    largest, residual
        Largest |target| of the training data, and the root mean square residual of the model there, in the unit of the output.
    astray
        How far left-out predictions lie beyond the training data, as a share of their range.
    """

    kind: LeftOutKind
    curves: int
    parts: tuple[str, ...]
    samples: IntArray
    offset: Array
    scatter: Array
    sizes: Array
    places: tuple[float, ...] = ()
    repeats: tuple[int, ...] = ()
    largest: float = 0.0
    residual: float = 0.0
    astray: float = 0.0


@dataclass(frozen=True)
class Model:
    """A model that predicts without any other file: what all kinds have in common, and the `body` of one kind.

    `signals` are inputs that a record over time need not hold, each after those that it follows from. `left_out` is there where the spec
    asked for intervals.
    """

    name: str
    output: Quantity
    inputs: tuple[Quantity, ...]
    body: Body
    signals: tuple[Signal, ...] = ()
    notes: tuple[str, ...] = ()
    left_out: LeftOut | None = None

    @property
    def pieces(self) -> Pieces | None:
        """The body where it consists of pieces."""
        return self.body if isinstance(self.body, Pieces) else None

    @property
    def level(self) -> str | None:
        """The input that is constant within a training curve, where there is one."""
        return getattr(self.body, "level", None)

    @property
    def backbone(self) -> FormulaFit | None:
        """The formula that the model is built on, or that it is."""
        return getattr(self.body, "backbone", None)

    @property
    def memories(self) -> tuple[MemoryModel, ...]:
        """Every part that has memory: its own, and those of its summands."""
        return getattr(self.body, "memories", ())


@dataclass(frozen=True)
class Equation:
    """One piece of a model in physical units: `id` is a segment's or a formula's."""

    id: str
    text: str
    latex: str
