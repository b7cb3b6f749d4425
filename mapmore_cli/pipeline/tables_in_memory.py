"""Read the columns of a study from tables in memory, which are mappings of arrays or data
frames.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence
from numbers import Integral
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.pipeline.frames import Door, labels_of
from mapmore_cli.storage.atomic import make_folder, replacing
from mapmore_cli.storage.outputs import note_chosen, refuse_foreign_file
from mapmore_cli.storage.tables import IN_MEMORY, RawTable, known_names
from mapmore_cli.storage.tables.cells import CellReader
from mapmore_cli.study.fields import as_target
from mapmore_cli.study.sections.logs import SourceColumn
from mapmore_cli.study.units import convert, default_unit, is_canonical

Column = str | int

Frame = Any
"""Any table: a mapping of arrays, or a data frame of pandas, polars or pyarrow."""

Entry = Column | Mapping[str, Any]
"""Entry of `columns` for a quantity, as in YAML."""


def columns_in(frame: object, column: Column) -> list[Hashable]:
    """Return the labels of all columns of a frame that the value `column` in a spec can mean. The
    list is empty if there is no such column, and has several labels if the value is ambiguous.

    A text means the labels that are equal to it. If there is none, it means the labels that are
    written in the same way: "2" means the label 2. A number means the labels that are equal to it.
    In a frame whose labels are not numbers, it is the index of a column, counted from 0.
    """
    labels = labels_of(frame) or ()
    exact: list[Hashable] = [
        label for label in labels if type(label) is not bool and label == column
    ]
    if isinstance(column, str):
        return exact or [label for label in labels if str(label) == column]
    numbered = any(isinstance(label, Integral) for label in labels)
    return exact if numbered or not 0 <= column < len(labels) else [labels[column]]


def canonical_columns(frame: object, target: object) -> dict[str, dict[str, str]]:
    """Return a section `columns`, as in a spec, for a frame. It contains the columns whose labels
    are quantities that mapmore knows, for example `pressure`. But if the `target` is the label of a
    column, it contains all columns whose labels can be names of quantities. Raises SpecError if it
    would be empty.
    """
    names = tuple(map(str, labels_of(frame) or ()))
    section = as_target(target)
    is_own = isinstance(section, dict) and section.get("column") in names
    usable = filter(str.isidentifier if is_own else is_canonical, names)
    columns = {name: {"column": name} for name in usable}
    if not columns:
        known = known_names("", names, "The frame has")
        raise SpecError(
            "columns: no column of the frame has the name of a quantity that mapmore knows, such "
            "as pressure, strain or force",
            f'assign the columns: columns={{"force": {{"column": "F"}}}}. {known}',
        )
    return columns


def with_canonical_columns(
    frames: Sequence[object], columns: Mapping[str, Any], made: Collection[str]
) -> dict[str, Any]:
    """Return the section `columns` with further columns added. A column is added if four conditions
    are fulfilled: its label is a quantity that mapmore knows, for example `pressure`; all frames
    have it; the section does not use it for another quantity; and the quantity is not derived from
    others (`made`). The entries that the section already has are unchanged.
    """
    frame, *others = frames
    used = {label for entry in columns.values() for label in columns_in(frame, source_of(entry))}
    added = {
        str(label): {"column": str(label)}
        for label in labels_of(frame) or ()
        if label not in used
        and str(label) not in made
        and is_canonical(str(label))
        and all(label in (labels_of(other) or ()) for other in others)
    }
    return {**added, **columns}


def column_of(
    frame: Frame, column: Column, label: str, name: str, unit: str, layout: str | None = None
) -> Array:
    """Return a column of a frame, (n,), as the values of the quantity `name` in `unit`. `label` is
    the name of the frame in messages, and `layout` is the format of time stamps. Raises DataError
    if the column does not exist or cannot be converted.
    """
    labels, matches, label_of_column = (
        labels_of(frame) or (),
        columns_in(frame, column),
        f"{label}: column '{column}'",
    )
    if not matches:
        known = known_names(str(column), tuple(map(str, labels)), "The frame has")
        raise DataError(f"{label}: there is no column '{column}'", known)
    if len(matches) > 1 or labels.count(matches[0]) > 1:
        raise DataError(
            f"{label_of_column} exists more than once", "give each column a name of its own"
        )
    values = given_numbers(frame[matches[0]], label_of_column, name, unit, layout)
    if values.ndim != 1:
        raise DataError(
            f"{label_of_column} has the shape {values.shape}",
            "give one-dimensional arrays of equal length",
        )
    return values


def given_numbers(
    values: object, label: str, name: str, unit: str, layout: str | None = None
) -> Array:
    """Convert the values that a user passed for the quantity `name` to numbers in `unit`. `layout`
    is the format of time stamps, and `label` is the name of the values in messages.

    Raises DataError for values that cannot be converted.
    """
    clock = name == "time"
    read = CellReader(clock=clock, format=layout, second=convert(1.0, "s", unit) if clock else 1.0)
    return Door(
        lambda numbers, unit_of_column: convert(numbers, unit_of_column, unit), read, clock
    ).numbers(values, label)


def tables_of(
    frames: Sequence[Frame], columns: Mapping[str, Entry], units: Mapping[str, str]
) -> dict[str, RawTable]:
    """Return every frame as a recording in memory, by the name of the recording. A recording has an
    array, (n,), for each quantity of `columns`. The `scale` and `offset` in `columns` are not
    applied yet. `columns` and `units` are sections as in a spec.

    Raises `DataError` for columns that do not exist, are no numbers, or differ in length.
    """
    tables = {}
    titles = {name: repr(source_of(entry)) for name, entry in columns.items()}
    for number, frame in enumerate(frames, start=1):
        label = f"frame {number}" if len(frames) > 1 else "the frame"
        arrays = {}
        for name, entry in columns.items():
            settings = entry if isinstance(entry, Mapping) else {}
            unit = str(settings.get("unit") or default_unit(name, units))
            column = column_of(
                frame, source_of(entry), label, name, unit, settings.get("format")
            ).view()
            # the array may belong to the caller, so it must stay unchanged
            column.flags.writeable = False
            arrays[name] = column
        lengths = {name: len(values) for name, values in arrays.items()}
        if len(set(lengths.values())) > 1:
            raise DataError(
                f"{label}: columns of different length: {lengths}",
                "give columns of one recording, which all have the same length",
            )
        rows = range(max(lengths.values(), default=0))
        tables[f"recording_{number}"] = RawTable(arrays, rows, label, IN_MEMORY, titles=titles)
    return tables


def section_of(tables: Iterable[str], columns: Mapping[str, Entry]) -> dict[str, object]:
    """Return the section `data`, as in a spec, with which the tables in memory are read. `columns`
    is the section that the caller gave. In the result, every column is called by the name of its
    quantity, because the tables in memory have these names.
    """
    read = {}
    for name, entry in columns.items():
        read[name] = {**(entry if isinstance(entry, Mapping) else {}), "column": name}
        if name == "time":
            # time stamps have already been converted to numbers
            read[name].pop("format", None)
    return {"files": [*tables], "reader": "hdf5", "columns": read}


def write_tables(tables: Mapping[str, RawTable], folder: Path) -> list[Path]:
    """Write every table in memory to a separate HDF5 file in `folder`, and return their paths. If a
    file exists that mapmore did not write, no file is written, and WriteError is raised as by
    `refuse_foreign_file`.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    make_folder(folder)
    paths = [folder / f"{name}.h5" for name in tables]
    for path in paths:
        refuse_foreign_file(path)
    for path, table in zip(paths, tables.values(), strict=True):
        with replacing(path) as raw, h5py.File(raw, "w") as file:
            file.attrs["creator"] = "mapmore"
            for name, values in table.columns.items():
                file.create_dataset(name, data=values)
    note_chosen(folder, [path.name for path in paths])
    return paths


def source_of(entry: object) -> Column:
    """Return the `column` in an entry of the section `columns`. Raises SpecError if the entry has a
    wrong form.
    """
    source = entry.get("column") if isinstance(entry, Mapping) else entry
    if not isinstance(source, str | int):
        raise SpecError(
            "columns: an entry does not name its column",
            'write columns={"force": {"column": "F", "unit": "N"}}',
        )
    return source


def quantities_of(
    frame: object,
    wanted: Sequence[str],
    columns: Mapping[str, SourceColumn],
    units: Mapping[str, str],
) -> dict[str, Array]:
    """Return the `wanted` quantities of a frame in the model's `units`, (n,) each.

    For each quantity, three ways to find its column are tried in this order. First, `columns` gives
    the label of the column, with unit, scale and offset. Second, the label of a column is the name
    of the quantity, and the column has numbers in the model's unit. Third, `columns` gives the
    index of the column.
    """
    values_of = {}
    for name in wanted:
        column, unit = columns.get(name), units.get(name) or default_unit(name)
        numbered = (
            column is not None and isinstance(column.column, int) and not columns_in(frame, name)
        )
        if column is not None and (numbered or columns_in(frame, str(column.column))):
            unit_of_column = column.unit or unit
            values = column_of(
                frame,
                column.column,
                "the frame",
                name,
                unit_of_column,
                column.formats.get(column.column),
            )
            values = values * column.scale + column.offset
            values_of[name] = convert(values, unit_of_column, unit)
        else:
            values_of[name] = column_of(frame, name, "the frame", name, unit)
    return values_of


def plain_values(section: Mapping[str, object]) -> dict[str, Any]:
    """Convert the values of a section to types that YAML has. Tuples and arrays become lists, NumPy
    scalars become numbers, and paths become texts.
    """
    return {str(key): _plain_value(value) for key, value in section.items()}


def _plain_value(value: object) -> object:
    if isinstance(value, Mapping):
        return plain_values(value)
    if isinstance(value, list | tuple):
        return [_plain_value(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return str(value) if isinstance(value, Path) else value
