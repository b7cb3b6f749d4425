"""MATLAB files: versions 4 to 7 through SciPy, version 7.3 through HDF5; the content decides, not the name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from mapmore_cli.storage.readers.addresses import EVERY, Selection, parse_address
from mapmore_cli.storage.readers.faults import reading
from mapmore_cli.storage.readers.mat73 import matlab_file
from mapmore_cli.storage.readers.members import Member, tables
from mapmore_cli.storage.readers.table import RawTable, TableRequest


def read_mat(path: Path, request: TableRequest) -> list[RawTable]:
    """Read arrays addressed as `run.P`, `train[3].y[:,0]`; `root: "train[*]"` takes every element of a cell or struct array.

    Indices count from 0; cell and struct arrays have one index, in MATLAB's order. Only the variables that are named are read.

    Raises
    ------
    DataError
        No MAT file, or a damaged one; an address that leads nowhere; arrays that are not columns of real numbers of one length.
    """
    import h5py

    with reading(request.label, "MAT file"), path.open("rb") as stream:
        if h5py.is_hdf5(path):
            with h5py.File(stream, "r") as file:
                return tables(matlab_file(file), request)
        return tables(_variables(stream, request), request)


def _variables(stream: Any, request: TableRequest) -> Member:
    """Return the variables of a file, of which those that the request names are loaded."""
    from scipy.io import loadmat, whosmat

    known = [name for name, _, _ in whosmat(stream)]
    addresses = [request.root] if request.root else [column for column in request.columns if isinstance(column, str)]
    wanted = {step for address in addresses for step in parse_address(address.removesuffix(EVERY)).steps[:1]}
    stream.seek(0)
    loaded = loadmat(stream, variable_names=[name for name in known if name in wanted])
    return Member("the file", known, member=lambda name: _member(loaded[name]))


def _member(value: Any) -> Member:
    """Return a value as SciPy gives it: structs are arrays with fields, cells are arrays of objects."""
    if hasattr(value, "toarray"):  # sparse
        value = value.toarray()
    flat = value.reshape(-1, order="F")
    size = " x ".join(map(str, value.shape))
    fields = value.dtype.names
    if fields and value.size == 1:
        return Member("a struct", fields, member=lambda name: _member(flat[0][name]))
    if fields:
        return Member(f"a struct array of {value.size}", count=value.size, element=lambda index: _member(flat[index : index + 1]))
    if value.dtype == np.dtype("O"):
        return Member(f"a cell array of {size}", count=value.size, element=lambda index: _member(flat[index]))

    def select(selection: Selection) -> Any:
        return value[selection]

    return Member(f"an array of {size}", values=select)
