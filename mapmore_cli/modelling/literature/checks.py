"""Columns that must be there, and finite."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.errors import DataError


def needed(name: str, columns: Columns) -> Array:
    """The column `name`; raises `DataError` where it is absent."""
    if name not in columns:
        raise DataError(f"there is no column `{name}` among the inputs", "declare it under `columns` or `derive`")
    return np.asarray(columns[name], dtype=float)


def finite(name: str, column: Array) -> Array:
    """The column; raises `DataError` with the first row in which it is not finite."""
    values = np.asarray(column, dtype=float)
    if not np.isfinite(values).all():
        row = int(np.argmin(np.isfinite(values)))
        raise DataError(f"{name} is not finite in row {row}: {values[row]}", "drop the sample (`missing: drop`) or mend the recording")
    return values
