"""Tables that are in memory already: mappings of arrays and data frames, as the files that the pipeline reads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.spec.sections.logs import SourceColumn
from mapmore_cli.spec.units import convert, default_unit, is_canonical
from mapmore_cli.storage.tables import known_names
from mapmore_cli.storage.tables.members import as_numbers

Column = str | int


def is_frame(table: Any) -> bool:
    """Return True for a mapping of arrays, a structured array, and anything with `columns` that is indexed by them, as data frames are."""
    return isinstance(table, Mapping) or hasattr(table, "columns") or getattr(getattr(table, "dtype", None), "names", None) is not None


def names_of(frame: Any) -> tuple[str, ...]:
    """Return the names of a frame's columns."""
    if isinstance(frame, Mapping):
        return tuple(map(str, frame))
    return tuple(map(str, frame.columns if hasattr(frame, "columns") else frame.dtype.names))


def canonical_columns(frame: Any) -> dict[str, dict[str, str]]:
    """Return the section `columns` of a frame whose columns have canonical names; raises `SpecError` where none has."""
    found = {name: {"column": name} for name in names_of(frame) if is_canonical(name)}
    if not found:
        known = known_names("", names_of(frame), "The frame has")
        raise SpecError(
            "columns: no column of the frame has a canonical name", f'say which is which: columns={{"force": {{"column": "F"}}}}. {known}'
        )
    return found


def column_of(frame: Any, column: Column, label: str) -> Array:
    """One column as numbers, (n,); time stamps are seconds since 1970. Raises `DataError`."""
    names = names_of(frame)
    if isinstance(column, int) and not isinstance(column, bool):
        if not 0 <= column < len(names):
            raise DataError(f"{label}: there is no column {column}", f"it has {len(names)} columns, numbered from 0")
        column = names[column]
    if column not in names:
        raise DataError(f"{label}: there is no column '{column}'", known_names(str(column), names, "The frame has"))
    values = np.asarray(frame[column])
    if values.dtype == object:  # missing values in a column of numbers
        try:
            values = np.array([np.nan if value is None else float(value) for value in values])
        except (TypeError, ValueError) as error:
            raise DataError(f"{label}: column '{column}' holds values that are no numbers: {error}") from error
    if values.ndim != 1:
        raise DataError(f"{label}: column '{column}' has the shape {values.shape}", "give one-dimensional arrays of one length")
    return as_numbers(values, f"{label}: column '{column}'")


def write_frames(frames: Sequence[Any], columns: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Write the wanted columns of every frame to an HDF5 file of its own in `folder`; the keys of `data` that read them.

    A file has one array for each quantity of `columns` (the section of the spec), unscaled. Raises `DataError` for columns that do not
    exist, are no numbers, or differ in length.
    """
    paths = []
    for number, frame in enumerate(frames, start=1):
        label = f"frame {number}" if len(frames) > 1 else "the frame"
        arrays = {name: column_of(frame, source_of(entry), label) for name, entry in columns.items()}
        lengths = {name: len(values) for name, values in arrays.items()}
        if len(set(lengths.values())) > 1:
            raise DataError(f"{label}: columns of different length: {lengths}", "they do not belong to one recording")
        folder.mkdir(parents=True, exist_ok=True)
        paths.append(folder / f"recording_{number}.h5")
        with h5py.File(paths[-1], "w") as file:
            for name, values in arrays.items():
                file.create_dataset(name, data=values, track_times=False)
    read = {name: {**(entry if isinstance(entry, Mapping) else {}), "column": name} for name, entry in columns.items()}
    return {"files": [str(path) for path in paths], "reader": "hdf5", "columns": read}


def source_of(entry: Any) -> Column:
    """Return the column that an entry of `columns` names; raises `SpecError` for another form."""
    found = entry.get("column") if isinstance(entry, Mapping) else entry
    if not isinstance(found, str | int):
        raise SpecError("columns: an entry names no column", 'write columns={"force": {"column": "F", "unit": "N"}}')
    return found


def quantities_of(frame: Any, wanted: Sequence[str], columns: Mapping[str, SourceColumn], units: Mapping[str, str]) -> dict[str, Array]:
    """Return the `wanted` quantities of a frame in the model's `units`, (n,) each.

    A column is found by its name in `columns`, with unit, scale and offset; else by the canonical name, already in the model's unit; else
    by its number in `columns`.
    """
    names, found = names_of(frame), {}
    for name in wanted:
        column = columns.get(name)
        if column is not None and (column.column in names or (isinstance(column.column, int) and name not in names)):
            values = column_of(frame, column.column, "the frame") * column.scale + column.offset
            unit = units.get(name) or default_unit(name)
            found[name] = convert(values, column.unit, unit) if column.unit is not None else values
        else:
            found[name] = column_of(frame, name, "the frame")
    return found
