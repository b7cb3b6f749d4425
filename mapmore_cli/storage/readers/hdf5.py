"""Read HDF5 and netCDF-4 files, and HDF5 files that MATLAB wrote.

Groups, datasets, and fields of compound datasets have addresses such as `group/dataset[:,0]`. With
`root: "group[*]"`, each member of a group is a recording. Members are in natural order (run_2
before run_10). Only the wanted columns are read.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import replace
from functools import partial
from importlib import import_module
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import (
    BOMB_RATIO,
    BOMB_SIZE,
    Noted,
    TableRequest,
    reading,
    refuse_bombs,
)
from mapmore_cli.storage.tables.matlab_objects import object_of_matlab
from mapmore_cli.storage.tables.members import (
    Member,
    Selection,
    Values,
    array_of,
    group_of,
    size_in_words,
    table_of_fields,
)
from mapmore_cli.storage.tables.overview import tree_reader

if TYPE_CHECKING:
    import h5py


@contextmanager
def opened_hdf5(
    path: Path, label: str, _request: TableRequest | None, kind: str = "HDF5 file"
) -> Iterator[Member]:
    """Open an HDF5 file; a file that MATLAB wrote is read as a MAT file.

    Raises DataError for a file that is no HDF5 file, is damaged, or refers to other files.
    """
    import h5py

    with reading(label, kind), path.open("rb") as stream:
        if stream.read(3) == b"CDF":
            raise DataError(
                f"{label}: is a netCDF file of the classic format; only netCDF-4 can be read",
                "convert it, for example with `nccopy -k nc4 old.nc new.nc`",
            )
        with h5py.File(stream, "r") as file:
            _refuse_other_files(file, label)
            # `get` returns None if the name is a link without a target
            members = (file.get(name) for name in file)
            by_matlab = any(
                "MATLAB_class" in member.attrs for member in members if member is not None
            )
            if by_matlab or kind == "MAT file":
                yield _matlab_struct(file, "the file")
            else:
                yield _member(file)


def _member(node: h5py.HLObject) -> Member:
    if hasattr(node, "keys"):
        return group_of(f"a group of {len(node)}", list(node), lambda name: _below(node, name))
    if getattr(node, "shape", None) is None:
        return EMPTY
    if fields := node.dtype.names:
        return table_of_fields(fields, node.shape, partial(_reader, node), _noted(node))
    packing = {name: value for name in PACKING if (value := _attribute(node, name)) is not None}
    for name, value in packing.items():
        if isinstance(value, str) and name != UNSIGNED:
            raise DataError(
                f"{node.name}: its attribute {name} is not a number",
                "write the attribute as a number",
            )
    read = _reader(node)
    noted = replace(_noted(node), is_scaled="scale_factor" in packing or "add_offset" in packing)
    return array_of(
        (lambda selection: _meant(read(selection), packing)) if packing else read, node.shape, noted
    )


def _noted(dataset: h5py.Dataset) -> Noted:
    unit = str(next(filter(None, (_attribute(dataset, name) for name in UNIT)), ""))
    parts = _parts_written(dataset)
    absent = 0 if parts is None else dataset.size - sum(math.prod(map(len, part)) for part in parts)
    return Noted(unit, never_written=absent)


def _below(group: h5py.Group, name: str) -> Member:
    if (node := group.get(name)) is None:
        raise DataError(
            f"'{name}' is a link without a target",
            "get the whole file again, or name another array",
        )
    return _member(node)


LONGEST, REFERENCE = 4096, 16
"""Largest size of an attribute that is read, and size of a reference to a text, both in bytes."""
UNIT = ("units", "unit", "Units", "Unit")
UNSIGNED, MISSING = "_Unsigned", ("_FillValue", "missing_value")
LIMITS = ("valid_range", "valid_min", "valid_max")
PACKING = ("scale_factor", "add_offset", *LIMITS, UNSIGNED, *MISSING)
"""Attributes in which netCDF states the meaning of the stored numbers."""


def _attribute(node: h5py.HLObject, name: str) -> Values | str | None:
    """Return the numbers or the text of an attribute; None if it is missing or too long."""
    from h5py import h5a

    if name not in node.attrs:
        return None
    stored = h5a.open(node.id, name.encode())
    if stored.get_storage_size() > (REFERENCE if stored.dtype.kind == "O" else LONGEST):
        return None
    values = np.asarray(node.attrs[name]).reshape(-1)
    if values.dtype.kind in "iuf" and values.size:
        return values
    text = values.item() if values.size == 1 else ""
    return text.decode(errors="replace") if isinstance(text, bytes) else str(text)


def _meant(stored: Values, packing: Mapping[str, Any]) -> Array:
    """Return the numbers that stored values mean according to the rules of netCDF: missing and
    invalid values become NaN, and the others are scaled. `packing` holds the attributes of the
    dataset that state these rules.
    """
    kind = stored.dtype.kind
    if str(packing.get(UNSIGNED)).casefold() == "true" and kind == "i":
        unsigned = np.dtype(f"u{stored.dtype.itemsize}")
        stored = stored.astype(unsigned)
        packing = {
            key: value.astype(unsigned) if getattr(value, "dtype", unsigned).kind == "i" else value
            for key, value in packing.items()
        }
    factor, offset = packing.get("scale_factor", [1.0])[0], packing.get("add_offset", [0.0])[0]
    numbers = stored.astype(np.float64) * factor + offset
    # Limits of valid values are compared with the stored values, as netCDF prescribes.
    # But if the stored values are integers and a limit is a float, the scaled values are compared.
    limits = [packing[key] for key in LIMITS if key in packing]
    as_meant = kind != "f" and any(limit.dtype.kind == "f" for limit in limits)
    limited = numbers if as_meant else stored
    least, most = packing.get("valid_range", [-np.inf, np.inf])
    invalid = (limited < packing.get("valid_min", [least])[0]) | (
        limited > packing.get("valid_max", [most])[0]
    )
    for marks in (packing[key] for key in MISSING if key in packing):
        with np.errstate(over="ignore"):
            invalid |= np.isin(stored, marks.astype(stored.dtype) if kind == "f" else marks)
    return np.where(invalid, np.nan, numbers)


EMPTY = Member("an empty array", values=lambda _: np.zeros(0))


def _reader(dataset: h5py.Dataset, field: str | None = None) -> Callable[[Selection], Values]:
    """Return a function that reads a selection of a dataset, or of one of its fields."""
    import h5py

    def read(selection: Selection) -> Values:
        _check_fit(selection, dataset.shape)
        kind = dataset.dtype if field is None else dataset.dtype[field]
        checked = _own_values(dataset, selection)
        values = checked if field is None else checked.fields(field)
        if kind.kind != "O" or not dataset.shape:
            # this includes a single text (an array without axes), which h5py returns as bytes
            return _written(dataset, selection, np.asarray(values[selection]))
        if h5py.check_string_dtype(kind):
            return _texts(dataset, values)[selection]
        return np.zeros(1, dtype="V1")

    return read


def _parts_written(dataset: h5py.Dataset) -> list[tuple[range, ...]] | None:
    """Return the parts of a dataset that were written, each as one range of indices for each axis.
    Return None if the whole dataset was written.
    """
    if not dataset.size or dataset.external or dataset.is_virtual:
        return None
    if dataset.chunks is None:
        return None if dataset.id.get_storage_size() else []
    axes = list(zip(dataset.shape, dataset.chunks, strict=True))
    if dataset.id.get_num_chunks() == math.prod(-(-length // step) for length, step in axes):
        return None
    parts = list[tuple[range, ...]]()

    def note(chunk: h5py.h5d.StoreInfo) -> None:
        # the last chunk along an axis may extend beyond its end, where there are no values to count
        starts = zip(chunk.chunk_offset, axes, strict=True)
        parts.append(tuple(range(at, min(at + step, length)) for at, (length, step) in starts))

    dataset.id.chunk_iter(note)
    return parts


def _written(dataset: h5py.Dataset, selection: Selection, values: Values) -> Values:
    """Return the numbers of a selection, with NaN for values that were never written.

    HDF5 allocates space for a whole chunk when the first value of the chunk is written, and the
    rest of the chunk contains the fill value. If the next chunk was never written, fill values at
    the end of a chunk are therefore treated as never written.
    """
    if values.dtype.kind not in "iuf" or (parts := _parts_written(dataset)) is None:
        return values
    absent = np.ones(values.shape, dtype=bool)
    whole = (*selection, *(slice(None),) * (dataset.ndim - len(selection)))
    for part in parts:
        pairs = list(zip(whole, part, strict=True))
        if all(isinstance(index, slice) or index in indices for index, indices in pairs):
            absent[
                tuple(slice(r.start, r.stop) for index, r in pairs if isinstance(index, slice))
            ] = 0
    if absent.ndim == 1 and dataset.chunks and not dataset.dtype.names:
        [axis] = [at for at, index in enumerate(whole) if isinstance(index, slice)]
        for end in np.flatnonzero(absent[1:] & ~absent[:-1]) + 1:
            begin = max(end - dataset.chunks[axis], 0)
            is_filled = np.cumsum((values[begin:end] != dataset.fillvalue)[::-1])[::-1] == 0
            absent[begin:end] |= is_filled
    return np.where(absent, np.nan, values)


def _texts(dataset: h5py.Dataset, values: h5py.Dataset) -> Values:
    """Return a dataset of texts of any length. The texts are read in several parts. After each
    part, the total size is compared with the size of the file, so that a hostile file cannot fill
    the memory.
    """
    size, width = dataset.file.id.get_filesize(), math.prod(dataset.shape[1:])
    parts, total = [np.zeros((0, *dataset.shape[1:]), dtype=object)], 0
    step = max(1, BOMB_SIZE // max(size * width, 1))
    for begin in range(0, len(dataset), step):
        parts.append(values[begin : begin + step])
        total += sum(map(len, parts[-1].flat)) + REFERENCE * parts[-1].size
        # texts are stored without compression, so together they cannot be longer than the file
        refuse_bombs(dataset.name, total, size // BOMB_RATIO)
    return np.concatenate(parts)


# In MATLAB 7.3 files, the axes are in the opposite order.
# MATLAB stores cells and the elements of struct arrays as references to other objects.


def _matlab_struct(group: h5py.Group, kind: str = "a struct") -> Member:
    # the groups #refs# and #subsystem# belong to MATLAB itself
    names = [name for name in group if not name.startswith("#")]

    def member(name: str) -> Member:
        return _matlab_member(group[name])

    return group_of(kind, names, member) if kind == "the file" else Member(kind, names, member)


def _matlab_member(node: h5py.HLObject) -> Member:
    if np.any(_attribute(node, "MATLAB_object_decode")):
        raise object_of_matlab(node.name.lstrip("/"), _class_of(node))
    if not hasattr(node, "keys"):
        return _matlab_array(node)
    fields = list(node.values())
    if not fields or not all(_holds_references(field) and not _class_of(field) for field in fields):
        return _matlab_struct(node)
    # in a struct array, each field is an array of references, one for each element
    return Member(
        f"a struct array of {fields[0].size}",
        count=int(fields[0].size),
        element=lambda index: Member(
            f"element {index} of a struct array",
            list(node),
            lambda name: _referred(node[name], index),
        ),
    )


def _matlab_array(dataset: h5py.Dataset) -> Member:
    # MATLAB stores the size of an empty array instead of its values
    empty, shape = np.any(_attribute(dataset, "MATLAB_empty")), dataset.shape[::-1]
    if _class_of(dataset) == "cell" and _holds_references(dataset):
        return Member(
            "an empty cell array" if empty else f"a cell array of {size_in_words(shape)}",
            count=0 if empty else int(dataset.size),
            element=lambda index: _referred(dataset, index),
        )
    if empty:
        return EMPTY
    if _class_of(dataset) == "char":  # MATLAB stores characters as UTF-16 numbers
        return Member(
            "text", values=lambda _: np.array(["".join(map(chr, dataset[()].ravel().tolist()))])
        )
    if dataset.dtype.names:  # real and imag
        return Member("an array of complex numbers", values=lambda _: np.zeros(1, complex))

    def read(selection: Selection) -> Values:
        _check_fit(selection, shape)
        whole = (*selection, *(slice(None),) * (len(shape) - len(selection)))[::-1]
        return np.transpose(_written(dataset, whole, _own_values(dataset, whole)[whole]))

    return array_of(read, shape, _noted(dataset))


def _class_of(node: object) -> str:
    return str(_attribute(node, "MATLAB_class") or "")


def _holds_references(node: object) -> bool:
    return getattr(node, "dtype", None) == np.dtype("O")


def _referred(dataset: h5py.Dataset, index: int) -> Member:
    """Return the object to which an element of an array of references points. The element is given
    by its index in MATLAB's order.
    """
    return _matlab_member(dataset.file[_own_values(dataset)[()].reshape(-1)[index]])


# Checks before reading
# -------------------------------------------------------------------------------------------------

_read: ContextVar[dict[str, int]] = ContextVar("_read")
"""Bytes of each array of the open file that were read so far, by name."""


def _refuse_other_files(file: h5py.File, label: str) -> None:
    """Raise DataError if the file contains links to other files. Such links are refused before they
    are followed, because they may lead to any file on this computer.
    """
    from h5py import h5l

    def other(name: bytes, info: h5py.h5l.LinkInfo) -> bytes | None:
        return name if info.type == h5l.TYPE_EXTERNAL else None

    if name := file.id.links.visit(other, info=True):
        raise DataError(
            f"{label}: '{name.decode(errors='replace')}' is a link to another file",
            "name that file itself in `files`",
        )
    _read.set({})


def _own_values(dataset: h5py.Dataset, selection: Selection = ()) -> h5py.Dataset:
    """Check that a selection of a dataset may be read, and return the dataset.

    Raises DataError if its values are in other files (external storage, virtual datasets), or if
    the selections that were read from its file so far are together far larger than the file.
    """
    if dataset.external or dataset.is_virtual:
        raise DataError(
            f"{dataset.name} takes its values from other files",
            "write the values into the file itself",
        )
    _refuse_other_filters(dataset)
    read = _read.get({})
    lengths = [
        1 if isinstance(index, int) else length
        for index, length in zip_longest(selection, dataset.shape)
    ]
    # a value takes at least eight bytes, because it becomes a double when it is read
    read[f"{dataset.name}{selection}"] = math.prod(lengths) * max(dataset.dtype.itemsize, 8)
    refuse_bombs(dataset.name, sum(read.values()), dataset.file.id.get_filesize())
    return dataset


def _refuse_other_filters(dataset: h5py.Dataset) -> None:
    """Raise DataError for values that are compressed with a filter that is not installed."""
    from h5py import h5z

    packing = dataset.id.get_create_plist()
    for number in range(packing.get_nfilters()):
        code, _, _, name = packing.get_filter(number)
        if not h5z.filter_avail(code):
            with suppress(ImportError):
                import_module("hdf5plugin")  # importing the package registers its filters
        if not h5z.filter_avail(code):
            called = f"{code} ({name.decode(errors='replace')})" if name else str(code)
            message = f"{dataset.name} is compressed by the filter {called}, which is not installed"
            raise DataError(
                message,
                (
                    "install it with: pip install hdf5plugin; or write the file without it, with "
                    "`h5repack -f NONE`"
                ),
            )


def _check_fit(selection: Selection, shape: Sequence[int]) -> None:
    """Raise IndexError for a selection with more indices than an array has axes. NumPy does the
    same, but h5py raises another error.
    """
    if len(selection) > len(shape):
        raise IndexError(selection)


BEGINS = rb"\x89HDF\r\n\x1a\n"

READER = tree_reader("hdf5", opened_hdf5, (".h5", ".hdf5", ".nc"), "group/dataset", begins=BEGINS)
