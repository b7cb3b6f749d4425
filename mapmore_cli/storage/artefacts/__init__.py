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
from mapmore_cli.domain.results import FitResult
from mapmore_cli.domain.scores import Validation
from mapmore_cli.storage.artefacts.files import (
    DATASET_FILE,
    FIT_FILE,
    MODEL_FILE,
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

_NO_UNITS: Mapping[str, str] = {}


def units_of(dataset: Dataset) -> dict[str, str]:
    """Return the units by quantity, with those of the `target` and the `level`, for the files of the later stages."""
    units = {name: quantity.unit for name, quantity in dataset.quantities.items()}
    level = {"level": dataset.unit(dataset.level)} if dataset.level else {}
    return {**units, "target": dataset.unit(dataset.target), **level}


def write_dataset(path: Path, dataset: Dataset) -> None:
    """Write what `ingest` hands on."""
    DATASET_FILE.write(path, dataset, _NO_UNITS)


def read_dataset(path: Path, warn: Warn = silent, unverified: bool = False) -> Dataset:
    """Read a dataset file, as ingest.h5."""
    dataset: Dataset = DATASET_FILE.read(path, warn, unverified)
    return dataset


def write_segmentation(path: Path, curves: tuple[SegmentedCurve, ...], units: Mapping[str, str] = _NO_UNITS) -> None:
    """Write where the training curves are cut: boundaries and row numbers, no samples."""
    SEGMENTATION_FILE.write(path, SegmentationFile(tuple(curves)), units)


def read_segmentation(path: Path, warn: Warn = silent, unverified: bool = False) -> tuple[SegmentedCurve, ...]:
    """Read a segmentation file, as segment.h5."""
    content: SegmentationFile = SEGMENTATION_FILE.read(path, warn, unverified)
    return content.curves


def write_fit(path: Path, result: FitResult, units: Mapping[str, str] = _NO_UNITS) -> None:
    """Write segment functions with every intermediate result of their selection."""
    FIT_FILE.write(path, result, units)


def read_fit(path: Path, warn: Warn = silent, unverified: bool = False) -> FitResult:
    """Read a fit file, as fit.h5."""
    result: FitResult = FIT_FILE.read(path, warn, unverified)
    return result


def write_model(path: Path, model: Model, provenance: Mapping[str, str] = _NO_UNITS) -> None:
    """Write a model that stands alone; `provenance` may hold texts of any length, as the resolved spec."""
    MODEL_FILE.write(path, model, _NO_UNITS, provenance)


def read_model(path: Path, warn: Warn = silent, unverified: bool = False) -> Model:
    """Read a model file, as model.h5."""
    model: Model = MODEL_FILE.read(path, warn, unverified)
    return model


def write_validation(path: Path, validation: Validation) -> None:
    """Write predictions, fitted competitors and scores."""
    VALIDATION_FILE.write(path, validation, _NO_UNITS)


def read_validation(path: Path, warn: Warn = silent, unverified: bool = False) -> Validation:
    """Read a validation file, as validate.h5."""
    validation: Validation = VALIDATION_FILE.read(path, warn, unverified)
    return validation
