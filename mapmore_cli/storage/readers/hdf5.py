"""HDF5 and netCDF-4 files, and those that MATLAB wrote: groups, datasets, and fields of compound
datasets, as `group/dataset[:,0]`.

`root: "group[*]"` takes the members of a group in natural order (run_2 before run_10). Only the
wanted columns are read.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from importlib import import_module
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import (
    BOMB_RATIO,
    BOMB_SIZE,
    Noted,
    TableRequest,
    reading,
    refuse_bombs,
)
from mapmore_cli.storage.tables.members import (
    Member,
    Selection,
    array_of,
    group_of,
    size_in_words,
)
from mapmore_cli.storage.tables.overview import tree_reader


@contextmanager
def opened_hdf5(
    path: Path, label: str, _request: TableRequest | None = None, kind: str = "HDF5 file"
) -> Iterator[Member]:
    """Open an HDF5 file; one that MATLAB wrote is read as the MAT file that it is.

    Raises DataError for no HDF5 file, a damaged one, and one that points into other files.
    """
    import h5py

    with reading(label, kind), path.open("rb") as stream:
        if stream.read(3) == b"CDF":
            what = f"{label}: is a netCDF file of the classic format, and netCDF-4 is read"
            raise DataError(what, "convert it, as by `nccopy -k nc4 old.nc new.nc`")
    with reading(label, kind), path.open("rb") as stream, h5py.File(stream, "r") as file:
        _refuse_other_files(file, label)
        members = (file.get(name) for name in file)  # None for a link that leads nowhere
        by_matlab = any("MATLAB_class" in member.attrs for member in members if member is not None)
        yield _matlab_struct(file, "the file") if by_matlab or kind == "MAT file" else _member(file)


def _member(found: Any) -> Member:
    if hasattr(found, "keys"):
        return group_of(
            f"a group of {len(found)}", list(found), lambda name: _member(_there(found, name))
        )
    if getattr(found, "shape", None) is None:
        return EMPTY
    fields = found.dtype.names
    if fields:
        size = size_in_words(found.shape)

        def field(name: str) -> Member:
            return Member(f"a field of {size}", values=_reader(found, name), shape=found.shape)

        return Member(f"a table of {size}", fields, member=field)
    said = {name: value for name in PACKING if (value := _attribute(found, name)) is not None}
    if wrong := [
        name for name, value in said.items() if isinstance(value, str) and name != UNSIGNED
    ]:
        raise DataError(f"{found.name}: its attribute {wrong[0]} is no number", "write it as one")
    read = _reader(found, None)
    unit = next(filter(None, (_attribute(found, name) for name in UNIT)), "")
    noted = Noted(str(unit), is_scaled="scale_factor" in said or "add_offset" in said)
    values = (lambda selection: _meant(read(selection), said)) if said else read
    return array_of(values, found.shape, noted)


def _there(group: Any, name: str) -> Any:
    found = group.get(name)
    if found is None:
        raise DataError(
            f"'{name}' is a link that leads nowhere",
            "get the whole file again, or name another array",
        )
    return found


LONGEST, REFERENCE = (
    4096,
    16,
)  # bytes of an attribute that is read, and of what leads to a text of any length
UNIT = ("units", "unit", "Units", "Unit")
UNSIGNED, MISSING = "_Unsigned", ("_FillValue", "missing_value")
LIMITS = ("valid_range", "valid_min", "valid_max")
PACKING = ("scale_factor", "add_offset", *LIMITS, UNSIGNED, *MISSING)
"""Attributes by which netCDF says what the stored numbers mean."""


def _attribute(found: Any, name: str) -> Any:
    """Return the numbers of an attribute, or its one text; None where there is none, or one that is
    too long.
    """
    from h5py import h5a

    if name not in found.attrs:
        return None
    stored = h5a.open(found.id, name.encode())
    if stored.get_storage_size() > (REFERENCE if stored.dtype.kind == "O" else LONGEST):
        return None
    values = np.asarray(found.attrs[name]).reshape(-1)
    if values.dtype.kind in "iuf" and values.size:
        return values
    text = values.item() if values.size == 1 else ""
    return text.decode(errors="replace") if isinstance(text, bytes) else str(text)


def _meant(stored: Any, said: Mapping[str, Any]) -> Any:
    """Return what stored numbers mean: NaN where they stand for missing values or are not valid,
    the others scaled.
    """
    kind = stored.dtype.kind
    if str(said.get(UNSIGNED)).casefold() == "true" and kind == "i":
        stored = stored.astype(f"u{stored.dtype.itemsize}")
        said = {
            key: value.astype(stored.dtype) if np.asarray(value).dtype.kind == "i" else value
            for key, value in said.items()
        }
    numbers = (
        stored.astype(np.float64) * said.get("scale_factor", [1.0])[0]
        + said.get("add_offset", [0.0])[0]
    )
    marks = np.concatenate([np.zeros(0), *(said[key] for key in MISSING if key in said)])
    with np.errstate(over="ignore"):
        missing = np.isin(stored, marks.astype(stored.dtype) if kind == "f" else marks)
    least, most = said.get("valid_range", [-np.inf, np.inf])
    least, most = said.get("valid_min", [least])[0], said.get("valid_max", [most])[0]
    meant = any(
        said[key].dtype.kind == "f" for key in LIMITS if key in said
    )  # rather than of the type that is stored
    limited = numbers if meant and kind != "f" else stored
    return np.where(missing | (limited < least) | (limited > most), np.nan, numbers)


EMPTY = Member("an empty array", values=lambda _: np.zeros(0))


def _reader(dataset: Any, field: str | None) -> Callable[[Selection], Any]:
    import h5py

    def read(selection: Selection) -> Any:
        _check_fit(selection, dataset.shape)
        kind = dataset.dtype if field is None else dataset.dtype[field]
        own = _own_values(dataset, selection)
        values = own if field is None else own.fields(field)
        if kind.kind != "O" or not dataset.shape:
            return values[selection]
        return (
            _texts(dataset, values)[selection]
            if h5py.check_string_dtype(kind)
            else np.zeros(1, dtype="V1")
        )

    return read


def _texts(dataset: Any, values: Any) -> Any:
    """Return texts of any length. They are read in parts that cannot fill the memory, up to the
    limit of what a file may unpack to.
    """
    size, parts, total = (
        dataset.file.id.get_filesize(),
        [np.zeros((0, *dataset.shape[1:]), dtype=object)],
        0,
    )
    step = max(1, BOMB_SIZE // max(size * math.prod(dataset.shape[1:]), 1))
    for begin in range(0, len(dataset), step):
        parts.append(values[begin : begin + step])
        total += sum(map(len, parts[-1].flat))
        refuse_bombs(dataset.name, total, size // BOMB_RATIO)  # texts are not packed
    return np.concatenate(parts)


# As MATLAB 7.3 writes them: the axes lie in the opposite order, and cells and elements of struct
# arrays are references ------------------


def _matlab_struct(group: Any, kind: str = "a struct") -> Member:
    names = [
        name for name in group if not name.startswith("#")
    ]  # #refs# and #subsystem# are MATLAB's own

    def member(name: str) -> Member:
        return _matlab_member(group[name])

    return (
        group_of(kind, names, member) if kind == "the file" else Member(kind, names, member=member)
    )


def _matlab_member(found: Any) -> Member:
    if np.any(_attribute(found, "MATLAB_object_decode")):
        raise object_of_matlab(found.name.lstrip("/"), _class_of(found))
    if not hasattr(found, "keys"):
        return (
            _cell_array(found)
            if _class_of(found) == "cell" and _holds_references(found)
            else _array(found)
        )
    fields = list(found.values())
    if not fields or not all(_holds_references(field) and not _class_of(field) for field in fields):
        return _matlab_struct(found)
    names = list(found)  # of a struct array: each is an array of references, one for each element

    def element(index: int) -> Member:
        return Member(
            f"element {index} of a struct array",
            names,
            member=lambda name: _referred(found[name], index),
        )

    return Member(f"a struct array of {fields[0].size}", count=int(fields[0].size), element=element)


def _cell_array(dataset: Any) -> Member:
    if _is_empty(dataset):
        return Member("an empty cell array", count=0)
    return Member(
        f"a cell array of {size_in_words(reversed(dataset.shape))}",
        count=int(dataset.size),
        element=lambda index: _referred(dataset, index),
    )


def _array(dataset: Any) -> Member:
    if _is_empty(dataset):
        return EMPTY
    if _class_of(dataset) == "char":  # stored as numbers: UTF-16
        return Member("text", values=lambda _: np.array([b"text"]))
    if dataset.dtype.names:  # real and imag
        return Member(
            "an array of complex numbers", values=lambda _: np.zeros(1, dtype=np.complex128)
        )
    shape = dataset.shape[::-1]

    def read(selection: Selection) -> Any:
        _check_fit(selection, shape)
        whole = (*selection, *(slice(None),) * (len(shape) - len(selection)))
        return np.transpose(_own_values(dataset, whole[::-1])[whole[::-1]])

    return array_of(read, shape)


def _class_of(found: Any) -> str:
    return str(_attribute(found, "MATLAB_class") or "")


def _is_empty(dataset: Any) -> bool:
    """Return True for an array without elements: what is stored then is its size."""
    return bool(np.any(_attribute(dataset, "MATLAB_empty")))


def _holds_references(found: Any) -> bool:
    return getattr(found, "dtype", None) == np.dtype("O")


def _referred(dataset: Any, index: int) -> Member:
    """Return what a reference leads to, by its number in MATLAB's order."""
    return _matlab_member(dataset.file[_own_values(dataset)[()].reshape(-1)[index]])


def object_of_matlab(name: str, of_class: str) -> DataError:
    """Return what is told of a value whose parts MATLAB alone can make out."""
    return DataError(
        f"'{name}' is an object of MATLAB "
        f"({of_class or 'a table, datetime, timeseries, string or the like'}), not an array "
        "of numbers",
        "save plain arrays in MATLAB: `S = table2struct(T, 'ToScalar', true); save('log.mat', "
        "'-struct', 'S')`, or use `writetable`",
    )


# What is refused before a value is read
# -------------------------------------------------------------------------------------------------

_read: ContextVar[dict[str, int]] = ContextVar("_read")
"""Bytes of each array of the open file that was read so far, by its name."""


def _refuse_other_files(file: Any, label: str) -> None:
    """Raise DataError for links to other files, before one is followed: they may lead anywhere on
    this computer.
    """
    from h5py import h5l

    def other(name: bytes, info: Any) -> bytes | None:
        return name if info.type == h5l.TYPE_EXTERNAL else None

    if name := file.id.links.visit(other, info=True):
        raise DataError(
            f"{label}: '{name.decode(errors='replace')}' is a link to another file",
            "name that file itself in `files`",
        )
    _read.set({})


def _own_values(dataset: Any, selection: Selection = ()) -> Any:
    """Return the dataset, of which a selection is read next.

    Raises DataError where its values lie in other files (external storage, virtual datasets), and
    where all that was asked for of its file is far larger than the file.
    """
    if dataset.external or dataset.is_virtual:
        raise DataError(
            f"{dataset.name} takes its values from other files",
            "write the values into the file itself",
        )
    _refuse_other_filters(dataset)
    read = _read.get({})
    lengths = [
        1 if isinstance(one, int) else length
        for one, length in zip_longest(selection, dataset.shape)
    ]
    read[f"{dataset.name}{selection}"] = math.prod(lengths) * dataset.dtype.itemsize
    refuse_bombs(dataset.name, sum(read.values()), dataset.file.id.get_filesize())
    return dataset


def _refuse_other_filters(dataset: Any) -> None:
    """Raise DataError for values that are packed by a filter which is not installed."""
    from h5py import h5z

    packing = dataset.id.get_create_plist()
    for number in range(packing.get_nfilters()):
        code, _, _, name = packing.get_filter(number)
        if not h5z.filter_avail(code):
            with suppress(ImportError):
                import_module("hdf5plugin")  # which registers its filters
        if not h5z.filter_avail(code):
            called = f"{code} ({name.decode(errors='replace')})" if name else str(code)
            what = f"{dataset.name} is packed by the filter {called}, which is not installed"
            raise DataError(
                what,
                "install it with: pip install hdf5plugin; or write the file without it, by "
                "`h5repack -f NONE`",
            )


def _check_fit(selection: Selection, shape: Sequence[int]) -> None:
    """Raise IndexError, as NumPy does and h5py does not, for a selection beyond an array of a
    shape.
    """
    if len(selection) > len(shape) or any(
        isinstance(i, int) and i >= n for i, n in zip(selection, shape, strict=False)
    ):
        raise IndexError(selection)


READER = tree_reader("hdf5", opened_hdf5, (".h5", ".hdf5", ".nc"), "group/dataset")
