"""What the fit stage hands on."""

from __future__ import annotations

from mapmore_cli.domain.results import FitResult
from mapmore_cli.storage.artefacts.codecs import numbered, optional
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.layout.cells import TEXTS
from mapmore_cli.storage.artefacts.layout.fits import FORMULA_FIT, SEGMENT_FIT
from mapmore_cli.storage.artefacts.layout.memory import MEMORY_FIT
from mapmore_cli.storage.artefacts.schema import Field, Schema, record

FIT_RESULT = Schema(
    FitResult,
    "Segment functions, with every intermediate result of their selection.",
    (
        Field("fits", numbered(record(SEGMENT_FIT)), "segment functions", NO_UNIT),
        Field("backbone", optional(record(FORMULA_FIT)), "formula whose residual the segments explain", NO_UNIT),
        Field("notes", TEXTS, "remarks for the reader", NO_UNIT),
        Field("memory", optional(record(MEMORY_FIT)), "model with memory that stands in place of segments", NO_UNIT),
    ),
)
