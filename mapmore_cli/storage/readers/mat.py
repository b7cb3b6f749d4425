"""MATLAB files: versions 4 to 7 through SciPy, version 7.3 through HDF5; the content decides, not the name.

Arrays are addressed as `run.P`, `train[3].y[:,0]`; `root: "train[*]"` takes every element of a cell or struct array. Indices count from 0;
cell and struct arrays have one index, in MATLAB's order. Only the variables that are named are read.
"""

from __future__ import annotations

import os
import struct
import warnings
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from mapmore_cli.storage.readers.hdf5 import object_of_matlab, opened_hdf5
from mapmore_cli.storage.tables import TableRequest, reading, refuse_bombs
from mapmore_cli.storage.tables.members import EVERY, Member, group_of, parse_address, tree_reader

KIND = "MAT file"
COMPRESSED = 15
"""The type of a packed element in a file of version 5."""

OBJECT = "None"
"""What SciPy calls every object of MATLAB; of several it keeps the last."""


@contextmanager
def opened_mat(path: Path, label: str, request: TableRequest | None) -> Iterator[Member]:
    """Open a file of any version.

    Raises DataError for no MAT file, or a damaged one; and for a MATLAB object (a table, datetime, ...) where a request names it.
    """
    import h5py

    with reading(label, KIND), path.open("rb") as stream, warnings.catch_warnings():
        warnings.filterwarnings("ignore", "The default value for `spmatrix`", DeprecationWarning)  # either kind has `toarray`
        if h5py.is_hdf5(path):
            with opened_hdf5(path, label, request, KIND) as top:
                yield top
        else:
            yield _variables(stream, request, label)


def _variables(stream: Any, request: TableRequest | None, label: str) -> Member:
    """Return the variables of a file, of which those that the request names are loaded; all without one."""
    from scipy.io import loadmat, whosmat

    _refuse_packed(stream, label)
    if request is None:
        loaded = _by_own_name(loadmat(stream))
        return group_of("the file", list(loaded), lambda name: _member(loaded[name], name))
    addresses = [request.root] if request.root else [column for column in request.columns if isinstance(column, str)]
    firsts = [step for address in addresses for step in parse_address(address.removesuffix(EVERY))[:1]]
    wanted = {step for step in firsts if isinstance(step, str)}
    try:
        known = {name for name, _, _ in whosmat(stream)}
    except TypeError:  # SciPy cannot list what holds objects of MATLAB, whose names are hidden in them
        known = wanted
    wanted = known if request.root == EVERY else wanted
    stream.seek(0)
    loaded = _by_own_name(loadmat(stream, variable_names=[*sorted(wanted & known), OBJECT]))
    for name in sorted(wanted & known - {*loaded}):
        raise object_of_matlab(name, "")
    return group_of("the file", sorted(known), lambda name: _member(loaded[name], name))


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
            refuse_bombs(f"{label}: the file", unpacked, size)
    stream.seek(0)


def _by_own_name(loaded: Mapping[str, Any]) -> dict[str, Any]:
    """Return the variables, an object under the name that its file has for it."""
    from scipy.io.matlab import MatlabOpaque

    named = {name: value for name, value in loaded.items() if not name.startswith("__")}
    if isinstance(named.get(OBJECT), MatlabOpaque):
        hidden = named.pop(OBJECT)
        named[hidden["s0"].item().decode(errors="replace")] = hidden
    return named


def _member(value: Any, name: str) -> Member:
    """Return a value as SciPy gives it: structs are arrays with fields, cells are arrays of objects."""
    from scipy.io.matlab import MatlabFunction, MatlabObject, MatlabOpaque

    if isinstance(value, MatlabFunction):
        raise object_of_matlab(name, "a function")
    if isinstance(value, MatlabOpaque):
        kind = value.item()[-2]  # bytes, or a text from SciPy 1.18 on
        raise object_of_matlab(name, kind.decode(errors="replace") if isinstance(kind, bytes) else str(kind))
    if isinstance(value, MatlabObject):
        raise object_of_matlab(name, str(getattr(value, "classname", "") or ""))
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
    return Member(f"an array of {size}", values=lambda selection: value[selection], shape=value.shape)


READER = tree_reader("mat", opened_mat, (".mat",), "run.P", ".")
