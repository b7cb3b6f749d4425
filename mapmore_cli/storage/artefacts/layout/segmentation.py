"""Training curves cut up."""

from __future__ import annotations

from dataclasses import dataclass

from mapmore_cli.domain.fits import Segment, SegmentedCurve
from mapmore_cli.storage.artefacts.codecs import numbered
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.layout.cells import ASCENDING, CELL, INDICES, LIMITS, OPTIONAL_REAL, TEXT, TEXTS
from mapmore_cli.storage.artefacts.schema import Field, Schema, record


@dataclass(frozen=True)
class SegmentationFile:
    """What segment.h5 holds."""

    curves: tuple[SegmentedCurve, ...]


SEGMENT = Schema(
    Segment,
    "Rows of a training curve that one segment function is fitted to.",
    (
        Field("id", TEXT, "identifier of the segment, as `pressure=150/strain:2`", NO_UNIT),
        Field("curve", TEXT, "identifier of its curve", NO_UNIT),
        Field("cell", CELL, "place along each segmented variable, from 1", NO_UNIT),
        Field("rows", INDICES, "row numbers within the curve's training samples, from 0", NO_UNIT),
    ),
)

SEGMENTED_CURVE = Schema(
    SegmentedCurve,
    "A training curve cut up; samples stay in the dataset file.",
    (
        Field("curve", TEXT, "identifier of the curve", NO_UNIT),
        Field("level", OPTIONAL_REAL, "value of the level quantity", "[level]"),
        Field("variables", TEXTS, "(p) segmented variables", NO_UNIT),
        Field("boundaries", numbered(ASCENDING), "(p) segment locations of each variable, both ends included", "[variables.*]"),
        Field("limits", LIMITS, "least and greatest training value of each input", "[*]"),
        Field("segments", numbered(record(SEGMENT)), "segments of the curve", NO_UNIT),
    ),
    units=lambda curve: {f"variables.{place}": f"[{name}]" for place, name in enumerate(curve.variables)},
)

SEGMENTATION = Schema(
    SegmentationFile,
    "Where every training curve is cut.",
    (Field("curves", numbered(record(SEGMENTED_CURVE)), "training curves", NO_UNIT),),
)
