"""Read MATLAB files. The versions 5 to 7 are read here, byte by byte; version 4 is read with SciPy,
and version 7.3 as HDF5. The version is recognised by the content, not by the name.

Arrays have addresses such as `run.P` or `train[3].y[:,0]`; `root: "train[*]"` reads every element
of a cell or struct array as a recording. Indices are counted from 0. Cell and struct arrays have
one index, in MATLAB's order. Only the named variables are unpacked. SciPy could read the versions 5
to 7 too, but a damaged file of these versions can crash its compiled code.
"""

from __future__ import annotations

import math
import struct
import warnings
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.readers.hdf5 import BEGINS, EMPTY, opened_hdf5
from mapmore_cli.storage.tables import BOMB_RATIO, BOMB_SIZE, TableRequest, reading, refuse_bombs
from mapmore_cli.storage.tables.matlab_objects import object_of_matlab
from mapmore_cli.storage.tables.members import (
    Member,
    array_of,
    group_of,
    size_in_words,
)
from mapmore_cli.storage.tables.overview import tree_reader

KIND = "MAT file"
MATRIX, COMPRESSED, BYTES, COMPLEX = 14, 15, 2, 0x800
NUMBERS = "-bBhHiIf-d--qQ--BHI"
"""NumPy codes for the numbers and characters in an element of version 5; the index is the type of
the element.
"""

CELL, STRUCT, OBJECT, TEXT, SPARSE, FUNCTION, OPAQUE = 1, 2, 3, 4, 5, 16, 17

# largest number of elements of a cell or struct array, because the elements are read one by one
MOST_ELEMENTS = 100_000


@contextmanager
def opened_mat(path: Path, label: str, request: TableRequest | None) -> Iterator[Member]:
    """Open a MATLAB file of any version.

    Raises DataError if the file is no MAT file or is damaged. A MATLAB object (a table, datetime,
    ...) raises DataError only if it is requested.
    """
    import h5py

    if h5py.is_hdf5(path):
        with opened_hdf5(path, label, request, KIND) as top:
            yield top
        return
    with reading(label, KIND), path.open("rb") as stream:
        whole = memoryview(stream.read())
        # files of version 4 have a zero among the first four bytes; later versions begin with text
        if 0 in whole[:4]:
            variables = list(_version_4(path))
        else:
            order = {b"IM": "<", b"MI": ">"}[bytes(whole[126:128])]
            variables = list(_Version5(order, len(whole)).variables(whole[128:]))
        known, names = dict(variables), sorted(name for name, _ in variables)
        yield group_of("the file", names, lambda name: known[name](name))


Element = tuple[int, memoryview]
"""Type and bytes of an element."""


@dataclass(frozen=True)
class _Version5:
    """Reader of a file of version 5 to 7. Such a file consists of elements, each with a type and a
    size. `order` is the byte order of the file (`<` or `>`), and `file_size` is its size in bytes.
    """

    order: str
    file_size: int

    def variables(self, content: memoryview) -> Iterator[tuple[str, Any]]:
        """Yield the name of each variable, and a function that reads the variable. The argument of
        the function is the name of the variable in error messages.
        """
        for kind, part in self.elements(content):
            if kind in (MATRIX, COMPRESSED) and part:
                inside = self.elements(
                    self.unpacked(part, 1 << 16)[8:] if kind == COMPRESSED else part
                )
                if self.numbers(next(inside))[0] & 0xFF != OPAQUE:
                    next(inside)  # the size
                if name := _letters(next(inside)):  # variables of MATLAB itself have no name
                    yield name, partial(self.variable, kind, part)

    def variable(self, kind: int, part: memoryview, name: str) -> Member:
        if kind == COMPRESSED:
            ((_, part),) = self.elements(
                self.unpacked(part, max(BOMB_SIZE, BOMB_RATIO * self.file_size) + 1)
            )
        return self.member(part, name)

    def unpacked(self, part: memoryview, most: int) -> memoryview:
        unpacker = zlib.decompressobj()
        content = unpacker.decompress(part, most)
        refuse_bombs("the file", len(content), self.file_size)
        if len(content) < most and not unpacker.eof:
            raise ValueError("a variable is cut off")
        return memoryview(content)

    def elements(self, content: memoryview) -> Iterator[Element]:
        """Yield the elements in `content`, one after the other. Raises ValueError for an element
        that continues beyond the end of the data.
        """
        place = 0
        while place < len(content):
            kind, size = struct.unpack_from(f"{self.order}II", content, place)
            small = kind >> 16  # the tag of a small element contains the size of the element
            start, size = (place + 4, small) if small else (place + 8, size)
            if start + size > len(content):
                raise ValueError("an array is cut off")
            yield kind & 0xFFFF, content[start : start + size]
            place = place + 8 if small else start + size + (0 if kind == COMPRESSED else -size % 8)

    def numbers(self, element: Element) -> Array:
        kind, content = element
        return np.frombuffer(content, self.order + NUMBERS[kind])

    def member(self, content: memoryview, name: str) -> Member:
        """Return an array, a struct, or a cell array from its elements."""
        if not content:
            return EMPTY
        parts = self.elements(content)
        flags = int(self.numbers(next(parts))[0])
        of_class = flags & 0xFF
        if of_class == FUNCTION:
            raise object_of_matlab(name, "a function")
        # the third element is the name of the class, after the size and the name of the object
        if of_class in (OBJECT, OPAQUE):
            raise object_of_matlab(name, [_letters(part) for part in islice(parts, 3)][2])
        if of_class == SPARSE:
            raise _sparse(name)
        shape = tuple(self.numbers(next(parts)).astype(np.uint32).tolist())
        next(parts)  # the name
        if of_class in (CELL, STRUCT):
            return self.collection(parts, of_class, shape, name)
        if of_class == TEXT:
            kind, letters = next(parts)
            width = self.numbers((kind, letters)).itemsize
            end = "le" if self.order == "<" else "be"
            encoding = {1: "utf-8", 2: f"utf-16-{end}"}.get(width, f"utf-32-{end}")
            text = bytes(letters).decode(encoding, "replace")
            return Member("text", values=lambda _: np.array([text]))
        # complex numbers are read, but `as_numbers` refuses them later
        stored = np.complex128 if flags & COMPLEX else np.float64
        array = self.numbers(next(parts)).reshape(shape, order="F").astype(stored)
        return array_of(array.__getitem__, shape)

    def collection(
        self, parts: Iterator[Element], of_class: int, shape: tuple[int, ...], name: str
    ) -> Member:
        names, count = [], math.prod(shape)
        if of_class == STRUCT:
            width, letters = int(self.numbers(next(parts))[0]), next(parts)[1]
            starts = range(0, len(letters), width)
            names = [_letters((BYTES, letters[i : i + width])) for i in starts]
        inner = [part for _, part in islice(parts, MOST_ELEMENTS + 1)]
        if len(inner) > MOST_ELEMENTS:
            raise DataError(
                f"'{name}' is a cell array or a struct with more than {MOST_ELEMENTS} elements",
                "save the measurements as one array of numbers for each quantity",
            )
        if len(inner) != count * (len(names) or of_class == CELL):
            raise ValueError(f"it holds {len(inner)} elements instead of {count}")
        if of_class == CELL:
            return Member(
                f"a cell array of {size_in_words(shape)}",
                count=count,
                element=lambda i: self.member(inner[i], f"{name}[{i}]"),
            )

        def element(number: int) -> Member:
            values_of_fields = dict(zip(names, inner[number * len(names) :], strict=False))
            return Member(
                "a struct",
                names,
                lambda field: self.member(values_of_fields[field], f"{name}.{field}"),
            )

        if count == 1 and names:
            return element(0)
        return Member(f"a struct array of {count}", count=count if names else 0, element=element)


def _letters(element: Element) -> str:
    return bytes(element[1]).rstrip(b"\0").decode(errors="replace")


def _sparse(name: str) -> DataError:
    return DataError(f"'{name}' is a sparse matrix", f"save `full({name})` in MATLAB")


def _version_4(path: Path) -> Iterator[tuple[str, Any]]:
    """Yield the name of each variable of a file of version 4, and a function that returns the
    variable as a `Member`. SciPy reads version 4 in Python code, which a damaged file cannot crash.
    """
    from scipy.io import loadmat, whosmat

    def member(value: object, name: str) -> Member:
        if not isinstance(value, np.ndarray):
            raise _sparse(name)
        return array_of(value.__getitem__, value.shape)

    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "The default value for `spmatrix`", DeprecationWarning)
        # if several variables have the same name, SciPy warns and returns the last
        warnings.filterwarnings("ignore", "Duplicate variable name")
        variables = loadmat(str(path), appendmat=False)
        names = whosmat(str(path), appendmat=False)
    for name, *_ in names:
        yield name, partial(member, variables[name])


READER = tree_reader("mat", opened_mat, (".mat",), "run.P", ".", begins=rb"MATLAB [57]\.|" + BEGINS)
