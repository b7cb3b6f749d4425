"""What the segment, fit and validate stages hand on: curves cut up, fits, predictions and scores."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from mapmore_cli.domain.fits import Segment, SegmentedCurve
from mapmore_cli.domain.results import FitResult, PiecesFit
from mapmore_cli.domain.scores import METRICS, Score, Validation
from mapmore_cli.modelling.kinds import kinds
from mapmore_cli.storage.artefacts.codecs import added, named, numbered, optional, pairs, text
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.layout.cells import (
    ANY_REAL,
    ANY_REALS,
    CELL,
    COUNT,
    CUTS,
    INDICES,
    LIMITS,
    OPTIONAL_REAL,
    TEXT,
    TEXTS,
)
from mapmore_cli.storage.artefacts.layout.derived import completed, schema_of
from mapmore_cli.storage.artefacts.layout.fits import FORMULA_FIT, SEGMENT_FIT
from mapmore_cli.storage.artefacts.layout.motion import MOTION_FIT
from mapmore_cli.storage.artefacts.schema import Fault, Field, Schema, record, rows, variant


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


def _cut_faults(curve: SegmentedCurve) -> Iterator[Fault]:
    counts = [len(locations) - 1 for locations in curve.boundaries]
    for place, segment in enumerate(curve.segments):
        if len(segment.cell) != len(counts) or any(cell > count for cell, count in zip(segment.cell, counts, strict=True)):
            yield f"segments/{place:03d}/cell", f"is none of {' x '.join(map(str, counts)) or '1'} cells"


SEGMENTED_CURVE = Schema(
    SegmentedCurve,
    "A training curve cut up; samples stay in the dataset file.",
    (
        Field("curve", TEXT, "identifier of the curve", NO_UNIT),
        Field("level", OPTIONAL_REAL, "value of the level quantity", "[level]"),
        Field("variables", TEXTS, "(p) segmented variables", NO_UNIT),
        Field("boundaries", numbered(CUTS), "(p) segment locations of each variable, both ends included", "[variables.*]"),
        Field("limits", LIMITS, "least and greatest training value of each input", "[*]"),
        Field("segments", numbered(record(SEGMENT)), "segments of the curve", NO_UNIT),
    ),
    units=lambda curve: {f"variables.{place}": f"[{name}]" for place, name in enumerate(curve.variables)},
    rule=_cut_faults,
)

SEGMENTATION = Schema(
    SegmentationFile,
    "Where every training curve is cut.",
    (Field("curves", numbered(record(SEGMENTED_CURVE)), "training curves", NO_UNIT),),
)


SCORE = Schema(
    Score,
    "One row of the score table.",
    (
        Field("model", TEXT, "`mapmore`, or the name of a literature model", NO_UNIT),
        Field("target", TEXT, "the modelled quantity", NO_UNIT),
        Field("split", text(words=("train", "validate")), "`train` or `validate`", NO_UNIT),
        Field("curve", TEXT, "`all`, or the identifier of a curve", NO_UNIT),
        Field("n", COUNT, METRICS["n"]),
        Field("rmse", ANY_REAL, METRICS["rmse"], "[target]"),
        Field("nrmse", ANY_REAL, METRICS["nrmse"]),
        Field("normaliser", ANY_REAL, METRICS["normaliser"], "[target]"),
        Field("normaliser_name", TEXT, "what the normaliser is", NO_UNIT),
        Field("max_abs_error", ANY_REAL, METRICS["max_abs_error"], "[target]"),
        Field("max_abs_error_fs", ANY_REAL, METRICS["max_abs_error_fs"]),
        Field("r2", ANY_REAL, METRICS["r2"]),
        Field("rrse", ANY_REAL, METRICS["rrse"]),
        Field("rrse_one_step", ANY_REAL, METRICS["rrse_one_step"]),
        Field("r_uncentred", ANY_REAL, METRICS["r_uncentred"]),
        Field("interval_coverage", ANY_REAL, METRICS["interval_coverage"]),
        Field("interval_half_width", ANY_REAL, METRICS["interval_half_width"], "[target]"),
    ),
)

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


PIECES_FIT = completed(
    Schema(
        PiecesFit,
        "The segment functions of every training curve.",
        (Field("segments", numbered(record(SEGMENT_FIT)), "segment functions", NO_UNIT),),
    )
)

FIT_BODIES = {kind.name: schema_of(kind.fit) for kind in kinds() if kind.fit is not None}
"""What was fitted, by the name of the kind."""

FIT_RESULT = Schema(
    FitResult,
    "What was fitted, with every intermediate result of the selection of terms.",
    (
        Field("body", optional(variant(FIT_BODIES)), "what was fitted; absent where models are only added up", NO_UNIT),
        Field("backbone", optional(record(FORMULA_FIT)), "formula whose residual was fitted", NO_UNIT),
        Field("notes", TEXTS, "remarks for the reader", NO_UNIT),
        Field("max_terms", added(COUNT, 0), "number of terms that left-out training data chose; 0 where the spec says it", NO_UNIT),
    ),
)
