"""The result files of a run: their names, in one place, and what each holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mapmore_cli.domain.fits import SegmentedCurve
    from mapmore_cli.domain.models import Model
    from mapmore_cli.domain.recording import Dataset
    from mapmore_cli.domain.results import FitResult
    from mapmore_cli.domain.scores import Validation

DATASET, SEGMENTATION, FIT, MODEL, VALIDATION = "ingest.h5", "segment.h5", "fit.h5", "model.h5", "validate.h5"
RESULTS: Mapping[str, str] = MappingProxyType(
    {"ingest": DATASET, "segment": SEGMENTATION, "fit": FIT, "fuse": MODEL, "validate": VALIDATION}
)
"""The file that shows what a stage found; `report` has a page instead."""


@dataclass(frozen=True)
class RunFiles:
    """The results in the folder of a run, read when they are asked for; raises as `artefacts.read_*`."""

    folder: Path

    def dataset(self) -> Dataset:
        """What `ingest` handed on."""
        from mapmore_cli.storage.artefacts import read_dataset

        return read_dataset(self.folder / DATASET)

    def segmentation(self) -> tuple[SegmentedCurve, ...]:
        """Where the training curves are cut."""
        from mapmore_cli.storage.artefacts import read_segmentation

        return read_segmentation(self.folder / SEGMENTATION)

    def fit(self) -> FitResult:
        """What was fitted."""
        from mapmore_cli.storage.artefacts import read_fit

        return read_fit(self.folder / FIT)

    def model(self) -> Model:
        """The model that stands alone."""
        from mapmore_cli.storage.artefacts import read_model

        return read_model(self.folder / MODEL)

    def validation(self) -> Validation:
        """Predictions and scores."""
        from mapmore_cli.storage.artefacts import read_validation

        return read_validation(self.folder / VALIDATION)
