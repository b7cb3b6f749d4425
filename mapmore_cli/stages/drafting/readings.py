"""Recordings of a group of files, read through `ingest` as the spec under way describes them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.spec.sections.data import Data
from mapmore_cli.spec.units import default_unit
from mapmore_cli.stages.drafting.groups import Group
from mapmore_cli.stages.ingestion.dataset import build_dataset
from mapmore_cli.stages.ingestion.slice import IngestSlice
from mapmore_cli.storage.readers.files import relative_name

MOST_FILES = 5


def dataset_of(data: Mapping[str, Any], folder: Path, measured: str, units: Mapping[str, str] | None = None) -> Dataset:
    """The dataset that a `data` section describes; DataError where it cannot be made."""
    model = Data.model_validate(data)
    known = {name: "kPa/s" if name == "pressure_rate" else default_unit(name) for name in model.quantities}
    try:
        return build_dataset(IngestSlice(data=model, measured=measured, component="static", units={**known, **(units or {})}), folder)
    except SpecError as fault:
        raise DataError(fault.message, fault.remedy) from fault


def raw_columns(group: Group, folder: Path) -> dict[str | int, list[Array]]:
    """Every column of numbers of a group, one array `(n,)` for each of a few files; columns of text and empty ones are missing.

    Raises DataError where no column is left.
    """
    columns = group.layout.columns
    try:
        return _read(group, folder, columns)
    except DataError:
        found: dict[str | int, list[Array]] = {}
        for column in columns:
            try:
                found |= _read(group, folder, (column,))
            except DataError as fault:
                last = fault
        if not found:
            raise last from None
        return found


def _read(group: Group, folder: Path, columns: Sequence[str | int]) -> dict[str | int, list[Array]]:
    names = {f"column_{place}": column for place, column in enumerate(columns)}
    data = {
        "files": [{"path": relative_name(file, folder), "id": str(place)} for place, file in enumerate(_some(group.files))],
        "reader": group.layout.reader,
        **group.layout.settings,
        "columns": {name: {"column": column} for name, column in names.items()},
        "missing": "drop",
    }
    recordings = dataset_of(data, folder, next(iter(names)), dict.fromkeys(names, "1")).recordings
    return {column: [np.asarray(recording.columns[name]) for recording in recordings] for name, column in names.items()}


def _some(files: Sequence[Path]) -> Sequence[Path]:
    """A few files from all over the list: columns are the same in all, and files can be many and large."""
    return files[:: -(-len(files) // MOST_FILES)]
