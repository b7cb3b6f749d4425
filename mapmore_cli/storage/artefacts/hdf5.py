"""Write and read HDF5 files: arrays in blocks, texts of a declared length, and protection against
hostile contents.

An HDF5 file can refer to other files of the computer, or to one object a million times, and a
kilobyte on the disk can become gigabytes in memory. The files of a run are plain trees of arrays.
Therefore, a file is checked before any value is read. If it contains anything else, an error names
it.
"""

from __future__ import annotations

import json
import math
import signal
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from io import FileIO
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import h5py
import numpy as np
from h5py import h5a, h5d, h5g, h5l, h5o, h5t, h5z
from numpy.typing import NDArray

from mapmore_cli.domain.arrays import WIDE, give_back, in_blocks, row_blocks
from mapmore_cli.storage.artefacts.schema import (
    ARRAY,
    DEEPEST,
    FROM,
    NO_UNIT,
    SHAPE,
    TYPES,
    Invalid,
    Numbers,
    Reference,
    shared_path,
    stored_at,
)

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

LONG, HUGE = 4096, 1 << 17
"""An array is compressed if it has at least `LONG` and fewer than `HUGE` elements. Shorter arrays
are contiguous, so that any reader finds them at once. Longer arrays are not compressed, so that
they can be mapped into memory, and because compressing them would take longer than everything else.
"""

MOST_ATTRIBUTES, LONGEST_WORD = 100, 4096
"""Largest number of attributes of one object, and of bytes of an attribute of the root."""

ROOM, RATIO = 64_000_000, 300
"""Limits for the size of unpacked data. A file may unpack to `ROOM` bytes plus `RATIO` times its
own size, and a single chunk to `ROOM` bytes. Compression shrinks recordings tenfold, and constant
columns a thousandfold.
"""

DOCUMENT = 32_000_000
"""Largest size of the JSON document in bytes. In memory, it takes twenty times as much."""


class Digest(Protocol):
    """A checksum that is computed step by step."""

    def update(self, data: bytes | memoryview, /) -> None:
        """Add bytes to the checksum."""


def put_array(
    file: h5py.File, path: str, value: Numbers, digest: Digest, description: str, unit: str
) -> None:
    """Store an array at a path and add it to a checksum; a huge array in blocks."""
    dtype = TYPES[value.dtype.type]
    packed = {"compression": "gzip", "shuffle": True} if LONG <= value.size < HUGE else {}
    dataset = file.create_dataset(path, value.shape, dtype, **packed)
    digest.update(head_of_array(path, value, dtype))
    for rows in row_blocks(len(value), WIDE):
        block = np.ascontiguousarray(value[rows], dtype=dtype)
        digest.update(block.data)
        dataset[rows] = block
        give_back(value)
    dataset.attrs.update({"description": description, "unit": unit})


class Waiting(NamedTuple):
    """Array that is not stored yet, with the reference to it in the document, and its label
    (description and unit).
    """

    reference: Reference
    value: Numbers
    label: tuple[str, ...]


def put_arrays(file: h5py.File, arrays: Sequence[Waiting], digest: Digest) -> None:
    """Store arrays and add them to a checksum. If a long array occurs twice, for example as a
    column of a recording and of its curve, it is stored once, and the second one becomes a link.

    A list may have thousands of members with short arrays. Writing a separate dataset for each
    array would take longer than everything else, so the same array of all members is stored in one
    shared dataset, and the references in the document are changed accordingly. An array whose type
    or label differs from that of the first array in the shared dataset gets its own dataset.
    """
    datasets: dict[str, list[Waiting]] = {}
    once: dict[tuple[int, str], str] = {}
    for array in arrays:
        path = array.reference[ARRAY]
        members = datasets.setdefault(path if array.value.size >= LONG else shared_path(path), [])
        if members and (array.value.dtype, array.label) != (
            members[0].value.dtype,
            members[0].label,
        ):
            members = datasets.setdefault(path, [])
        members.append(array)
    for path, members in datasets.items():
        value, start = members[0].value, 0
        if path != members[0].reference[ARRAY]:
            value = np.concatenate([member.value.ravel() for member in members])
            for member in members:
                member.reference.update({ARRAY: path, FROM: start, SHAPE: [*member.value.shape]})
                start += member.value.size
        elif value.size >= LONG:
            _, unit = members[0].label
            if other := once.pop((id(value), unit), None):
                digest.update(as_link(path, other))
                file[path] = file[other]
                continue
            once[id(value), unit] = path
        put_array(file, path, value, digest, *members[0].label)


def put_text(file: h5py.File, path: str, text: str, description: str) -> None:
    """Store a text of any length. The type of the dataset declares the length."""
    data = text.replace("\0", "").encode()
    kind = h5py.string_dtype("utf-8", max(1, len(data)))
    dataset = file.create_dataset(path, data=np.array(data, dtype=kind))
    dataset.attrs.update({"description": description, "unit": NO_UNIT})


def head_of_array(path: str, value: Numbers, dtype: str) -> bytes:
    """Return the bytes of an array's path, type and shape, which a checksum includes before its
    values.
    """
    return f"{path} {dtype} {value.shape}\n".encode()


def add_to_hash(digest: Digest, path: str, value: Numbers, dtype: str) -> None:
    """Add an array to a checksum, after its path, type and shape."""
    digest.update(head_of_array(path, value, dtype))
    for (block,) in in_blocks(np.atleast_1d(value), rows=WIDE):
        digest.update(np.ascontiguousarray(block, dtype=dtype).data)


def as_link(path: str, other: str) -> bytes:
    """Return the bytes that a checksum includes for an array that is stored as a link to another
    array.
    """
    return f"{path} = {other}\n".encode()


def address_of(file: h5py.File, path: str) -> int | None:
    """Return the address of an object in its file, which is the same for two links to one object;
    None if there is no object.
    """
    with stored_at(path):
        return h5o.get_info(file[path].id).addr if path in file else None


def take_array(
    file: h5py.File, path: str, dtype: str, ndim: int, mapped: Callable[[], Any]
) -> NDArray[Any]:
    """Return the array at a path of the file. A huge array is not read as a whole: it is returned
    as a part of `mapped()`, the bytes of the file mapped into memory. Raises Invalid if the array
    has another type or another number of dimensions.
    """
    with stored_at(path):
        dataset = file.get(path)
        if isinstance(dataset, h5py.Dataset) and (dataset.dtype, dataset.ndim) == (
            np.dtype(dtype),
            ndim,
        ):
            if dataset.size < HUGE or dataset.chunks is not None:
                return np.asarray(dataset[()])
            place = dataset.id.get_offset()
            values = mapped()[place : place + dataset.nbytes].view(dtype).reshape(dataset.shape)
            return np.asarray(values)
    raise Invalid(path, f"is not an array of {ndim} dimensions of {np.dtype(dtype).name}")


def root_text(file: h5py.File, name: str) -> str | None:
    """Return an attribute of the root group as a text; None if it does not exist, is not a text, or
    is longer than `LONGEST_WORD` bytes.
    """
    with stored_at(""):
        if name not in file.attrs:
            return None
        attribute = file.attrs.get_id(name)
        kind, value = attribute.get_type(), None
        if (
            attribute.shape == ()
            and kind.get_class() == h5t.STRING
            and kind.get_size() <= LONGEST_WORD
        ):
            value = file.attrs[name]
    return value.decode(errors="replace") if isinstance(value, bytes) else value


def take_document(file: h5py.File) -> tuple[str, Any]:
    """Return the JSON document of a file, first as text and then as Python objects. Raises Invalid
    if it is not valid JSON.
    """
    where = "document"
    with stored_at(where):
        dataset = file.get(where)
        is_text = (
            isinstance(dataset, h5py.Dataset) and dataset.shape == () and dataset.dtype.kind == "S"
        )
        if not is_text or dataset.dtype.itemsize > DOCUMENT:
            raise Invalid(where, f"is not a text of at most {DOCUMENT // 10**6} MB")
        data = bytes(dataset[()])
    # JSON has no NaN and no infinity: if the document has them, this function raises a KeyError
    no_number = dict[str, float]().__getitem__
    try:
        text = data.decode()
        document = json.loads(
            text, object_pairs_hook=_without_repeated_keys, parse_constant=no_number
        )
        return text, document
    except (ValueError, KeyError, RecursionError) as fault:
        raise Invalid(where, f"is not valid JSON ({str(fault)[:100]})") from fault


def _without_repeated_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    members = dict(pairs)
    if len(members) < len(pairs):
        raise ValueError("a key occurs twice")
    return members


def look_over(file: h5py.File, size: int, ratio: int) -> None:
    """Raise Invalid for a file that is not a plain tree of numbers and texts, or that unpacks to
    far more than its `size` in bytes.

    The following is refused:

    - links, except hard links; each group may have one hard link, and each dataset two,
    - data in other files (external storage, virtual datasets),
    - filters other than gzip and byte shuffle,
    - types other than numbers and texts of a declared length,
    - attributes that are more than a few numbers or one short text,
    - groups that are nested too deeply.
    """
    most = room = ROOM + ratio * size
    links: list[tuple[bytes, int]] = []
    with stored_at(""):
        file.id.links.visit(lambda name, info: links.append((name, info.type)), info=True)
        seen = Counter([h5o.get_info(file.id).addr])
    _check_attributes(h5g.open(file.id, b"/"), "")
    for name, kind in links:
        where = name.decode(errors="replace")
        if kind != h5l.TYPE_HARD:
            raise Invalid(where, "is a link to another place")
        with stored_at(where):
            node = h5o.open(file.id, name)
            info = h5o.get_info(node)
        if seen[info.addr] > (info.type == h5o.TYPE_DATASET):
            raise Invalid(where, "is linked too many times")
        seen[info.addr] += 1
        if info.type not in (h5o.TYPE_GROUP, h5o.TYPE_DATASET):
            raise Invalid(where, "is neither a group nor a dataset")
        if name.count(b"/") > DEEPEST:
            raise Invalid(where, f"is nested more than {DEEPEST} groups deep")
        _check_attributes(node, where)
        room -= _bytes_of(node, where) if info.type == h5o.TYPE_DATASET else 0
        if room < 0:
            raise Invalid(
                where,
                (
                    f"increases the file of {size} bytes to more than {most / 1000000.0:.0f} MB "
                    "of values"
                ),
            )


def _check_attributes(node: h5g.GroupID | h5d.DatasetID, where: str) -> None:
    """Raise Invalid for an attribute that is more than a few numbers or one short text. Only the
    sizes and types of the attributes are examined, not their values.
    """
    with stored_at(where):
        count = h5a.get_num_attrs(node)
        if count > MOST_ATTRIBUTES:
            raise Invalid(where, f"has {count} attributes")
        for place in range(count):
            attribute = h5a.open(node, index=place)
            kind, width = attribute.get_type().get_class(), attribute.get_type().get_size()
            text = kind == h5t.STRING and attribute.shape == ()
            if (
                not (text or kind in (h5t.FLOAT, h5t.INTEGER))
                or width * math.prod(attribute.shape or ()) > LONGEST_WORD
            ):
                name = attribute.name.decode(errors="replace")[:60]
                raise Invalid(
                    where,
                    f"has the attribute {name!r}, which is neither numbers nor one short text",
                )


def _bytes_of(dataset: h5d.DatasetID, where: str) -> int:
    """Return the number of bytes that the values of a dataset take in memory. Raises Invalid if the
    values are in other files, or have a filter or a type that files of a run never have.
    """
    with stored_at(where):
        plist, kind = dataset.get_create_plist(), dataset.get_type()
        layout, width, shape = plist.get_layout(), int(kind.get_size()), dataset.shape
        external, filters = plist.get_external_count(), range(plist.get_nfilters())
        used = {plist.get_filter(place)[0] for place in filters}
        chunk = math.prod(plist.get_chunk()) * width if layout == h5d.CHUNKED else 0
        text = kind.get_class() == h5t.STRING and not kind.is_variable_str()
    if layout not in (h5d.COMPACT, h5d.CONTIGUOUS, h5d.CHUNKED) or external:
        raise Invalid(where, "takes its values from other files or datasets")
    if used - {h5z.FILTER_DEFLATE, h5z.FILTER_SHUFFLE}:
        raise Invalid(where, "is compressed by a filter other than gzip and byte shuffle")
    if not text and kind.get_class() not in (h5t.FLOAT, h5t.INTEGER):
        raise Invalid(where, "holds neither numbers nor texts of a declared length")
    if shape is None:
        raise Invalid(where, "has no values")
    if chunk > ROOM:
        raise Invalid(where, f"is cut into chunks of more than {ROOM // 10**6} MB")
    return width * math.prod(shape)  # type: ignore[no-any-return]


@contextmanager
def interrupted_later() -> Iterator[None]:
    """Delay Ctrl-C until the end of the context. HDF5 calls functions of Python in it; if
    KeyboardInterrupt were raised in such a function, it would be lost, and the program would
    continue.
    """
    if threading.current_thread() is not threading.main_thread() or not callable(
        signal.getsignal(signal.SIGINT)
    ):
        yield
        return
    heard: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _frame: heard.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if heard:
        signal.raise_signal(signal.SIGINT)


class SteadyFile(FileIO):
    """A file for HDF5 in which no write seems to fail. The first error is stored in `fault`, and
    everything that is written later is discarded.

    If HDF5 sees that a write fails, it cannot close the file, and crashes when the program exits.
    So errors are hidden from HDF5, and the caller checks `fault` after the file is closed.
    """

    fault: OSError | None = None

    def write(self, data: ReadableBuffer) -> int:
        """Write the data. After a fault, write nothing, but report success."""
        rest = memoryview(data)
        size = rest.nbytes
        while len(rest) and self.fault is None:
            try:
                rest = rest[super().write(rest) :]
            except OSError as fault:
                self.fault = fault
        return size

    def truncate(self, size: int | None = None) -> int:
        """Set the length of the file. After a fault, do nothing, but report success."""
        try:
            return super().truncate(size) if self.fault is None else size or 0
        except OSError as fault:
            self.fault = fault
            return size or 0


@contextmanager
def steady(handle: int) -> Iterator[h5py.File]:
    """Open a file handle for writing. Raises OSError at the end if the disk was full.

    The versions of the format are fixed and times are left out, so that equal contents give equal
    bytes, and old readers understand them.
    """
    raw = SteadyFile(handle, "r+b", closefd=False)
    try:
        with h5py.File(raw, "w", driver="fileobj", libver=("earliest", "v110")) as file:
            yield file
    finally:
        if raw.fault:
            raise raw.fault
