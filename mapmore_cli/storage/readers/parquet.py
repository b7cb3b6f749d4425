"""Read tables in the Parquet format with pyarrow; columns are addressed by name."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import (
    Noted,
    TableRequest,
    reading,
    refuse_bombs,
)
from mapmore_cli.storage.tables.members import Member, Selection, Values, array_of
from mapmore_cli.storage.tables.overview import tree_reader

if TYPE_CHECKING:
    from pyarrow import Field
    from pyarrow.parquet import ParquetFile

UNIT = ("unit", "units")
"""Keys under which programs store the unit of a column, in small or capital letters."""


@contextmanager
def opened_parquet(path: Path, label: str, _request: TableRequest | None) -> Iterator[Member]:
    """Open a table. A missing value (null) becomes NaN.

    Raises DataError if the file is no Parquet file, is damaged, or declares far more values than
    its size can hold.
    """
    from pyarrow import parquet

    with reading(label, "Parquet file"), path.open("rb") as stream:
        file = parquet.ParquetFile(stream, page_checksum_verification=True)
        size = path.stat().st_size
        refuse_bombs(f"{label}: each column", 8 * file.metadata.num_rows, size)
        fields = {field.name: field for field in file.schema_arrow}
        names = file.schema_arrow.names
        kind = f"a table of {len(names)} columns"
        yield Member(kind, names, lambda name: _parquet_column(file, fields[name], size))


def _parquet_column(file: ParquetFile, field: Field, size: int) -> Member:
    """Return a column of a file of `size` bytes. Raises DataError for texts, lists or structs."""
    from pyarrow import types

    kind = field.type.value_type if types.is_dictionary(field.type) else field.type
    if not (types.is_primitive(kind) or types.is_decimal(kind) or types.is_null(kind)):
        raise DataError(
            f"column '{field.name}' holds values of type {kind}, not numbers",
            "write a column of numbers, for example with `frame.astype(float)` or `frame.explode`",
        )

    # a decimal number takes about a hundred bytes in memory, because it becomes a Python object
    if types.is_decimal(kind):
        refuse_bombs(f"'{field.name}'", 100 * file.metadata.num_rows, size)

    def values(selection: Selection) -> Values:
        column: Values = file.read(columns=[field.name]).column(0).to_numpy()
        return column[selection]

    return array_of(values, (file.metadata.num_rows,), Noted(_unit_noted(file, field)))


def _unit_noted(file: ParquetFile, field: Field) -> str:
    """Return the unit in the metadata of a column, or in the `attrs` of a pandas frame."""
    metadata = {key.decode().casefold(): value for key, value in (field.metadata or {}).items()}
    for key in UNIT:
        if key in metadata:
            return str(metadata[key].decode(errors="replace"))
    with suppress(ValueError, KeyError, AttributeError):
        attributes = json.loads((file.schema_arrow.metadata or {})[b"pandas"])["attributes"]
        for key in UNIT:
            if text := attributes.get(key, {}).get(field.name):
                return str(text)
    return ""


READER = replace(
    tree_reader("parquet", opened_parquet, (".parquet",), "force", by_index=False, begins=b"PAR1"),
    # the keys for numbers in texts, such as `decimal`, are left out, because columns of texts are
    # refused
    keys=("root",),
)
