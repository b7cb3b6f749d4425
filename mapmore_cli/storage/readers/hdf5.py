"""HDF5 files: groups, datasets, and the fields of compound datasets."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mapmore_cli.storage.readers.mat import matlab_file
from mapmore_cli.storage.tables.members import Member, Selection, check_fit, natural, own_values, refuse_other_files, tables
from mapmore_cli.storage.tables.table import RawTable, Reader, TableRequest, Top, reading
from mapmore_cli.storage.tables.trees import top_of


def read_hdf5(path: Path, request: TableRequest) -> list[RawTable]:
    """Read arrays addressed as `group/dataset[:,0]`; a field of a compound dataset is a member.

    `root: "group[*]"` takes the members of a group in natural order (run_2 before run_10). Only the wanted columns are read. A file that
    MATLAB wrote is read as the MAT file that it is.

    Raises
    ------
    DataError
        No HDF5 file, or a damaged one; an address that leads nowhere; arrays that are not columns of numbers of one length.
    """
    with _opened(path, request.label) as top:
        return tables(top, request)


def peek_hdf5(path: Path, most: int) -> Iterable[Top]:
    """Return the first rows of the log that a file holds."""
    with _opened(path, path.name) as top:
        return [top_of(top, most)]


@contextmanager
def _opened(path: Path, label: str) -> Iterator[Member]:
    import h5py

    with reading(label, "HDF5 file"), path.open("rb") as stream, h5py.File(stream, "r") as file:
        refuse_other_files(file, label)
        members = (file.get(name) for name in file)  # None for a link that leads nowhere
        by_matlab = any("MATLAB_class" in member.attrs for member in members if member is not None)
        yield matlab_file(file) if by_matlab else _member(file)


def _member(found: Any) -> Member:
    if hasattr(found, "keys"):
        names = list(found)
        in_order = sorted(names, key=natural)
        return Member(
            f"a group of {len(names)}",
            names,
            member=lambda name: _member(found[name]),
            count=len(names),
            element=lambda index: _member(found[in_order[index]]),
        )
    fields = found.dtype.names
    size = " x ".join(map(str, found.shape)) or "a single value"
    if fields:
        read = {name: _reader(found, name) for name in fields}
        return Member(f"a table of {size}", fields, member=lambda name: Member(f"a field of {size}", values=read[name], shape=found.shape))
    return Member(f"an array of {size}", values=_reader(found, None), shape=found.shape)


def _reader(dataset: Any, field: str | None) -> Callable[[Selection], Any]:
    def read(selection: Selection) -> Any:
        check_fit(selection, dataset.shape)
        values = own_values(dataset, selection)
        return values[selection] if field is None else values.fields(field)[selection]

    return read


READER = Reader("hdf5", read_hdf5, suffixes=(".h5", ".hdf5"), keys=("root",), column="group/dataset", peek=peek_hdf5)
