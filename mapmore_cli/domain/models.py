"""Define models as data. These dataclasses are the contents of model.h5. They contain everything
that a prediction needs, so that no recording has to be read.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Literal, TypeVar

from mapmore_cli.domain.arrays import ASCENDING, IntArray, Number, Numbers, Ranges
from mapmore_cli.domain.declared import Count, Label, Notes, QuantityName, TermName, Word
from mapmore_cli.domain.fits import (
    LOWER_BOUND,
    ChosenTerms,
    CutCurve,
    ErrorsNote,
    FormulaFit,
    MemoryModel,
    Scaling,
)
from mapmore_cli.domain.joining import Fusion, Side
from mapmore_cli.domain.recording import CurveRange, Quantity, Signal


@dataclass(frozen=True)
class SegmentFunction(ChosenTerms):
    """Segment function `f(x) = y_slope sum_k theta_k D_k(slope x + intercept) + y_intercept` (M2 eq
    8).
    """

    id: Annotated[Label, "identifier of the segment"]
    cell: Annotated[tuple[int, ...], "place along each segmented variable, from 1", "-"]
    terms: Annotated[tuple[TermName, ...], "(k) names of the terms D_k, in the order of selection"]
    theta: Annotated[Numbers, "(k) coefficients of the terms, which are finite"]
    scaling: Annotated[Scaling, "scaling of the segment"]
    limits: Annotated[
        Ranges,
        "smallest and largest training value of each segmented variable in the segment",
        "[*]",
    ] = field(default_factory=dict)
    errors_note: ErrorsNote = LOWER_BOUND


@dataclass(frozen=True)
class CurveFunction(CutCurve):
    """The segment functions of one training curve, which are joined at the segment boundaries."""

    segments: Annotated[tuple[SegmentFunction, ...], "segment functions"]


@dataclass(frozen=True)
class FoldError:
    """Cross-validation error of one of the three ways to build a model from a backbone and
    segments.

    `choice` is `backbone`, `backbone + residual` or `backbone + shrunken residual`.
    """

    choice: Annotated[Label, "what was cross-validated"]
    rmse: Annotated[float, "pooled error of all left-out samples", "[target]"]
    folds: Annotated[Count, "number of folds"]


class Body:
    """Base class for the part of a model that differs between kinds of models. `modelling.kinds`
    defines what can be done with a model of any kind.

    `models` are the models that a body contains, and `memories` are its parts with memory.
    """

    @property
    def models(self) -> tuple[Model, ...]:
        """Models that this body contains; none by default."""
        return ()

    @property
    def memories(self) -> tuple[MemoryModel, ...]:
        """Parts of this body that have memory; none by default."""
        return ()


B = TypeVar("B", bound=Body)


# two objects are equal only if they are the same object, because arrays have no hash
@dataclass(frozen=True, eq=False)
class Pieces(Body):
    """Model of pieces (MAPMORE). The output of the model is `backbone + sum_i f_i prod_j w_ij`,
    with segment functions f_i and weights w_ij (M2 eq 9).

    `level` is None if all curves are pooled. Curves have no segments if cross-validation showed
    that segments do not improve the backbone; the model is then the backbone alone.
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
        return self.curves

    @classmethod
    def of_one(cls, curve: CurveFunction) -> Pieces:
        """Return a body that consists of a single curve, whose segment function is evaluated
        without a limit also outside the range of the curve.
        """
        names = tuple(curve.limits)
        sides: tuple[Side, Side] = ("continue", "continue")
        fusion = Fusion(hold="none", extrapolation=dict.fromkeys(names, sides))
        return cls(None, names, (curve,), fusion)

    def joined(self, **how: Any) -> Pieces:
        """Return a copy of the model in which some of the rules for joining the pieces (fields of
        `Fusion`) have other values.
        """
        return replace(self, fusion=replace(self.fusion, **how))

    @property
    def segments(self) -> tuple[SegmentFunction, ...]:
        """All segment functions: those of the first curve, then those of the next curve, and so
        on.
        """
        return tuple(segment for curve in self.curves for segment in curve.segments)


@dataclass(frozen=True)
class Formula(Body):
    """A model that consists of a formula of the literature only."""

    fit: Annotated[FormulaFit, "the fitted formula"]
    level: Annotated[QuantityName | None, "the input that is constant within a training curve"]
    ranges: Annotated[tuple[CurveRange, ...], "training range of each curve"]

    @property
    def backbone(self) -> FormulaFit:
        """The fitted formula, because the whole model is its backbone."""
        return self.fit


@dataclass(frozen=True)
class Memory(Body):
    """A model with memory, alone or added to a backbone.

    For a prediction, it needs a recording with its `time`. If the model feeds its output back, it
    also needs the first measured outputs.
    """

    model: Annotated[MemoryModel, "states, terms and coefficients"]
    ranges: Annotated[tuple[CurveRange, ...], "training range of each curve"]
    backbone: Annotated[FormulaFit | None, "formula that it is added to"] = None

    @property
    def memories(self) -> tuple[MemoryModel, ...]:
        """A tuple with the part with memory as its only element."""
        return (self.model,)


@dataclass(frozen=True)
class Outputs(Body):
    """Models of several outputs, which share segments, terms and inputs."""

    parts: Annotated[tuple[Model, ...], "the model of each output"]

    @property
    def models(self) -> tuple[Model, ...]:
        """The model of each output."""
        return self.parts


# The whole
# --------------------------------------------------------------------------------------------------


LeftOutKind = Literal["levels", "recordings", "blocks", "specimens"]
"""What was left out of the training data, one part after the other."""


@dataclass(frozen=True)
class LeftOut:
    """Errors from which prediction intervals are computed. Each part of the training data is left
    out once, and is predicted by a model that is fitted to the other parts.

    If the parts are levels, the lowest and the highest level are not left out.
    """

    kind: Annotated[
        LeftOutKind, "`levels`, `recordings`, `blocks` or `specimens`: what was left out in turn"
    ]
    curves: Annotated[Count, "number of levels, recordings or blocks of the training data"]
    parts: Annotated[tuple[Label, ...], "(parts) names of the parts"]
    samples: Annotated[IntArray, "(parts) number of samples of each part"]
    offset: Annotated[Numbers, "(parts) mean of measured minus predicted values", "[target]"]
    scatter: Annotated[Numbers, "(parts) standard deviation about the offset", "[target]"]
    sizes: Annotated[
        Numbers,
        "(parts, shares) quantiles of the absolute residuals of each at even shares from 0 to 1",
        "[target]",
    ]
    places: Annotated[
        tuple[Number, ...], "(levels) training levels", "that of the level", ASCENDING
    ] = ()
    repeats: Annotated[tuple[Count, ...], "(levels) training recordings at each level"] = ()
    largest: Annotated[Number, "largest absolute training target", "[target]"] = 0.0
    residual: Annotated[
        Number,
        "root mean square training residual, corrected for the number of parameters",
        "[target]",
    ] = 0.0
    smooth: Annotated[
        Number, "root mean product of neighbouring training residuals", "[target]"
    ] = 0.0
    apart: Annotated[
        float,
        "standard deviation between recordings of one level; NaN without repeats",
        "[target]",
    ] = math.nan
    astray: Annotated[
        Number,
        "distance of left-out predictions from the range of the training target, as a fraction "
        "of this range",
    ] = 0.0


@dataclass(frozen=True)
class KeptShape:
    """Shape that the output is required to have along one input. `binds` holds the ranges in which
    this requirement changes the coefficients. `violated` says how much a fit without the
    requirement would violate the shape.
    """

    quantity: Annotated[QuantityName, "the input; for `positive`, the output itself"]
    word: Annotated[Word, "`increasing`, `decreasing`, `convex`, `concave` or `positive`"]
    violated: Annotated[
        Number,
        "largest fall, or largest distance from a chord, of a fit without the shape",
        "[target]",
    ]
    binds: Annotated[
        Ranges,
        "ranges of the inputs in which the shape determines the coefficients; empty if it does not",
        "[*]",
    ]


@dataclass(frozen=True)
class Shape:
    """Shape that a model keeps over its training range. The range is extended on each side by
    `beyond` times its width. The shape is not required at places at which the training output is
    small, that is, in the lowest fraction `slack` of its range.

    The errors are root mean square errors of two fits: with the shape, and without it.
    """

    kept: Annotated[tuple[KeptShape, ...], "required shapes"]
    slack: Annotated[Number, "fraction of the range of the training output"]
    beyond: Annotated[Number, "fraction of the training range of each input"]
    training: Annotated[Number, "error on the training samples", "[target]"] = 0.0
    held_out: Annotated[
        float, "error on the held-out samples; NaN if there are none", "[target]"
    ] = math.nan
    training_without: Annotated[
        Number, "error on the training samples without the shape", "[target]"
    ] = 0.0
    held_out_without: Annotated[
        float, "error on the held-out samples without the shape", "[target]"
    ] = math.nan

    @property
    def monotone(self) -> frozenset[str]:
        """Names of the inputs along which the output never falls, or never rises."""
        return frozenset(k.quantity for k in self.kept if k.word in ("increasing", "decreasing"))

    @property
    def promise(self) -> str:
        """One line that describes the shape, for headers of exported files."""
        words = ", ".join(
            kept.word if kept.word == "positive" else f"{kept.word} in {kept.quantity}"
            for kept in self.kept
        )
        where = (
            f"where the training output is more than {self.slack:.3g} of its range above its "
            "smallest value"
        )
        return f"{words} over the training range, {where}"


@dataclass(frozen=True)
class Model:
    """A model with everything that a prediction needs. A model consists of fields that all kinds of
    models have, and of a `body`, whose type depends on the kind of the model.
    """

    name: Annotated[Label, "name of the run"]
    output: Annotated[Quantity, "predicted quantity"]
    inputs: Annotated[tuple[Quantity, ...], "quantities that the model needs"]
    body: Annotated[Body, "what the model consists of"]
    signals: Annotated[
        tuple[Signal, ...], "inputs that are computed from others over time, each after its source"
    ] = ()
    notes: Notes = ()
    left_out: Annotated[
        LeftOut | None, "errors from which intervals are computed, if the spec asks for intervals"
    ] = None
    shape: Annotated[Shape | None, "the shape that it keeps, if the spec asks for one"] = None

    def body_of(self, kind: type[B]) -> B:
        """Return the body, which must be of the type `kind`."""
        assert isinstance(self.body, kind)
        return self.body

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs, in order."""
        return tuple(quantity.name for quantity in self.inputs)

    @property
    def each(self) -> tuple[Model, ...]:
        """The model of each output. With only one output, the only element is this model."""
        return self.body.models if isinstance(self.body, Outputs) else (self,)

    @property
    def outputs(self) -> tuple[Quantity, ...]:
        """The predicted quantities with their units."""
        return tuple(model.output for model in self.each)

    def of(self, output: str) -> Model:
        """Return the model of one of several outputs. Return the model itself if it has only one
        output, or if no output has this name.
        """
        return next((model for model in self.each if model.output.name == output), self)

    @property
    def pieces(self) -> Pieces | None:
        """The body of the model if the model consists of pieces; None otherwise."""
        return self.body if isinstance(self.body, Pieces) else None

    @property
    def level(self) -> str | None:
        """The input that is constant within each training curve; None if there is no such input."""
        return getattr(self.body, "level", None)

    @property
    def backbone(self) -> FormulaFit | None:
        """The formula that is the backbone of the model, or the whole model."""
        return getattr(self.body, "backbone", None)

    @property
    def every(self) -> tuple[Model, ...]:
        """The model itself and all models that it contains."""
        return (self, *(inner for model in self.body.models for inner in model.every))

    @property
    def memories(self) -> tuple[MemoryModel, ...]:
        """Every part with memory, in this model and in the models that it contains."""
        return tuple(memory for model in self.every for memory in model.body.memories)


@dataclass(frozen=True)
class Equation:
    """Equation of one piece of a model, in physical units.

    - `id`: id of a segment, or name of a formula.
    - `text`: the equation as one line that can be copied and computed. `latex`, `mathml`: the
      equation for typesetting; `mathml` is a sequence of parts, between which a line may break.
    - `weight`: a text with the range of the inputs in which the weight of the piece is not zero,
      and with the places outside which its output is constant; empty if the piece is used
      everywhere.
    """

    id: str
    text: str
    latex: str
    mathml: tuple[str, ...] = ()
    weight: str = ""
