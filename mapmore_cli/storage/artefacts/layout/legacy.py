"""Fits and models as formats 1.x stored them: kinds were told apart by what was absent. They are read, and never written."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mapmore_cli.domain.fits import FormulaFit, SegmentFit
from mapmore_cli.domain.memory import MemoryFit, MemoryModel
from mapmore_cli.domain.models import (
    Body,
    CurveFunction,
    CurveRange,
    FoldError,
    Formula,
    Fusion,
    Memory,
    Model,
    Part,
    Pieces,
    Sum,
)
from mapmore_cli.domain.recording import Quantity, Signal
from mapmore_cli.domain.results import FitResult, PiecesFit
from mapmore_cli.storage.artefacts.codecs import added, numbered, optional
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.layout.cells import OPTIONAL_TEXT, TEXT, TEXTS
from mapmore_cli.storage.artefacts.layout.data import QUANTITY
from mapmore_cli.storage.artefacts.layout.fits import FORMULA_FIT, SEGMENT_FIT
from mapmore_cli.storage.artefacts.layout.memory import MEMORY_FIT, MEMORY_MODEL
from mapmore_cli.storage.artefacts.layout.model import CURVE_FUNCTION, FOLD_ERROR, FUSION, SIGNAL
from mapmore_cli.storage.artefacts.schema import Field, Schema, nested, record, rows


@dataclass(frozen=True)
class Model1:
    """A model of format 1.x."""

    name: str
    output: Quantity
    inputs: tuple[Quantity, ...]
    level: str | None
    variables: tuple[str, ...]
    curves: tuple[CurveFunction, ...]
    fusion: Fusion
    backbone: FormulaFit | None
    cross_validation: tuple[FoldError, ...]
    notes: tuple[str, ...]
    signals: tuple[Signal, ...]
    summands: tuple[Model1, ...]
    memory: MemoryModel | None

    def upgraded(self) -> Model:
        """The model as it is today."""
        return Model(self.name, self.output, self.inputs, self._body(), self.signals, self.notes)

    def _body(self) -> Body:
        if self.summands:
            return Sum(tuple(Part(summand.upgraded()) for summand in self.summands))
        ranges = tuple(CurveRange(curve.curve, curve.level, curve.limits) for curve in self.curves)
        if self.memory is not None:
            return Memory(self.memory, ranges, self.backbone)
        if self.backbone is not None and not self.cross_validation and not any(curve.segments for curve in self.curves):
            return Formula(self.backbone, self.level, ranges)
        return Pieces(self.level, self.variables, self.curves, self.fusion, self.backbone, self.cross_validation)


@dataclass(frozen=True)
class FitResult1:
    """A fit of format 1.x."""

    fits: tuple[SegmentFit, ...]
    backbone: FormulaFit | None
    notes: tuple[str, ...]
    memory: MemoryFit | None

    def upgraded(self) -> FitResult:
        """The fit as it is today."""
        if self.memory is not None:
            return FitResult(self.memory, self.backbone, self.notes)
        if not self.fits:
            return FitResult(self.backbone, None, self.notes)
        return FitResult(PiecesFit(self.fits), self.backbone, self.notes)


def _model() -> Schema:
    return MODEL_1


def _field(name: str, codec: Any) -> Field:
    return Field(name, codec, "as in format 1.x", NO_UNIT)


MODEL_1 = Schema(
    Model1,
    "A model of format 1.x.",
    (
        _field("name", TEXT),
        _field("output", record(QUANTITY)),
        _field("inputs", numbered(record(QUANTITY))),
        _field("level", OPTIONAL_TEXT),
        _field("variables", TEXTS),
        _field("curves", numbered(record(CURVE_FUNCTION))),
        _field("fusion", record(FUSION)),
        _field("backbone", optional(record(FORMULA_FIT))),
        _field("cross_validation", rows(FOLD_ERROR)),
        _field("notes", TEXTS),
        _field("signals", added(rows(SIGNAL), ())),
        _field("summands", added(numbered(nested(Model1, _model)), ())),
        _field("memory", optional(record(MEMORY_MODEL))),
    ),
)

FIT_RESULT_1 = Schema(
    FitResult1,
    "A fit of format 1.x.",
    (
        _field("fits", numbered(record(SEGMENT_FIT))),
        _field("backbone", optional(record(FORMULA_FIT))),
        _field("notes", TEXTS),
        _field("memory", optional(record(MEMORY_FIT))),
    ),
)
