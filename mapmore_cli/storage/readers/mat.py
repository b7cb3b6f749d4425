"""MATLAB files: versions 4 to 7 from their bytes, version 7.3 through HDF5; the content decides, not the name.

Arrays are addressed as `run.P`, `train[3].y[:,0]`; `root: "train[*]"` takes every element of a cell or struct array. Indices count from 0;
cell and struct arrays have one index, in MATLAB's order. Only the variables that are named are unpacked.

SciPy reads these files as well, but damaged ones crash its machine code.
"""

from __future__ import annotations

import math
import struct
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
from mapmore_cli.storage.readers.hdf5 import object_of_matlab, opened_hdf5
from mapmore_cli.storage.tables import BOMB_RATIO, BOMB_SIZE, TableRequest, reading, refuse_bombs
from mapmore_cli.storage.tables.members import Member, group_of, tree_reader

KIND = "MAT file"
MATRIX, COMPRESSED, BYTES, LOGICAL, COMPLEX = 14, 15, 2, 0x200, 0x800
NUMBERS = "-bBhHiIf-d--qQ--BHI"
"""How elements of version 5 hold numbers, and letters, by their type; codes of NumPy."""

CELL, STRUCT, OBJECT, TEXT, SPARSE, FUNCTION, OPAQUE = 1, 2, 3, 4, 5, 16, 17
NUMBERS_4 = "dfihHB"
TEXT_4, SPARSE_4 = 1, 2

HEAD = 1 << 16  # bytes of a packed variable in which its name lies
MOST_ELEMENTS = 100_000  # of a cell or struct array, which are looked at one by one


@contextmanager
def opened_mat(path: Path, label: str, request: TableRequest | None) -> Iterator[Member]:
    """Open a file of any version.

    Raises DataError for no MAT file, or a damaged one; and for a MATLAB object (a table, datetime, ...) that is asked for.
    """
    import h5py

    if h5py.is_hdf5(path):
        with opened_hdf5(path, label, request, KIND) as top:
            yield top
        return
    with reading(label, KIND), path.open("rb") as stream:
        whole = memoryview(stream.read())
        order = {b"IM": "<", b"MI": ">"}.get(bytes(whole[126:128]))
        known = dict(_Version5(order, len(whole)).variables(whole[128:]) if order else _version_4(whole))
        yield group_of("the file", sorted(known), lambda name: known[name](name))


Element = tuple[int, memoryview]
"""Type and bytes."""


@dataclass(frozen=True)
class _Version5:
    """What reads elements in an `order` of bytes, from a file of so many."""

    order: str
    file_size: int

    def variables(self, content: memoryview) -> Iterator[tuple[str, Any]]:
        """Yield the name of each variable, and what reads it under the name that messages have for it."""
        for kind, part in self.elements(content):
            if kind in (MATRIX, COMPRESSED) and part:
                inside = self.elements(self.unpacked(part, HEAD)[8:] if kind == COMPRESSED else part)
                if self.numbers(next(inside))[0] & 0xFF != OPAQUE:
                    next(inside)  # the size
                if name := _letters(next(inside)):  # MATLAB's own have none
                    yield name, partial(self.variable, kind, part)

    def variable(self, kind: int, part: memoryview, name: str) -> Member:
        if kind == COMPRESSED:
            ((_, part),) = self.elements(self.unpacked(part, max(BOMB_SIZE, BOMB_RATIO * self.file_size) + 1))
        return self.member(part, name)

    def unpacked(self, part: memoryview, most: int) -> memoryview:
        unpacker = zlib.decompressobj()
        found = unpacker.decompress(part, most)
        refuse_bombs("the file", len(found), self.file_size)
        if len(found) < most and not unpacker.eof:
            raise ValueError("a variable is cut off")
        return memoryview(found)

    def elements(self, content: memoryview) -> Iterator[Element]:
        """Yield what stands one behind another; ValueError for an element that goes on beyond the end of what was written."""
        place = 0
        while place < len(content):
            kind, size = struct.unpack_from(f"{self.order}II", content, place)
            small = kind >> 16  # bytes that stand in the tag itself
            start, size = (place + 4, small) if small else (place + 8, size)
            if start + size > len(content):
                raise ValueError("an array is cut off")
            yield kind & 0xFFFF, content[start : start + size]
            place = place + 8 if small else start + size + (0 if kind == COMPRESSED else -size % 8)

    def numbers(self, element: Element) -> Array:
        kind, content = element
        return np.frombuffer(content, self.order + NUMBERS[kind])

    def member(self, content: memoryview, name: str) -> Member:
        """Return an array, a struct, or a cell array, from the elements that it is made of."""
        if not content:
            return _array_of(np.zeros((0, 0)))
        parts = self.elements(content)
        flags = int(self.numbers(next(parts))[0])
        of_class = flags & 0xFF
        if of_class in (OBJECT, FUNCTION, OPAQUE):  # an object's class stands behind its size and its name
            raise object_of_matlab(name, "a function" if of_class == FUNCTION else [_letters(part) for part in islice(parts, 3)][2])
        shape = tuple(self.numbers(next(parts)).astype(np.uint32).tolist())
        next(parts)  # the name
        if of_class in (CELL, STRUCT):
            return self.collection(parts, of_class, shape, name)
        if of_class == SPARSE:
            rows, ends, values = (next(parts) for _ in range(3))
            last = self.numbers(ends).clip(0, len(rows[1]))  # of each column, among the rows
            columns = np.repeat(np.arange(len(last) - 1), np.diff(last))
            numbers = self.numbers((BYTES, values[1]) if flags & LOGICAL else values)  # whatever type it says
            return _sparse(self.numbers(rows), columns, numbers, shape, self.file_size, flags & COMPLEX)
        array = self.numbers(next(parts)).reshape(shape, order="F")
        return _text(array) if of_class == TEXT else _array_of(array, flags & COMPLEX)

    def collection(self, parts: Iterator[Element], of_class: int, shape: tuple[int, ...], name: str) -> Member:
        names = []
        if of_class == STRUCT:
            width, letters = int(self.numbers(next(parts))[0]), next(parts)[1]
            names = [_letters((BYTES, letters[i : i + width])) for i in range(0, len(letters), width)]
        inner = [part for _, part in islice(parts, MOST_ELEMENTS + 1)]
        if len(inner) > MOST_ELEMENTS:
            raise DataError(f"'{name}' has more than {MOST_ELEMENTS} elements", "save the measurements as arrays of numbers")
        count = math.prod(shape)
        if len(inner) != count * (len(names) or of_class == CELL):
            raise ValueError(f"{len(inner)} elements of {count}")
        if of_class == CELL:
            return Member(f"a cell array of {_size(shape)}", count=count, element=lambda i: self.member(inner[i], f"{name}[{i}]"))

        def element(number: int, kind: str = "a struct") -> Member:
            own = dict(zip(names, inner[number * len(names) :], strict=False))
            return Member(kind, names, member=lambda field: self.member(own[field], f"{name}.{field}"))

        if count == 1 and names:
            return element(0)
        return Member(f"a struct array of {count}", count=count if names else 0, element=element)


def _letters(element: Element) -> str:
    return bytes(element[1]).rstrip(b"\0").decode(errors="replace")


def _array_of(array: Array, is_complex: int = 0) -> Member:
    numbers = array.astype(np.complex128) if is_complex else array
    return Member(f"an array of {_size(array.shape)}", values=lambda selection: numbers[selection], shape=array.shape)


def _text(codes: Array) -> Member:
    letters = "".join(map(chr, codes.astype(int).reshape(-1, order="F")))
    return Member("text", values=lambda _: np.array([letters]))


def _sparse(rows: Array, columns: Array, values: Array, shape: tuple[int, ...], file_size: int, is_complex: int) -> Member:
    """Return a sparse matrix with its zeros, of which there may be far too many."""
    refuse_bombs(f"a sparse matrix of {_size(shape)}", 8 * math.prod(shape), file_size)
    dense = np.zeros(shape)
    dense[rows[: len(columns)].astype(np.uint32), columns.astype(np.uint32)] = values[: len(columns)]
    return _array_of(dense, is_complex)


def _size(shape: tuple[int, ...]) -> str:
    return " x ".join(map(str, shape))


def _version_4(content: memoryview) -> Iterator[tuple[str, Any]]:
    """Yield the name of each variable, and what reads it."""

    def variable(array: Array, of_class: int, is_complex: int, _name: str) -> Member:
        if of_class != SPARSE_4:
            return _text(array) if of_class == TEXT_4 else _array_of(array, is_complex)
        rows, columns, values = array[:-1].T[:3]  # the places count from 1, and the size stands in the last row
        shape = tuple(array[-1, :2].astype(int).tolist())
        return _sparse(rows - 1, columns - 1, values, shape, len(content), array.shape[1] > 3)

    place = 0
    while place < len(content):
        order = "<" if 0 <= struct.unpack_from("<i", content, place)[0] < 5000 else ">"
        kind, rows, columns, is_complex, length = struct.unpack_from(f"{order}5i", content, place)
        stored = np.dtype(order + NUMBERS_4[kind // 10 % 10])
        start = place + 20 + length
        place = start + rows * columns * stored.itemsize * (2 if is_complex else 1)
        if min(rows, columns, length) < 0 or place > len(content) or kind // 100 not in (0, 10):
            raise ValueError("it begins as neither version 4 nor 5, or breaks off")
        name = _letters((BYTES, content[start - length : start]))
        array = np.frombuffer(content, stored, rows * columns, start).reshape(rows, columns, order="F")
        yield name, partial(variable, array, kind % 10, is_complex)


READER = tree_reader("mat", opened_mat, (".mat",), "run.P", ".")
