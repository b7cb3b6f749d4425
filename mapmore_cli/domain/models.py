"""A model as data: what model.h5 holds and what predicts without any recording."""

from __future__ import annotations

import cmath
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

from mapmore_cli.domain.arrays import ASCENDING, Array, IntArray, Number, Numbers, Ranges, Span
from mapmore_cli.domain.declared import (
    Beyond,
    Count,
    Joining,
    Label,
    QuantityName,
    TermName,
    one_of,
)
from mapmore_cli.domain.fits import Boundaries, FormulaFit, MemoryModel, Scaling, Step
from mapmore_cli.domain.recording import Quantity, Signal

Side = Beyond | Number
"""Behaviour beyond one limit: `continue`, `continue_linear`, `saturate`, `zero`, or a value (M2 eq
12).
"""


@dataclass(frozen=True)
class SegmentFunction:
    """`f(x) = y_slope sum_k theta_k D_k(slope x + intercept) + y_intercept` (M2 eq 8)."""

    id: Annotated[Label, "identifier of the segment"]
    cell: Annotated[tuple[int, ...], "place along each segmented variable, from 1", "-"]
    terms: Annotated[tuple[TermName, ...], "(k) names of the terms D_k, in the order of selection"]
    theta: Annotated[Numbers, "(k) coefficients of the terms, in scaled coordinates"]
    theta_error: Annotated[Array, "(k) standard errors of theta; NaN without a degree of freedom"]
    g: Annotated[Array, "(k) coefficients of the orthogonalised regressors"]
    err: Annotated[Array, "(k) error reduction ratios"]
    scaling: Annotated[Scaling, "scaling of the segment"]
    samples: Annotated[Count, "samples fitted to"]
    condition: Annotated[float, "2-norm condition number of the chosen regressors"]
    stop: Annotated[Label, "why selection stopped"]
    limits: Annotated[
        Ranges, "least and greatest training value of each segmented variable in the segment", "[*]"
    ] = field(default_factory=dict)


@dataclass(frozen=True)
class CurveFunction:
    """The fused segment functions of one training curve."""

    curve: Annotated[Label, "identifier of the curve"]
    level: Annotated[Number | None, "value of the level quantity", "[level]"]
    boundaries: Annotated[
        tuple[Boundaries, ...],
        "(p) segment locations of each segmented variable, both ends included",
        "[variables.*]",
    ]
    limits: Annotated[Ranges, "least and greatest training value of each input", "[*]"]
    segments: Annotated[tuple[SegmentFunction, ...], "segment functions"]


@dataclass(frozen=True, kw_only=True)
class Fusion(Joining):
    """How the pieces are joined (M2 eq 9-12).

    `hold: samples` holds a segment function beyond its samples by more than `z_s` of their width,
    as far as transition zones reach there; `none` leaves it as it is (M2 eq 9-11 to the letter).

    `shrink` is the share g of the pieces on a backbone that is carried to the middle between two
    levels: `g + (1 - g)(1 - 2t)^2` at the place t between them.
    """

    extrapolation: Annotated[
        Mapping[QuantityName, tuple[Side, Side]],
        "behaviour below and above the limits of each input: a word, or the value it takes",
    ]
    shrink: Annotated[
        Number, "share of the pieces on a backbone that is carried to the middle between two levels"
    ] = 1.0


@dataclass(frozen=True)
class FoldError:
    """Cross-validation error of one choice.

    `choice` is `backbone`, `backbone + residual` or `backbone + shrunken residual`.
    """

    choice: Annotated[Label, "what was cross-validated"]
    rmse: Annotated[float, "pooled error of all left-out samples", "[target]"]
    folds: Annotated[Count, "number of folds"]


@dataclass(frozen=True)
class CurveRange:
    """Training range of every input within one training curve."""

    curve: Annotated[Label, "identifier of the curve"]
    level: Annotated[Number | None, "value of the level quantity", "[level]"]
    limits: Annotated[Ranges, "least and greatest training value of each input", "[*]"]


class Body:
    """Base of what a model consists of, by its kind: `modelling.kinds` says what each kind can
    do.
    """


@dataclass(frozen=True, eq=False)  # equal to itself alone: arrays have no hash
class Pieces(Body):
    """MAPMORE: `output = backbone + sum_i f_i prod_j w_ij` (M2 eq 9).

    `level` is None where all curves are pooled. Curves have no segments where the residual on the
    backbone was dropped.
    """

    level: Annotated[QuantityName | None, "the input that is constant within a curve"]
    variables: Annotated[tuple[QuantityName, ...], "(p) segmented variables"]
    curves: Annotated[tuple[CurveFunction, ...], "training curves"]
    fusion: Annotated[Fusion, "how the pieces are joined"]
    backbone: Annotated[FormulaFit | None, "formula that the pieces are added to"] = None
    cross_validation: Annotated[
        tuple[FoldError, ...], "errors that decided for or against the pieces on the backbone"
    ] = ()

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
    """A formula of the literature as the whole model."""

    fit: Annotated[FormulaFit, "the fitted formula"]
    level: Annotated[QuantityName | None, "the input that is constant within a training curve"]
    ranges: Annotated[tuple[CurveRange, ...], "training range of each curve"]

    @property
    def backbone(self) -> FormulaFit:
        """The formula."""
        return self.fit


@dataclass(frozen=True)
class Memory(Body):
    """A model with memory, on a backbone or by itself.

    It takes a recording with its `time`, from the first measured outputs where those are fed back.
    """

    model: Annotated[MemoryModel, "states, terms and coefficients"]
    ranges: Annotated[tuple[CurveRange, ...], "training range of each curve"]
    backbone: Annotated[FormulaFit | None, "formula that it is added to"] = None

    @property
    def memories(self) -> tuple[MemoryModel, ...]:
        """The one part that has memory."""
        return (self.model,)


# Models of motion (P)
# --------------------------------------------------------------------------------------------------

HARD, CARRIED, BUMPLESS = "hard", "carried", "bumpless"
"""How a model changes from section to section."""

REST, ZERO = "rest", "zero"
"""Where a run begins: in the steady state of its first input, or at an output of zero."""

ALL, RISE, FALL = "all", "rise", "fall"
"""Directions of the input in which a section holds."""


@dataclass(frozen=True)
class MotionSection:
    """A linear section: `x1[k+1] = x2[k]`, `x2[k+1] = P1 x1[k] + P2 x2[k] + sum_m w_m d_m[k]`,
    output x1 (P eq 10, in discrete time).

    `x2` is the output one sample ahead. The drives d are the model's; the first is the input, so
    that `w_1` is P3.
    """

    id: Annotated[Label, "identifier of the section, as `2` or `rise 2`"]
    place: Annotated[int, "place along the input, from 1", "-"]
    direction: Annotated[
        str,
        "direction of the input in which it holds: `all`, `rise` or `fall`",
        one_of(ALL, RISE, FALL),
    ]
    p1: Annotated[Number, "P1"]
    p2: Annotated[Number, "P2"]
    weights: Annotated[
        Numbers, "(m) weights of the drives; the first is P3", "[target] over the unit of the drive"
    ]

    @property
    def p3(self) -> float:
        """Weight of the input."""
        return float(self.weights[0])

    @property
    def poles(self) -> tuple[complex, complex]:
        """Roots of `z^2 - P2 z - P1`, the larger modulus first."""
        half, root = 0.5 * self.p2, cmath.sqrt(0.25 * self.p2**2 + self.p1)
        first, second = half + root, half - root
        return (first, second) if abs(first) >= abs(second) else (second, first)

    @property
    def radius(self) -> float:
        """Largest modulus of a pole; the section is stable below 1."""
        return abs(self.poles[0])

    @property
    def gain(self) -> float:
        """Steady output for one unit of the input, `P3/(1 - P1 - P2)`."""
        return self.p3 / (1.0 - self.p1 - self.p2)


@dataclass(frozen=True)
class Motion:
    """Sections along an input (P eq 14-17).

    With `hard` switching every section runs on the whole input and the active one's output is
    taken; `bumpless` sections are `carried` ones whose steady outputs meet at their boundaries.
    Without bumpless switching `dead_band` is 0: the input then falls unless it rises.
    """

    input: Annotated[QuantityName, "the input"]
    output: Annotated[QuantityName, "the predicted quantity"]
    step: Annotated[Step, "time between samples", "s"]
    switching: Annotated[
        str,
        "`hard`: sections run side by side; `carried`, `bumpless`: they share one state",
        one_of(HARD, CARRIED, BUMPLESS),
    ]
    boundaries: Annotated[
        tuple[Number, ...],
        "inputs at which sections meet, ascending",
        "that of the input",
        ASCENDING,
    ]
    directed: Annotated[bool, "1 where sections differ between a rising and a falling input"]
    dead_band: Annotated[
        Number, "how far the input turns back before its direction changes", "that of the input"
    ]
    drives: Annotated[tuple[TermName, ...], "(m) terms that drive every section, the input first"]
    sections: Annotated[tuple[MotionSection, ...], "in order along the input, `rise` before `fall`"]
    limits: Annotated[Span, "least and greatest training input", "that of the input"]
    start: Annotated[
        str, "a run begins at `rest` under its first input, or at `zero`", one_of(REST, ZERO)
    ] = REST


@dataclass(frozen=True)
class SectionSearch:
    """How the parameters of one section were found."""

    section: Annotated[Label, "identifier of the section"]
    samples: Annotated[Count, "training samples at which it holds"]
    rmse: Annotated[float, "error over these, before sections were joined", "[target]"]
    evaluations: Annotated[Count, "simulations that it took"]
    history: Annotated[Array, "lowest error so far, from the start on", "[target]"]


@dataclass(frozen=True)
class MotionFit:
    """A model of motion, and how each of its sections was found."""

    model: Annotated[Motion, "the model"]
    solver: Annotated[Label, "name of the solver"]
    searches: Annotated[
        tuple[SectionSearch, ...], "the search of each section, in the order of sections"
    ]
    notes: Annotated[tuple[str, ...], "remarks for the reader"] = ()


@dataclass(frozen=True)
class StateSpace(Body):
    """A model of motion: linear sections along an input (P)."""

    motion: Annotated[Motion, "the sections"]
    ranges: Annotated[tuple[CurveRange, ...], "training range of each curve"]


# Sums and the whole
# --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Part:
    """A model in a sum.

    An input may be the output of another model, as the pressure behind a valve: that of a part in
    `fed`, by its name.
    """

    model: Annotated[Model, "the model"]
    sign: Annotated[Number, "+1 or -1: how its output counts"] = 1.0
    inputs: Annotated[
        Mapping[QuantityName, TermName],
        "its inputs that have another name in the sum, as expressions of the sum's inputs",
    ] = field(default_factory=dict)
    fed: Annotated[tuple[Part, ...], "models whose outputs are inputs of this one"] = ()

    @property
    def models(self) -> tuple[Model, ...]:
        """The model, and those that feed it."""
        return (self.model, *(model for part in self.fed for model in part.models))


@dataclass(frozen=True)
class Sum(Body):
    """Models that are added up."""

    parts: Annotated[tuple[Part, ...], "the summands, with their signs and inputs"]

    @property
    def memories(self) -> tuple[MemoryModel, ...]:
        """The summands that have memory, and what feeds them."""
        return tuple(
            memory for part in self.parts for model in part.models for memory in model.memories
        )


LeftOutKind = Literal["levels", "recordings", "blocks", "specimens"]
"""What was left out of the training data in turn."""


@dataclass(frozen=True)
class LeftOut:
    """How models of the rest missed each part of the training data that was left out of them: what
    intervals are made of.

    Of levels, those between two others are left out.
    """

    kind: Annotated[
        LeftOutKind, "`levels`, `recordings`, `blocks` or `specimens`: what was left out in turn"
    ]
    curves: Annotated[Count, "levels, recordings or blocks that train"]
    parts: Annotated[tuple[Label, ...], "(parts) names of the parts"]
    samples: Annotated[IntArray, "(parts) samples of each"]
    offset: Annotated[Numbers, "(parts) mean of measured minus predicted over each", "[target]"]
    scatter: Annotated[Numbers, "(parts) standard deviation about the offset", "[target]"]
    sizes: Annotated[
        Numbers,
        "(parts, shares) quantiles of the absolute residuals of each at even shares from 0 to 1",
        "[target]",
    ]
    places: Annotated[
        tuple[Number, ...], "(levels) levels that train", "that of the level", ASCENDING
    ] = ()
    repeats: Annotated[tuple[Count, ...], "(levels) recordings at each"] = ()
    largest: Annotated[Number, "largest absolute training target", "[target]"] = 0.0
    residual: Annotated[Number, "root mean square training residual", "[target]"] = 0.0
    astray: Annotated[
        Number,
        "how far left-out predictions lie beyond the training target, as a share of its range",
    ] = 0.0


@dataclass(frozen=True)
class Model:
    """A model that predicts without any other file: what all kinds have in common, and the body of
    one kind.
    """

    name: Annotated[Label, "name of the run"]
    output: Annotated[Quantity, "predicted quantity"]
    inputs: Annotated[tuple[Quantity, ...], "quantities that the model needs"]
    body: Annotated[Body, "what the model consists of"]
    signals: Annotated[
        tuple[Signal, ...], "inputs that follow from others over time, each after those"
    ] = ()
    notes: Annotated[tuple[str, ...], "remarks for the reader"] = ()
    left_out: Annotated[
        LeftOut | None, "what intervals are made of, where the spec asked for them"
    ] = None

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
