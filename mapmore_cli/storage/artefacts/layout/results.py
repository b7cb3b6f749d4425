"""What the segment, fit and validate stages hand on: curves cut up, fits, predictions and scores."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

from mapmore_cli.domain.fits import Segment, SegmentedCurve
from mapmore_cli.domain.results import FitResult, PiecesFit
from mapmore_cli.domain.scores import METRICS, Score, Validation
from mapmore_cli.modelling.kinds import kinds
from mapmore_cli.storage.artefacts.codecs import added, named, numbered, optional, pairs, text
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.layout.derived import ANY_REAL, ANY_REALS, CELL, CUTS, TEXTS, schema_of, stored
from mapmore_cli.storage.artefacts.layout.fits import FORMULA_FIT, MOTION_FIT
from mapmore_cli.storage.artefacts.schema import Fault, Field, Schema, record, rows, variant


@dataclass(frozen=True)
class SegmentationFile:
    """Where every training curve is cut."""

    curves: Annotated[tuple[SegmentedCurve, ...], "training curves"]


SEGMENT = stored(Segment, {"cell": CELL})


def _cut_faults(curve: SegmentedCurve) -> Iterator[Fault]:
    counts = [len(locations) - 1 for locations in curve.boundaries]
    for place, segment in enumerate(curve.segments):
        if len(segment.cell) != len(counts) or any(cell > count for cell, count in zip(segment.cell, counts, strict=True)):
            yield f"segments/{place:03d}/cell", f"is none of {' x '.join(map(str, counts)) or '1'} cells"


SEGMENTED_CURVE = stored(
    SegmentedCurve,
    {"boundaries": numbered(CUTS)},
    units=lambda curve: {f"variables.{place}": f"[{name}]" for place, name in enumerate(curve.variables)},
    rule=_cut_faults,
)

SEGMENTATION = stored(SegmentationFile)

PIECES_FIT = stored(PiecesFit)

FIT_BODIES = {kind.name: schema_of(kind.fit) for kind in kinds() if kind.fit is not None}
"""What was fitted, by the name of the kind."""

FIT_RESULT = stored(FitResult, {"body": optional(variant(FIT_BODIES)), "notes": TEXTS})

SCORE = stored(Score, {**{name: ANY_REAL for name in METRICS if name != "n"}, "split": text(words=("train", "validate"))})

VALIDATION = Schema(
    Validation,
    "Predictions of the run's own model and of its competitors, and their scores.",
    (
        Field("predictions", named(numbered(ANY_REALS)), "by model, then by curve of the dataset, row for row", "[target]"),
        Field("formulas", named(record(FORMULA_FIT)), "literature models that were fitted", NO_UNIT),
        Field("scores", rows(SCORE), "score table", NO_UNIT),
        Field("units", pairs(TEXTS), "unit of every target", NO_UNIT),
        Field("motions", added(named(record(MOTION_FIT)), {}), "models of motion among the competitors, and how they were found", NO_UNIT),
        Field("warnings", added(TEXTS, ()), "what must be known of the run's own model before its scores are read", NO_UNIT),
    ),
    units=lambda validation: {**validation.units, **({"target": next(iter(validation.units.values()))} if validation.units else {})},
)
