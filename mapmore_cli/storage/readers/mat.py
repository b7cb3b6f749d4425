"""MATLAB files: versions 4 to 7 through SciPy, version 7.3 through HDF5; the content decides, not the name."""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables.members import (
    EVERY,
    Member,
    Selection,
    check_fit,
    natural,
    own_values,
    parse_address,
    refuse_bombs,
    refuse_other_files,
    tables,
)
from mapmore_cli.storage.tables.table import RawTable, Reader, TableRequest, Top, reading
from mapmore_cli.storage.tables.trees import top_of

COMPRESSED = 15
"""The type of a packed element in a file of version 5."""


def read_mat(path: Path, request: TableRequest) -> list[RawTable]:
    """Read arrays addressed as `run.P`, `train[3].y[:,0]`; `root: "train[*]"` takes every element of a cell or struct array.

    Indices count from 0; cell and struct arrays have one index, in MATLAB's order. Only the variables that are named are read.

    Raises
    ------
    DataError
        No MAT file, or a damaged one; an address that leads nowhere or to a MATLAB object (a table, datetime, ...); arrays that are not
        columns of real numbers of one length.
    """
    import h5py

    with reading(request.label, "MAT file"), path.open("rb") as stream:
        if h5py.is_hdf5(path):
            with h5py.File(stream, "r") as file:
                refuse_other_files(file, request.label)
                return tables(matlab_file(file), request)
        return tables(_variables(stream, request, request.label), request)


def peek_mat(path: Path, most: int) -> Iterable[Top]:
    """Return the first rows of the log that a file holds."""
    import h5py

    with reading(path.name, "MAT file"), path.open("rb") as stream:
        if h5py.is_hdf5(path):
            with h5py.File(stream, "r") as file:
                refuse_other_files(file, path.name)
                return [top_of(matlab_file(file), most, ".")]
        return [top_of(_variables(stream, None, path.name), most, ".")]


def _refuse_packed(stream: Any, label: str) -> None:
    """Unpack each element of a file of version 5 without keeping it, and refuse one that is far larger than the file."""
    size = os.fstat(stream.fileno()).st_size
    head, unpacked = stream.read(128), 0
    order = {b"IM": "<", b"MI": ">"}.get(head[126:128])
    while order and len(tag := stream.read(8)) == 8:
        kind, length = struct.unpack(f"{order}II", tag)
        if kind != COMPRESSED:
            stream.seek(length, os.SEEK_CUR)
            continue
        unpacker, rest = zlib.decompressobj(), stream.read(length)
        while rest and not unpacker.eof:
            unpacked += len(unpacker.decompress(rest, 1 << 20))
            rest = unpacker.unconsumed_tail
            refuse_bombs(label, unpacked, size)
    stream.seek(0)


def _variables(stream: Any, request: TableRequest | None, label: str) -> Member:
    """Return the variables of a file, of which those that the request names are loaded; all without one."""
    from scipy.io import loadmat, whosmat

    _refuse_packed(stream, label)
    if request is None:
        loaded = _by_own_name(loadmat(stream))
        return _file(list(loaded), lambda name: _member(loaded[name], name))
    addresses = [request.root] if request.root else [column for column in request.columns if isinstance(column, str)]
    firsts = [step for address in addresses for step in parse_address(address.removesuffix(EVERY)).steps[:1]]
    wanted = {step for step in firsts if isinstance(step, str)}
    try:
        known = {name for name, _, _ in whosmat(stream)}
    except TypeError:  # SciPy cannot list what holds objects of MATLAB, whose names are hidden in them
        known = wanted
    wanted = known if request.root == EVERY else wanted
    stream.seek(0)
    loaded = _by_own_name(loadmat(stream, variable_names=[*sorted(wanted & known), OBJECT]))
    for name in sorted(wanted & known - {*loaded}):
        raise _is_object(name, "")
    return _file(sorted(known), lambda name: _member(loaded[name], name))


OBJECT = "None"
"""What SciPy calls every object of MATLAB; of several it keeps the last."""


def _by_own_name(loaded: Mapping[str, Any]) -> dict[str, Any]:
    """Return the variables, an object under the name that its file has for it."""
    from scipy.io.matlab import MatlabOpaque

    named = {name: value for name, value in loaded.items() if not name.startswith("__")}
    if isinstance(named.get(OBJECT), MatlabOpaque):
        hidden = named.pop(OBJECT)
        named[hidden["s0"].item().decode(errors="replace")] = hidden
    return named


def _class_of_object(value: Any) -> str:
    """Return the class of an object, a function or what SciPy keeps closed."""
    from scipy.io.matlab import MatlabFunction, MatlabOpaque

    if isinstance(value, MatlabFunction):
        return "a function"
    if isinstance(value, MatlabOpaque):
        return str(value["s2"].item().decode(errors="replace"))
    return str(getattr(value, "classname", "") or "")


def _file(names: Sequence[str], member: Callable[[str], Member]) -> Member:
    """Return the variables of a file, each of which may be a recording."""
    in_order = sorted(names, key=natural)
    return Member("the file", names, member=member, count=len(names), element=lambda number: member(in_order[number]))


def _is_object(name: str, of_class: str) -> DataError:
    """Return what is told of a value whose parts MATLAB alone can make out."""
    return DataError(
        f"'{name}' is an object of MATLAB ({of_class or 'a table, datetime, timeseries, string or the like'}), not an array of numbers",
        "save plain arrays in MATLAB: `S = table2struct(T, 'ToScalar', true); save('log.mat', '-struct', 'S')`, or use `writetable`",
    )


def _member(value: Any, name: str) -> Member:
    """Return a value as SciPy gives it: structs are arrays with fields, cells are arrays of objects."""
    from scipy.io.matlab import MatlabFunction, MatlabObject, MatlabOpaque

    if isinstance(value, MatlabFunction | MatlabObject | MatlabOpaque):
        raise _is_object(name, _class_of_object(value))
    if hasattr(value, "toarray"):  # sparse
        value = value.toarray()
    flat = value.reshape(-1, order="F")
    size = " x ".join(map(str, value.shape))
    fields = value.dtype.names
    if fields and value.size == 1:
        return Member("a struct", fields, member=lambda field: _member(flat[0][field], f"{name}.{field}"))
    if fields:
        return Member(f"a struct array of {value.size}", count=value.size, element=lambda i: _member(flat[i : i + 1], f"{name}[{i}]"))
    if value.dtype == np.dtype("O"):
        return Member(f"a cell array of {size}", count=value.size, element=lambda index: _member(flat[index], f"{name}[{index}]"))

    def select(selection: Selection) -> Any:
        return value[selection]

    return Member(f"an array of {size}", values=select, shape=value.shape)


def matlab_file(file: Any) -> Member:
    """Return the variables of an open h5py file that MATLAB wrote: the axes lie in the opposite order, and cells are references."""
    top = _struct(file, "the file")
    return _file(top.names, top.member)


def _hdf5_member(found: Any) -> Member:
    if found.attrs.get("MATLAB_object_decode"):
        raise _is_object(found.name.lstrip("/"), _class_of(found))
    if hasattr(found, "keys"):
        fields = list(found.values())
        is_array = bool(fields) and all(_holds_references(field) and not _class_of(field) for field in fields)
        return _struct_array(found) if is_array else _struct(found, "a struct")
    return _cell_array(found) if _class_of(found) == "cell" and _holds_references(found) else _array(found)


def _struct(group: Any, kind: str) -> Member:
    names = [name for name in group if not name.startswith("#")]  # #refs# and #subsystem# are MATLAB's own
    return Member(kind, names, member=lambda name: _hdf5_member(group[name]))


def _struct_array(group: Any) -> Member:
    """Return a group whose members are arrays of references, one for each element."""
    names = list(group)
    count = int(group[names[0]].size)

    def element(index: int) -> Member:
        return Member(
            f"element {index} of a struct array", names, member=lambda name: _hdf5_member(group.file[_references(group[name])[index]])
        )

    return Member(f"a struct array of {count}", count=count, element=element)


def _cell_array(dataset: Any) -> Member:
    if dataset.attrs.get("MATLAB_empty"):
        return Member("an empty cell array", count=0)
    return Member(
        f"a cell array of {' x '.join(map(str, reversed(dataset.shape)))}",
        count=int(dataset.size),
        element=lambda index: _hdf5_member(dataset.file[_references(dataset)[index]]),
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
        return np.transpose(own_values(dataset, whole[::-1])[whole[::-1]])

    return Member(f"an array of {' x '.join(map(str, shape))}", values=read, shape=shape)


def _class_of(found: Any) -> str:
    name = found.attrs.get("MATLAB_class", b"")
    return name.decode() if isinstance(name, bytes) else str(name)


def _holds_references(found: Any) -> bool:
    return getattr(found, "dtype", None) == np.dtype("O")


def _references(dataset: Any) -> Any:
    """Return the references of a dataset in MATLAB's order."""
    return own_values(dataset)[()].reshape(-1)


READER = Reader("mat", read_mat, suffixes=(".mat",), keys=("root",), column="run.P", peek=peek_mat)
