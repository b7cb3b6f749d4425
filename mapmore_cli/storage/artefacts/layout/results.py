"""What the fit stage hands on."""

from __future__ import annotations

from mapmore_cli.domain.results import FitResult, PiecesFit
from mapmore_cli.storage.artefacts.codecs import numbered, optional
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.layout.cells import TEXTS
from mapmore_cli.storage.artefacts.layout.fits import FORMULA_FIT, SEGMENT_FIT
from mapmore_cli.storage.artefacts.layout.memory import MEMORY_FIT
from mapmore_cli.storage.artefacts.layout.motion import MOTION_FIT
from mapmore_cli.storage.artefacts.schema import Field, Schema, record, variant

PIECES_FIT = Schema(
    PiecesFit,
    "The segment functions of every training curve.",
    (Field("segments", numbered(record(SEGMENT_FIT)), "segment functions", NO_UNIT),),
)

FIT_BODIES = {"pieces": PIECES_FIT, "memory": MEMORY_FIT, "state_space": MOTION_FIT, "formula": FORMULA_FIT}
"""What was fitted, by the name of the kind. Whoever adds a kind adds its fit here."""

FIT_RESULT = Schema(
    FitResult,
    "What was fitted, with every intermediate result of the selection of terms.",
    (
        Field("body", optional(variant(FIT_BODIES)), "what was fitted; absent where models are only added up", NO_UNIT),
        Field("backbone", optional(record(FORMULA_FIT)), "formula whose residual was fitted", NO_UNIT),
        Field("notes", TEXTS, "remarks for the reader", NO_UNIT),
    ),
)
