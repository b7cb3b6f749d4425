"""HDF5 files: groups, datasets, and the fields of compound datasets, addressed as `group/dataset[:,0]`; and those that MATLAB wrote.

`root: "group[*]"` takes the members of a group in natural order (run_2 before run_10). Only the wanted columns are read.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import TableRequest, reading, refuse_bombs
from mapmore_cli.storage.tables.members import Member, Selection, group_of, tree_reader


@contextmanager
def opened_hdf5(path: Path, label: str, _request: TableRequest | None = None, kind: str = "HDF5 file") -> Iterator[Member]:
    """Open an HDF5 file; one that MATLAB wrote is read as the MAT file that it is.

    Raises DataError for no HDF5 file, a damaged one, and one that points into other files.
    """
    import h5py

    with reading(label, kind), path.open("rb") as stream, h5py.File(stream, "r") as file:
        _refuse_other_files(file, label)
        members = (file.get(name) for name in file)  # None for a link that leads nowhere
        by_matlab = any("MATLAB_class" in member.attrs for member in members if member is not None)
        yield _matlab_struct(file, "the file") if by_matlab or kind == "MAT file" else _member(file)


def _member(found: Any) -> Member:
    if hasattr(found, "keys"):
        return group_of(f"a group of {len(found)}", list(found), lambda name: _member(found[name]))
    fields = found.dtype.names
    size = " x ".join(map(str, found.shape)) or "a single value"
    if fields:
        read = {name: _reader(found, name) for name in fields}
        return Member(f"a table of {size}", fields, member=lambda name: Member(f"a field of {size}", values=read[name], shape=found.shape))
    return Member(f"an array of {size}", values=_reader(found, None), shape=found.shape)


def _reader(dataset: Any, field: str | None) -> Callable[[Selection], Any]:
    def read(selection: Selection) -> Any:
        _check_fit(selection, dataset.shape)
        values = _own_values(dataset, selection)
        return values[selection] if field is None else values.fields(field)[selection]

    return read


# As MATLAB 7.3 writes them: the axes lie in the opposite order, and cells and elements of struct arrays are references ------------------


def _matlab_struct(group: Any, kind: str = "a struct") -> Member:
    names = [name for name in group if not name.startswith("#")]  # #refs# and #subsystem# are MATLAB's own

    def member(name: str) -> Member:
        return _matlab_member(group[name])

    return group_of(kind, names, member) if kind == "the file" else Member(kind, names, member=member)


def _matlab_member(found: Any) -> Member:
    if found.attrs.get("MATLAB_object_decode"):
        raise object_of_matlab(found.name.lstrip("/"), _class_of(found))
    if not hasattr(found, "keys"):
        return _cell_array(found) if _class_of(found) == "cell" and _holds_references(found) else _array(found)
    fields = list(found.values())
    if not fields or not all(_holds_references(field) and not _class_of(field) for field in fields):
        return _matlab_struct(found)
    names = list(found)  # of a struct array: each is an array of references, one for each element

    def element(index: int) -> Member:
        return Member(f"element {index} of a struct array", names, member=lambda name: _referred(found[name], index))

    return Member(f"a struct array of {fields[0].size}", count=int(fields[0].size), element=element)


def _cell_array(dataset: Any) -> Member:
    if dataset.attrs.get("MATLAB_empty"):
        return Member("an empty cell array", count=0)
    size = " x ".join(map(str, reversed(dataset.shape)))
    return Member(f"a cell array of {size}", count=int(dataset.size), element=lambda index: _referred(dataset, index))


def _array(dataset: Any) -> Member:
    if dataset.attrs.get("MATLAB_empty"):  # what is stored then is the size
        return Member("an empty array", values=lambda _: np.zeros(0))
    if _class_of(dataset) == "char":  # stored as numbers: UTF-16
        return Member("text", values=lambda _: np.array([b"text"]))
    if dataset.dtype.names:  # real and imag
        return Member("an array of complex numbers", values=lambda _: np.zeros(1, dtype=np.complex128))
    shape = dataset.shape[::-1]

    def read(selection: Selection) -> Any:
        _check_fit(selection, shape)
        whole = (*selection, *(slice(None),) * (len(shape) - len(selection)))
        return np.transpose(_own_values(dataset, whole[::-1])[whole[::-1]])

    return Member(f"an array of {' x '.join(map(str, shape))}", values=read, shape=shape)


def _class_of(found: Any) -> str:
    name = found.attrs.get("MATLAB_class", b"")
    return name.decode() if isinstance(name, bytes) else str(name)


def _holds_references(found: Any) -> bool:
    return getattr(found, "dtype", None) == np.dtype("O")


def _referred(dataset: Any, index: int) -> Member:
    """Return what a reference leads to, by its number in MATLAB's order."""
    return _matlab_member(dataset.file[_own_values(dataset)[()].reshape(-1)[index]])


def object_of_matlab(name: str, of_class: str) -> DataError:
    """Return what is told of a value whose parts MATLAB alone can make out."""
    return DataError(
        f"'{name}' is an object of MATLAB ({of_class or 'a table, datetime, timeseries, string or the like'}), not an array of numbers",
        "save plain arrays in MATLAB: `S = table2struct(T, 'ToScalar', true); save('log.mat', '-struct', 'S')`, or use `writetable`",
    )


# What is refused before a value is read -------------------------------------------------------------------------------------------------

_read: ContextVar[dict[str, int]] = ContextVar("_read")
"""Bytes of each array of the open file that was read so far, by its name."""


def _refuse_other_files(file: Any, label: str) -> None:
    """Raise DataError for links to other files, before one is followed: they may lead anywhere on this computer."""
    from h5py import h5l

    def other(name: bytes, info: Any) -> bytes | None:
        return name if info.type == h5l.TYPE_EXTERNAL else None

    if name := file.id.links.visit(other, info=True):
        raise DataError(f"{label}: '{name.decode(errors='replace')}' is a link to another file", "name that file itself in `files`")
    _read.set({})


def _own_values(dataset: Any, selection: Selection = ()) -> Any:
    """Return the dataset, of which a selection is read next.

    Raises DataError where its values lie in other files (external storage, virtual datasets), and where all that was asked for of its file
    is far larger than the file.
    """
    if dataset.external or dataset.is_virtual:
        raise DataError(f"{dataset.name} takes its values from other files", "write the values into the file itself")
    read = _read.get({})
    lengths = [1 if isinstance(one, int) else length for one, length in zip_longest(selection, dataset.shape)]
    read[f"{dataset.name}{selection}"] = math.prod(lengths) * dataset.dtype.itemsize
    refuse_bombs(dataset.name, sum(read.values()), dataset.file.id.get_filesize())
    return dataset


def _check_fit(selection: Selection, shape: Sequence[int]) -> None:
    """Raise IndexError, as NumPy does and h5py does not, for a selection beyond an array of a shape."""
    if len(selection) > len(shape) or any(isinstance(i, int) and i >= n for i, n in zip(selection, shape, strict=False)):
        raise IndexError(selection)


READER = tree_reader("hdf5", opened_hdf5, (".h5", ".hdf5"), "group/dataset")
