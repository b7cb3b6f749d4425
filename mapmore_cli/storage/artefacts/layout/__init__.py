"""The stored types: every field of every HDF5 file of a run, declared once.

Units in brackets name the quantity whose unit applies: `[target]` is the modelled quantity, `[variables.0]` the first segmented variable,
`[*]` the quantity that a part is named after, `[slopes]` one over the unit of each scaled variable.
"""

from __future__ import annotations

from mapmore_cli.storage.artefacts.layout.data import CURVE, DATASET, QUANTITY, RECORDING
from mapmore_cli.storage.artefacts.layout.fits import FORMULA_FIT, OPTIMUM, SCALING, SEGMENT_FIT, SELECTION
from mapmore_cli.storage.artefacts.layout.memory import IDENTIFIED, MEMORY_FIT, MEMORY_MODEL, STATE_SET
from mapmore_cli.storage.artefacts.layout.model import (
    BODIES,
    CURVE_FUNCTION,
    CURVE_RANGE,
    FOLD_ERROR,
    FUSION,
    LEFT_OUT,
    MODEL,
    PART,
    SEGMENT_FUNCTION,
    SIGNAL,
)
from mapmore_cli.storage.artefacts.layout.motion import MOTION, MOTION_FIT, MOTION_SECTION, SECTION_SEARCH
from mapmore_cli.storage.artefacts.layout.results import (
    FIT_RESULT,
    PIECES_FIT,
    SCORE,
    SEGMENT,
    SEGMENTATION,
    SEGMENTED_CURVE,
    VALIDATION,
    SegmentationFile,
)

__all__ = ["DATASET", "FIT_RESULT", "MODEL", "SCHEMAS", "SEGMENTATION", "VALIDATION", "SegmentationFile"]

SCHEMAS = (
    QUANTITY,
    RECORDING,
    CURVE,
    DATASET,
    SEGMENT,
    SEGMENTED_CURVE,
    SEGMENTATION,
    SCALING,
    SELECTION,
    SEGMENT_FIT,
    FORMULA_FIT,
    OPTIMUM,
    FOLD_ERROR,
    STATE_SET,
    MEMORY_MODEL,
    IDENTIFIED,
    MEMORY_FIT,
    MOTION_SECTION,
    MOTION,
    SECTION_SEARCH,
    MOTION_FIT,
    PIECES_FIT,
    FIT_RESULT,
    SEGMENT_FUNCTION,
    CURVE_FUNCTION,
    FUSION,
    CURVE_RANGE,
    PART,
    *BODIES.values(),
    SIGNAL,
    LEFT_OUT,
    MODEL,
    SCORE,
    VALIDATION,
)
"""Every stored type, each after those that it is made of."""
