"""MAT files of version 7.3: HDF5 inside, with the axes in the opposite order and cells as references."""

from __future__ import annotations

from typing import Any

import numpy as np

from mapmore_cli.storage.readers.addresses import Selection
from mapmore_cli.storage.readers.members import Member, check_fit


def matlab_file(file: Any) -> Member:
    """Return the variables of an open h5py file that MATLAB wrote."""
    return _struct(file, "the file")


def _member(found: Any) -> Member:
    if hasattr(found, "keys"):
        fields = list(found.values())
        is_array = bool(fields) and all(_holds_references(field) and not _class_of(field) for field in fields)
        return _struct_array(found) if is_array else _struct(found, "a struct")
    return _cell_array(found) if _class_of(found) == "cell" and _holds_references(found) else _array(found)


def _struct(group: Any, kind: str) -> Member:
    names = [name for name in group if not name.startswith("#")]  # #refs# and #subsystem# are MATLAB's own
    return Member(kind, names, member=lambda name: _member(group[name]))


def _struct_array(group: Any) -> Member:
    """Return a group whose members are arrays of references, one for each element."""
    names = list(group)
    count = int(group[names[0]].size)

    def element(index: int) -> Member:
        return Member(f"element {index} of a struct array", names, member=lambda name: _member(group.file[_references(group[name])[index]]))

    return Member(f"a struct array of {count}", count=count, element=element)


def _cell_array(dataset: Any) -> Member:
    if dataset.attrs.get("MATLAB_empty"):
        return Member("an empty cell array", count=0)
    return Member(
        f"a cell array of {' x '.join(map(str, reversed(dataset.shape)))}",
        count=int(dataset.size),
        element=lambda index: _member(dataset.file[_references(dataset)[index]]),
    )


def _array(dataset: Any) -> Member:
    if dataset.attrs.get("MATLAB_empty"):  # what is stored then is the size
        return Member("an empty array", values=lambda _: np.zeros(0))
    if _class_of(dataset) == "char":  # stored as numbers: UTF-16
        return Member("text", values=lambda _: np.zeros(1, dtype=np.str_))
    if dataset.dtype.names:  # real and imag
        return Member("an array of complex numbers", values=lambda _: np.zeros(1, dtype=np.complex128))
    shape = dataset.shape[::-1]

    def read(selection: Selection) -> Any:
        check_fit(selection, shape)
        whole = (*selection, *(slice(None),) * (len(shape) - len(selection)))
        return np.transpose(dataset[whole[::-1]])

    return Member(f"an array of {' x '.join(map(str, shape))}", values=read)


def _class_of(found: Any) -> str:
    name = found.attrs.get("MATLAB_class", b"")
    return name.decode() if isinstance(name, bytes) else str(name)


def _holds_references(found: Any) -> bool:
    return getattr(found, "dtype", None) == np.dtype("O")


def _references(dataset: Any) -> Any:
    """Return the references of a dataset in MATLAB's order."""
    return dataset[()].reshape(-1)
