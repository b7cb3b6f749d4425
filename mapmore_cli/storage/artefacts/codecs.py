"""How values lie in an HDF5 group, and what of them is fed to a checksum: one codec for each form, made to be put together.

A codec stores one value under a name, in a file (`Writer`) or in a checksum (`Digest`), and reads it back from a file. Scalars are
attributes of their group; arrays are datasets with the attributes `unit` and `description`; whatever has parts is a group. Names chosen by
users never become a path by accident: parts of a sequence are numbered (`000`), and parts of a mapping are named after their keys with `/`,
`%` and a leading dot escaped.
"""

from __future__ import annotations

import hashlib
import math
import mmap
import os
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

import h5py
import numpy as np
from numpy.typing import NDArray

from mapmore_cli.domain.arrays import give_back, in_blocks, row_blocks
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.foreign import is_one_line

NO_UNIT = "-"
"""Unit of texts, identifiers and row numbers."""

LONG, HUGE = 4096, 1 << 20
"""Elements from which on an array is compressed, and from which on it is so no more. Shorter ones stay contiguous, so that any reader finds
them at once; huge ones, so that they can be mapped, and because compressing them takes longer than all else."""

MOST_KEYS = 1000

WORDS = {"<f8": "float", "<i8": "int", "|u1": "flag", None: "text"}
"""What the documentation calls types of values."""

texts_left: ContextVar[int] = ContextVar("texts_left", default=64_000_000)
texts_at_once: ContextVar[int] = ContextVar("texts_at_once", default=1)
"""Characters that the open file may still give, and how many texts of it are read at one time."""


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


@dataclass(frozen=True)
class Label:
    """Description and unit of a field, and the units known where it stands.

    `unit` may name quantities in square brackets: `[target]^2` is the square of the target's unit. `[*]` stands for the key or number of
    the part being written. What `scope` does not know stays in brackets, as documented in docs/file-format.md.
    """

    description: str = ""
    unit: str = "1"
    scope: Mapping[str, str] = field(default_factory=dict)

    def of_part(self, key: str) -> Label:
        """Return the label of one part of a sequence or mapping."""
        return replace(self, unit=self.unit.replace("*", key)) if "*" in self.unit else self

    def within(self, units: Mapping[str, str]) -> Label:
        """Return the label with the units that an object knows added to the scope."""
        every = {**self.scope, **units}
        return replace(self, scope={**self.scope, **{name: _resolved(unit, every) for name, unit in units.items()}})

    def put_on(self, dataset: h5py.Dataset) -> None:
        """Write the two attributes."""
        dataset.attrs["unit"] = _resolved(self.unit, self.scope)
        dataset.attrs["description"] = self.description


def _resolved(unit: str, scope: Mapping[str, str]) -> str:
    """Return the unit with every known `[name]` replaced; a compound unit gets parentheses before a power."""

    def known(match: re.Match[str]) -> str:
        name, power = match.groups()
        found = scope.get(name, f"[{name}]")
        return f"({found}){power}" if power and re.search(r"[*/ ^]", found) else f"{found}{power}"

    return re.sub(r"\[([^\]]*)\](\^?)", known, unit)


@dataclass(frozen=True)
class Writer:
    """Puts values into a group of a file. Types are those of WORDS, None for texts; `parts` are the number of parts, or their keys."""

    group: h5py.Group
    whole = True

    def inner(self, name: str, parts: int | list[str] | None = None) -> Writer:
        """Begin a group inside."""
        group = self.group.create_group(name)
        if isinstance(parts, list):
            group.attrs.create("order", parts, dtype=h5py.string_dtype())
        return Writer(group)

    def scalar(self, name: str, value: Any, dtype: str | None) -> None:
        """Put a single value, which has no unit and description: the documentation has them."""
        self.group.attrs.create(name, value, dtype=dtype)

    def array(self, name: str, value: Any, dtype: str | None, label: Label) -> None:
        """Put an array of numbers, or a list of texts of variable length."""
        if dtype is None:
            dataset = self.group.create_dataset(name, data=value, dtype=h5py.string_dtype(), track_times=False)
        elif value.size < HUGE:
            filters: dict[str, Any] = {"compression": "gzip", "shuffle": True} if value.size >= LONG else {}
            dataset = self.group.create_dataset(name, data=np.asarray(value, dtype=dtype), track_times=False, **filters)
        else:
            dataset = self.group.create_dataset(name, value.shape, dtype, track_times=False)
            for rows in row_blocks(len(value)):
                dataset[rows] = np.asarray(value[rows], dtype=dtype)
                give_back(value)
        label.put_on(dataset)


@dataclass(frozen=True)
class Digest:
    """SHA-256 of values, each after the path that it stands at; without defaults and what is derived (not `whole`)."""

    where: str = ""
    hash: Any = field(default_factory=hashlib.sha256)
    whole = False

    def inner(self, name: str, parts: int | list[str] | None = None) -> Digest:
        """Begin a group inside."""
        below = Digest(f"{self.where}/{name}", self.hash)
        if parts is not None:
            below._add("", parts, None if isinstance(parts, list) else "<i8")
        return below

    def scalar(self, name: str, value: Any, dtype: str | None) -> None:
        """Take in a single value."""
        self._add(f"/{name}", value, dtype)

    def array(self, name: str, value: Any, dtype: str | None, _label: Label) -> None:
        """Take in an array of numbers, or a list of texts."""
        self._add(f"/{name}", value, dtype)

    def _add(self, name: str, values: Any, dtype: str | None) -> None:
        """Take in numbers as little-endian `dtype`, or texts (None) as UTF-8 after their length in bytes."""
        if dtype is None:
            texts = [values] if isinstance(values, str) else values
            self.hash.update(f"{self.where}{name} text {len(texts)}\n".encode())
            for text in texts:
                self.hash.update(len(text.encode()).to_bytes(8, "little") + text.encode())
        else:
            self.hash.update(f"{self.where}{name} {dtype} {np.shape(values)}\n".encode())
            array = values if isinstance(values, np.ndarray) else np.asarray(values, dtype)
            for (block,) in in_blocks(np.atleast_1d(array)):
                self.hash.update(np.ascontiguousarray(block, dtype=dtype).data)


Sink = Writer | Digest


@dataclass(frozen=True)
class Codec:
    """Stores a value under a name, and reads it back.

    - `form`: what docs/file-format.md calls it.
    - `store`: puts a value into a file or a checksum, under a name in the group that is open.
    - `read`: of a group and a name in it; raises Invalid for what is not of the form.
    - `types`: dataclasses that it is made of.
    """

    form: str
    store: Callable[[Sink, str, Any, Label], None]
    read: Callable[[h5py.Group, str], Any]
    types: tuple[type, ...] = ()


def stored(group: h5py.Group, name: str, kind: str) -> Any:
    """Return what stands under a name: the `kind` is `Group` or `Dataset`."""
    where = f"{group.name}/{name}"
    with stored_at(where):
        found = group.get(name)
    if found is None:
        raise Invalid(where, "is missing")
    if not isinstance(found, getattr(h5py, kind)):
        raise Invalid(where, f"is no {kind.lower()}")
    return found


def numbers(dtype: str, ndim: int = 1, load_dtype: str | None = None) -> Codec:
    """Return an array of `ndim` dimensions, stored as `dtype` (little-endian) and read as `load_dtype`."""
    form = f"`{WORDS[dtype]}[{',' * (ndim - 1)}]`"
    loaded = load_dtype or np.dtype(dtype).newbyteorder("=")

    def store(sink: Sink, name: str, value: Any, label: Label) -> None:
        sink.array(name, value if isinstance(value, np.ndarray) else np.asarray(value, dtype=dtype), dtype, label)

    def read(group: h5py.Group, name: str) -> Any:
        dataset = stored(group, name, "Dataset")
        with stored_at(dataset.name):
            shape, found = dataset.shape, dataset.dtype
        if len(shape) != ndim or not np.can_cast(found, dtype, casting="same_kind"):
            raise Invalid(dataset.name, f"is a {len(shape)}-D array of {found}, not a {form}")
        with stored_at(dataset.name):
            values = _mapped(dataset) if dataset.size >= HUGE and dataset.chunks is None else dataset[()]
            values = values.astype(loaded, copy=False)
        values.setflags(write=False)  # several stages may be given the same
        return values

    return Codec(form, store, read)


_mappings: WeakValueDictionary[tuple[int, ...], mmap.mmap] = WeakValueDictionary()
"""One for each file, which all of its columns share: a mapping keeps its file open."""


def _mapped(dataset: h5py.Dataset) -> NDArray[Any]:
    """Return the values of a contiguous dataset where they lie in its file, without reading them."""
    with Path(dataset.file.filename).open("rb") as file:
        now = os.fstat(file.fileno())
        key = (now.st_dev, now.st_ino, now.st_mtime_ns, now.st_size)
        content = _mappings.get(key) or mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    _mappings[key] = content
    return np.frombuffer(content, dataset.dtype, math.prod(dataset.shape), dataset.id.get_offset()).reshape(dataset.shape)


def texts() -> Codec:
    """Return a tuple of texts, as a 1-D dataset of UTF-8 strings of variable length."""

    def store(sink: Sink, name: str, value: Any, label: Label) -> None:
        sink.array(name, list(map(_checked_text, value)), None, replace(label, unit=NO_UNIT))

    def read(group: h5py.Group, name: str) -> tuple[str, ...]:
        """Read few at a time: many can point at one and the same text of the file."""
        dataset, where, found = stored(group, name, "Dataset"), f"{group.name}/{name}", list[str]()
        with stored_at(where):
            if dataset.ndim != 1 or dataset.dtype.kind not in "OS":
                raise Invalid(where, "is no list of texts")
            for start in range(0, len(dataset), step := texts_at_once.get()):
                part = [_valid_text(str(text), where) for text in dataset.asstr()[start : start + step]]
                texts_left.set(texts_left.get() - sum(map(len, part)))
                if texts_left.get() < 0:
                    raise Invalid(where, "holds more text than the file can")
                found += part
        return tuple(found)

    return Codec("`text[]`", store, read)


def scalar(kind: type[float] | type[int] | type[str]) -> Codec:
    """Return a real number, an integer or a short text, as attribute of the group."""
    dtype = {float: "<f8", int: "<i8", str: None}[kind]

    def store(sink: Sink, name: str, value: Any, _label: Label) -> None:
        sink.scalar(name, value if dtype else _checked_text(value), dtype)

    def read(group: h5py.Group, name: str) -> Any:
        where = f"{group.name}/{name}"
        with stored_at(where):
            if name not in group.attrs:
                raise Invalid(where, "is missing")
            if group.attrs.get_id(name).shape != ():
                raise Invalid(where, "is not a single value")
            value = group.attrs[name]
        if dtype is None and isinstance(value, str):
            return _valid_text(value, where)
        if dtype is None or not np.can_cast(np.asarray(value).dtype, dtype, casting="same_kind"):
            raise Invalid(where, f"is no {np.dtype(dtype).name if dtype else 'text'}")
        return kind(value)

    return Codec(f"`{WORDS[dtype]}`", store, read)


def _valid_text(text: str, where: str) -> str:
    """Return the text; Invalid where it is no line of UTF-8, whose bad bytes h5py passes on as lone surrogates."""
    if not is_one_line(text):
        raise Invalid(where, f"has control characters or line breaks, or is no UTF-8: {text[:60]!r}")
    return text


def _checked_text(value: str) -> str:
    """Return the text, if it is one that `_valid_text` reads again; DataError for control characters and undecodable bytes."""
    if not is_one_line(value):
        raise DataError(f"the name {value!r} cannot be stored: it is not one line of valid text", "rename the file or column that it is of")
    return value


def optional(codec: Codec) -> Codec:
    """Return the same, with None stored as nothing."""
    return replace(added(codec, None), form=f"{codec.form} ?")


def added(codec: Codec, default: Any) -> Codec:
    """Return the same for a field that earlier files lack: they are read as if it held the default, which no checksum counts."""

    def store(sink: Sink, name: str, value: Any, label: Label) -> None:
        if value is not None and (sink.whole or default is None or value != default):
            codec.store(sink, name, value, label)

    def read(group: h5py.Group, name: str) -> Any:
        with stored_at(f"{group.name}/{name}"):
            present = name in group or name in group.attrs
        return codec.read(group, name) if present else default

    return replace(codec, store=store, read=read)


def adapted(codec: Codec, store: Callable[[Any], Any], load: Callable[[Any], Any]) -> Codec:
    """Return the same for a value that is changed to what `codec` stores, and back."""
    return replace(
        codec,
        store=lambda sink, name, value, label: codec.store(sink, name, store(value), label),
        read=lambda group, name: load(codec.read(group, name)),
    )


def numbered(codec: Codec) -> Codec:
    """Return a tuple, as a group whose parts are called `000`, `001`, ... without a gap."""

    def store(sink: Sink, name: str, value: Any, label: Label) -> None:
        parts = sink.inner(name, len(value))
        for place, part in enumerate(value):
            codec.store(parts, f"{place:03d}", part, label.of_part(str(place)))

    def read(group: h5py.Group, name: str) -> tuple[Any, ...]:
        parts = stored(group, name, "Group")
        return tuple(codec.read(parts, f"{place:03d}") for place in range(len(parts)))

    return Codec(f"numbered {codec.form}", store, read, codec.types)


def named(codec: Codec) -> Codec:
    """Return a mapping, as a group whose parts are called after the keys; the attribute `order` lists the keys in their order."""

    def store(sink: Sink, name: str, value: Any, label: Label) -> None:
        parts = sink.inner(name, list(map(_checked_text, value)))
        for key, part in value.items():
            codec.store(parts, escaped(key), part, label.of_part(key))

    def read(group: h5py.Group, name: str) -> dict[str, Any]:
        parts = stored(group, name, "Group")
        with stored_at(parts.name):
            if parts.attrs.get_id("order").shape != (len(parts),) or len(parts) > MOST_KEYS:
                raise Invalid(parts.name, "has not as many members as its `order` names")
            keys = [_valid_text(str(key), parts.name) for key in parts.attrs["order"]]
        if len(set(keys)) < len(keys):
            raise Invalid(parts.name, "names a member twice in its `order`")
        return {key: codec.read(parts, escaped(key)) for key in keys}

    return Codec(f"named {codec.form}", store, read, codec.types)


def pairs(codec: Codec) -> Codec:
    """Return a mapping from names to numbers or texts, as a group with the parallel datasets `names` and `values`."""

    def store(sink: Sink, name: str, value: Any, label: Label) -> None:
        parts = sink.inner(name)
        texts().store(parts, "names", list(value), label)
        codec.store(parts, "values", list(value.values()), label)

    def read(group: h5py.Group, name: str) -> dict[str, Any]:
        parts = stored(group, name, "Group")
        values, names = codec.read(parts, "values"), texts().read(parts, "names")
        if len(values) != len(names) or len(set(names)) < len(names):
            raise Invalid(parts.name, f"has {len(values)} values for {len(set(names))} names")
        return dict(zip(names, plain(values), strict=True))

    return Codec(f"`names`/`values` {codec.form}", store, read)


def plain(values: Any) -> Any:
    """Return a list of numbers or texts as Python has them."""
    return values.tolist() if isinstance(values, np.ndarray) else values


def escaped(key: str) -> str:
    """Return the key as one component of an HDF5 path: not empty, without `/`, and not `.`."""
    component = key.replace("%", "%25").replace("/", "%2F")
    return f"%2E{component[1:]}" if component.startswith(".") else component or "%"
