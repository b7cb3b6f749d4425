"""The stored types: every field of every HDF5 file of a run, declared once, in the dataclasses of `domain` or here.

Units in brackets name the quantity whose unit applies: `[target]` is the modelled quantity, `[variables.0]` the first segmented variable,
`[*]` the quantity that a part is named after, `[slopes]` one over the unit of each scaled variable.
"""

from __future__ import annotations

from mapmore_cli.storage.artefacts.layout import fits  # noqa: F401 - their types are laid out before the next ones
from mapmore_cli.storage.artefacts.layout.derived import LAYOUTS
from mapmore_cli.storage.artefacts.layout.fits import DATASET
from mapmore_cli.storage.artefacts.layout.model import FUSION, MODEL
from mapmore_cli.storage.artefacts.layout.results import FIT_RESULT, SEGMENTATION, VALIDATION, SegmentationFile

__all__ = ["DATASET", "FIT_RESULT", "FUSION", "MODEL", "SCHEMAS", "SEGMENTATION", "VALIDATION", "SegmentationFile"]

SCHEMAS = (*LAYOUTS.values(), VALIDATION)
"""Every stored type, each after those that it is made of."""
