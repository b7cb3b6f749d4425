"""The result files of a run: one pair of functions for each kind of HDF5 file, and the score table.

Every `write_*` makes a whole file or none (WriteError), with bytes that depend on the arguments only. Every `read_*` raises DataError,
naming the file, for one that is missing, damaged, of another kind or of a newer format, that holds what the format does not know or values
that cannot be, or whose values are not those that were written; `unverified` accepts the last, and `warn` is told of it, and of files
without a checksum. h5py is imported at the first use.

`units` of `write_segmentation` and `write_fit` are those of `units_of(dataset)`: the types written there do not know them.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from mapmore_cli.domain.fits import SegmentedCurve
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.storage.artefacts.files import (
    DATASET_FILE,
    FIT_FILE,
    MODEL_FILE,
    NO_UNITS,
    SEGMENTATION_FILE,
    VALIDATION_FILE,
    Warn,
    kind_of,
    silent,
)
from mapmore_cli.storage.artefacts.layout import SegmentationFile

__all__ = [
    "kind_of",
    "read_dataset",
    "read_fit",
    "read_model",
    "read_segmentation",
    "read_validation",
    "units_of",
    "write_dataset",
    "write_fit",
    "write_model",
    "write_segmentation",
    "write_validation",
]


def units_of(dataset: Dataset) -> dict[str, str]:
    """Return the units by quantity, with those of the `target` and the `level`, for the files of the later stages."""
    units = {name: quantity.unit for name, quantity in dataset.quantities.items()}
    level = {"level": dataset.unit(dataset.level)} if dataset.level else {}
    return {**units, "target": dataset.unit(dataset.target), **level}


write_dataset, read_dataset = DATASET_FILE.write, DATASET_FILE.read
write_fit, read_fit = FIT_FILE.write, FIT_FILE.read
write_validation, read_validation = VALIDATION_FILE.write, VALIDATION_FILE.read
read_model = MODEL_FILE.read


def write_model(path: Path, model: Model, provenance: Mapping[str, str] = NO_UNITS) -> None:
    """Write a model that stands alone; `provenance` may hold texts of any length, as the resolved spec."""
    MODEL_FILE.write(path, model, provenance=provenance)


def write_segmentation(path: Path, curves: tuple[SegmentedCurve, ...], units: Mapping[str, str] = NO_UNITS) -> None:
    """Write where the training curves are cut: boundaries and row numbers, no samples."""
    SEGMENTATION_FILE.write(path, SegmentationFile(tuple(curves)), units)


def read_segmentation(path: Path, warn: Warn = silent, unverified: bool = False) -> tuple[SegmentedCurve, ...]:
    """Read where the training curves are cut."""
    return SEGMENTATION_FILE.read(path, warn, unverified).curves
