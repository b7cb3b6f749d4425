"""Read archives of NumPy arrays (.npz). An array is addressed by its name, and a field of a
structured array as a member of this array.
"""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from numpy.lib import format as npy

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import TableRequest, reading, refuse_bombs
from mapmore_cli.storage.tables.members import Member, Values, array_of, group_of, table_of_fields
from mapmore_cli.storage.tables.overview import tree_reader


@contextmanager
def opened_npz(path: Path, label: str, _request: TableRequest | None) -> Iterator[Member]:
    """Open an archive. An array is read only when it is needed. Arrays of Python objects are
    refused, because reading them could run code.

    Raises DataError if the file is no archive, is damaged, or unpacks to far more than its size.
    """
    with reading(label, "NumPy archive (.npz)"), zipfile.ZipFile(path) as archive:
        names = [entry.filename.removesuffix(".npy") for entry in archive.infolist()]
        size = path.stat().st_size
        parts = dict(zip(names, archive.infolist(), strict=True))
        yield group_of("the file", names, lambda name: _npz_array(archive, parts[name], size))


def _npz_array(archive: zipfile.ZipFile, part: zipfile.ZipInfo, size: int) -> Member:
    """Return an array in an archive of `size` bytes. The sizes that the archive declares are
    checked first, because they may be wrong.
    """
    name = part.filename.removesuffix(".npy")
    refuse_bombs(f"'{name}'", part.file_size, min(part.compress_size, size))
    with archive.open(part) as stream:
        header = (
            npy.read_array_header_1_0
            if npy.read_magic(stream) == (1, 0)
            else npy.read_array_header_2_0
        )
        shape, _, kind = header(stream)
    if kind.hasobject:
        raise DataError(
            f"'{name}' is an array of Python objects, which are not read",
            "save it as an array of numbers: `values.astype(float)`",
        )
    count = math.prod(shape)
    if count * kind.itemsize > part.file_size or (count and not kind.itemsize):
        raise ValueError(f"'{name}' declares more values than it holds")

    def values() -> Values:
        with archive.open(part) as stream:
            return npy.read_array(stream, allow_pickle=False)  # a pickle could run code

    if kind.names:
        return table_of_fields(kind.names, shape, lambda field: lambda at: values()[field][at])
    return array_of(lambda selection: values()[selection], shape)


READER = tree_reader(
    "npz", opened_npz, (".npz",), "force", begins=rb"PK\x03\x04.{26}[^\0]{1,200}?\.npy"
)
