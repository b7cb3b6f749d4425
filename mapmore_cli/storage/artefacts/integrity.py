"""Whether an HDF5 file may be read at all, and whether its values are still those that were written.

A file from a stranger is looked over before any value is read: HDF5 can point into other files of the computer, at one object a million
times, or at gigabytes that take a kilobyte on the disk. The files of a run are plain trees of small arrays, so whatever else is in a file
is refused by name.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any

import numpy as np
from h5py import h5d, h5g, h5l, h5o, h5t, h5z

from mapmore_cli.domain.arrays import in_blocks
from mapmore_cli.domain.foreign import is_one_line

if TYPE_CHECKING:
    import h5py

CHECKSUM = "checksum"
"""Attribute of the root: SHA-256 (hexadecimal) of all values in the file."""

DEEPEST = 60
"""Groups within groups: ten sums of sums."""

ROOM = 64_000_000
"""Bytes that a file of any size may unpack to, and that one chunk may have ..."""

RATIO = 300
"""... and beyond that, how many times its own size: columns that stand still shrink a thousandfold, whole recordings tenfold."""

MOST_ATTRIBUTES = 100
MOST_KEYS = 1000


class Invalid(Exception):
    """What is stored is not what the format says: `where` is the path inside of the file, `what` is wrong there."""

    def __init__(self, where: str, what: str) -> None:
        super().__init__(f"{where.lstrip('/') or 'the root'}, {what}")


@contextmanager
def stored_at(where: str) -> Iterator[None]:
    """Turn what h5py raises while it reads something into Invalid. Nothing but calls of h5py stands in the block."""
    try:
        yield
    except (OSError, KeyError, ValueError, TypeError, RuntimeError) as fault:
        why = str(fault).strip("'\"").splitlines()[0] if str(fault) else type(fault).__name__
        raise Invalid(where, f"cannot be read ({why})") from fault


_texts_left: ContextVar[int] = ContextVar("_texts_left", default=ROOM)
_texts_at_once: ContextVar[int] = ContextVar("_texts_at_once", default=1)


def look_over(file: h5py.File, size: int) -> None:
    """Raise Invalid for a file that is no plain tree of numbers and texts, or that unpacks to far more than its `size` in bytes.

    No value is read. Refused are links of all kinds but one hard link to every object, data in other files (external storage, virtual
    datasets), filters other than gzip and byte shuffle, types other than numbers and texts, and groups too deep.
    """
    most = room = ROOM + RATIO * size
    _texts_left.set(most)
    _texts_at_once.set(max(1, ROOM // max(size, 1)))
    with stored_at(""):
        seen = {h5o.get_info(file.id).addr}
    open_groups: list[tuple[str, Any, int]] = [("", h5g.open(file.id, b"/"), 0)]
    while open_groups:
        path, group, depth = open_groups.pop()
        links: list[tuple[bytes, int]] = []
        with stored_at(path):
            group.links.iterate(lambda name, info, links=links: links.append((name, info.type)), info=True)
        for name, kind in links:
            where = f"{path}/{name.decode(errors='replace')}"
            if kind != h5l.TYPE_HARD:
                raise Invalid(where, "is a link to somewhere else")
            with stored_at(where):
                info = h5o.get_info(group, name)
            if info.addr in seen:
                raise Invalid(where, "is linked more than once")
            seen.add(info.addr)
            if info.num_attrs > MOST_ATTRIBUTES:
                raise Invalid(where, f"has {info.num_attrs} attributes")
            if info.type not in (h5o.TYPE_GROUP, h5o.TYPE_DATASET):
                raise Invalid(where, "is neither a group nor a dataset")
            if info.type == h5o.TYPE_GROUP and depth == DEEPEST:
                raise Invalid(where, f"lies more than {DEEPEST} groups deep")
            with stored_at(where):
                if info.type == h5o.TYPE_GROUP:
                    open_groups.append((where, h5g.open(group, name), depth + 1))
                else:
                    room -= _bytes_of(h5d.open(group, name), where)
            if room < 0:
                raise Invalid(where, f"brings the file of {size} bytes to more than {most / 1e6:.0f} MB of values")


def _bytes_of(dataset: Any, where: str) -> int:
    """Bytes of the values of a dataset; Invalid where they do not lie plainly in this file."""
    plist, kind = dataset.get_create_plist(), dataset.get_type()
    layout, width = plist.get_layout(), int(kind.get_size())
    if layout not in (h5d.COMPACT, h5d.CONTIGUOUS, h5d.CHUNKED) or plist.get_external_count():
        raise Invalid(where, "takes its values from other files or datasets")
    if {plist.get_filter(place)[0] for place in range(plist.get_nfilters())} - {h5z.FILTER_DEFLATE, h5z.FILTER_SHUFFLE}:
        raise Invalid(where, "is packed by a filter other than gzip and byte shuffle")
    if kind.get_class() not in (h5t.FLOAT, h5t.INTEGER, h5t.STRING):
        raise Invalid(where, "holds neither numbers nor texts")
    if layout == h5d.CHUNKED and math.prod(plist.get_chunk()) * width > ROOM:
        raise Invalid(where, f"is cut into chunks of more than {ROOM // 10**6} MB")
    return int(math.prod(dataset.shape)) * width


def texts_of(dataset: h5py.Dataset, where: str) -> tuple[str, ...]:
    """Return the texts of a 1-D dataset, few at a time: many can point at one and the same text of the file."""
    found: list[str] = []
    with stored_at(where):
        if dataset.ndim != 1 or dataset.dtype.kind not in "OS":
            raise Invalid(where, "is no list of texts")
        for start in range(0, len(dataset), step := _texts_at_once.get()):
            part = [valid_text(str(text), where) for text in dataset.asstr()[start : start + step]]
            _texts_left.set(_texts_left.get() - sum(map(len, part)))
            if _texts_left.get() < 0:
                raise Invalid(where, "holds more text than the file can")
            found += part
    return tuple(found)


def valid_text(text: str, where: str) -> str:
    """Return the text; Invalid where it is no line of UTF-8, whose bad bytes h5py passes on as lone surrogates."""
    if not is_one_line(text):
        raise Invalid(where, f"has control characters or line breaks, or is no UTF-8: {text[:60]!r}")
    return text


class Digest:
    """SHA-256 of values, in the order in which they are declared."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()

    def add(self, where: str, values: Any, dtype: str | None) -> None:
        """Take in numbers as little-endian `dtype`, or texts (None) as UTF-8 after their length in bytes."""
        if dtype is None:
            texts = [values] if isinstance(values, str) else list(values)
            self._hash.update(f"{where} text {len(texts)}\n".encode())
            for text in texts:
                self._hash.update(len(text.encode()).to_bytes(8, "little") + text.encode())
        else:
            self._hash.update(f"{where} {dtype} {np.shape(values)}\n".encode())
            array = values if isinstance(values, np.ndarray) else np.asarray(values, dtype)
            for (block,) in in_blocks(np.atleast_1d(array)):
                self._hash.update(np.ascontiguousarray(block, dtype=dtype).data)

    @property
    def text(self) -> str:
        """As the file has it."""
        return self._hash.hexdigest()
